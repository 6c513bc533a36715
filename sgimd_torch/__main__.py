"""The program ``sgimd``, also ``python -m sgimd_torch``; it loads only the module of the command that is called."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Final

from sgimd_torch import __version__
from sgimd_torch.options.catalogue import WORDS, about, unknown_name_error
from sgimd_torch.runs.signals import ONE_THREAD, command, loading

EXTRAS: Final = {
    **dict.fromkeys(("demonstrations", "demo"), "plot"),
    **{name: name for name in ("report", "teach", "film")},
    "paper": "report",
}
"""The extra of the package that each of these commands needs."""
HELP: Final = f"""usage: sgimd COMMAND [OPTIONS]

Robots learn movements for goals by curiosity and by imitating a teacher
(SGIM-D; Nguyen & Oudeyer, 2014).

commands:
{"".join(f"  {name:16}{about('command', name)}{chr(10)}" for name in WORDS["command"])}
examples:
  sgimd demo                                         three learners learn to fish, in a minute or two
  sgimd run --algorithm sgim-d --seed 3              one run of 5000 movements, into runs/sgim-d/seed-003
  sgimd run --algorithm sgim-d --seed 3 --resume     go on with this run after Ctrl-C or a power cut
  sgimd check mypackage.toss:make                    find the mistakes in a robot of your own
  sgimd run --environment mypackage.toss:make        one run on this robot
  sgimd benchmark pool --out goals.npz               make goals for evaluation in places that runs in pool reached
  sgimd demonstrations check shown.npz --environment fishing-rod
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-9 --out study
  sgimd table study                                  print the mean error of each variant over its seeds
  sgimd paper figures                                the figures of the paper's section 6, made anew, in ten minutes
  sgimd report study                                 write curves, maps and tables to one page

sgimd COMMAND --help explains a command; sgimd --version prints the version."""


def main() -> int:
    """Run the command that the first argument names, and return the exit code."""
    for name, threads in ONE_THREAD.items():
        os.environ.setdefault(name, threads)
    return command(_call)


def _call(words: Sequence[str]) -> int:
    name = words[0] if words else "--help"
    if name in ("-h", "--help"):
        print(HELP)
        return 0 if words else 2
    if words == ["--version"]:
        print(f"sgimd_torch {__version__}")
        return 0
    if name not in WORDS["command"]:
        raise unknown_name_error("command", name, WORDS["command"], "; sgimd --help explains the commands")
    try:
        with loading():
            module = importlib.import_module(f"sgimd_torch.{WORDS['command'][name]}")
        return int(module.main(words[1:]))
    except ModuleNotFoundError as error:
        if name not in EXTRAS:
            raise
        hint = f"pip install 'sgimd-torch[{EXTRAS[name]}]' installs it"
        raise ImportError(f"sgimd {name} needs {error.name}, which is not installed; {hint}") from error


if __name__ == "__main__":
    sys.exit(main())
