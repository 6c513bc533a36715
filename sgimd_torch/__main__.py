"""The command ``sgimd``, also ``python -m sgimd_torch``; each of its commands is a module, loaded when asked for."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Sequence
from typing import Final, NamedTuple

from sgimd_torch import __version__
from sgimd_torch.catalogue import unknown
from sgimd_torch.runs.process import command, loading


class Command(NamedTuple):
    """A command: the ``module`` whose ``main(argv)`` it is, one line ``about`` it, and the ``extra`` with what it
    imports, at once or later; if that is not installed, the extra is named."""

    module: str
    about: str
    extra: str = ""


COMMANDS: Final = {
    "run": Command("runs.command_line", "run one learner, evaluate it, write everything to a directory"),
    "sweep": Command("runs.sweep", "many runs: options crossed with each other and with seeds, in parallel"),
    "check": Command("views.check", "does an environment keep every promise? each slip by name"),
    "demonstrations": Command(
        "views.demonstrations", "check demonstrations on a robot, or import them from CSV and LeRobot", "plot"
    ),
    "suite": Command("views.suite", "one learner on many robots, against random movements", "plot"),
    "benchmark": Command("views.benchmark", "goals of evaluation from what runs have reached"),
    "table": Command("views.table", "results of runs, over their seeds"),
    "report": Command("views.report.command", "one page about one run, or about many side by side", "report"),
    "teach": Command("teach.command", "teach a learner by hand, in a browser", "teach"),
    "film": Command("views.film.command", "a film of what a run has learnt", "film"),
    "demo": Command("views.demo", "three learners side by side: one figure, one table", "plot"),
}
HELP: Final = f"""usage: sgimd COMMAND [OPTIONS]

A robot arm learns where its float can land, by its own curiosity and by imitating a teacher
(SGIM-D; Nguyen & Oudeyer, 2014).

commands:
{"".join(f"  {name:16}{each.about}{chr(10)}" for name, each in COMMANDS.items())}
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
    if name not in COMMANDS:
        raise unknown("command", name, COMMANDS, "; sgimd --help explains them")
    chosen = COMMANDS[name]
    try:
        with loading():
            module = importlib.import_module(f"sgimd_torch.{chosen.module}")
        return int(module.main(words[1:]))
    except ModuleNotFoundError as error:
        if not chosen.extra:
            raise
        hint = f"pip install 'sgimd-torch[{chosen.extra}]' installs it"
        raise ImportError(f"sgimd {name} needs {error.name}, which is not installed; {hint}") from error


if __name__ == "__main__":
    sys.exit(main())
