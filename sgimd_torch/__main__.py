"""The command ``sgimd``, also ``python -m sgimd_torch``; each of its commands is a module, loaded when asked for."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Final

from sgimd_torch import __version__
from sgimd_torch.catalogue import EXTRAS, WORDS, about, unknown
from sgimd_torch.runs.process import command, loading

HELP: Final = f"""usage: sgimd COMMAND [OPTIONS]

A robot arm learns where its float can land, by its own curiosity and by imitating a teacher
(SGIM-D; Nguyen & Oudeyer, 2014).

commands:
{"".join(f"  {name:16}{about('command', name)}{chr(10)}" for name in WORDS["command"])}
examples:
  sgimd demo                                         see it learn, in a minute or two
  sgimd run --algorithm sgim-d --seed 3              one run of 5000 movements, into runs/sgim-d/seed-003
  sgimd run --algorithm sgim-d --seed 3 --resume     after Ctrl-C or a power cut
  sgimd run --environment mypackage.toss:make        on a robot of your own
  sgimd check mypackage.toss:make                    what is wrong with it, if anything
  sgimd benchmark pool --out goals.npz               goals for it, where runs in pool have been
  sgimd demonstrations check shown.npz --task fishing-rod
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-9 --out study
  sgimd table study                                  error of each variant, over its seeds
  sgimd report study                                 curves, maps and tables on one page

sgimd COMMAND --help explains a command; sgimd --version prints the version."""


def main() -> int:
    """Run the command that the first word names; the exit code."""
    for library in ("OMP", "OPENBLAS", "MKL"):  # matrices are small here: their threads would only wait for each other
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
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
        raise unknown("command", name, WORDS["command"], "; sgimd --help explains them")
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
