"""The command ``sgimd``, also ``python -m sgimd_torch``; each of its commands is a module, loaded when asked for."""

from __future__ import annotations

import sys
from typing import Final

from sgimd_torch import __version__
from sgimd_torch.runs.process import Command, dispatch

COMMANDS: Final = {
    "run": Command("sgimd_torch.runs.command_line", "run one learner, evaluate it, write everything to a directory"),
    "sweep": Command(
        "sgimd_torch.runs.sweep", "many runs: options crossed with each other and with seeds, in parallel"
    ),
    "suite": Command("sgimd_torch.views.suite", "one learner on many robots, against random movements", "plot"),
    "table": Command("sgimd_torch.views.table", "results of runs, over their seeds"),
    "report": Command(
        "sgimd_torch.views.report.command", "one page about one run, or about many side by side", "report"
    ),
    "watch": Command("sgimd_torch.views.watch", "TensorBoard on the boards of runs, also while they are still running"),
    "film": Command("sgimd_torch.views.film.command", "a film of what a run has learnt", "film"),
    "demo": Command("sgimd_torch.views.demo", "SGIM-D and random exploration: one figure, one table", "plot"),
}
HELP: Final = f"""usage: sgimd COMMAND [OPTIONS]

A robot arm learns where its float can land, by its own curiosity and by imitating a teacher
(SGIM-D; Nguyen & Oudeyer, 2014).

commands:
{"".join(f"  {name:8}{each.about}{chr(10)}" for name, each in COMMANDS.items())}
examples:
  sgimd demo                                         see it learn, in a minute or two
  sgimd run --algorithm sgim-d --seed 3              one run of 5000 movements, into runs/sgim-d/seed-003
  sgimd run --algorithm sgim-d --seed 3 --resume     after Ctrl-C or a power cut
  sgimd run --environment mypackage.toss:make        on a robot of your own
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-9 --out study
  sgimd table study                                  error of each variant, over its seeds
  sgimd report study                                 curves, maps and tables on one page

sgimd COMMAND --help explains a command; sgimd --version prints the version."""


def main() -> int:
    """The exit code."""
    words = sys.argv[1:]
    if words == ["--version"]:
        print(f"sgimd_torch {__version__}")
        return 0
    return dispatch("sgimd", COMMANDS, HELP, words)


if __name__ == "__main__":
    sys.exit(main())
