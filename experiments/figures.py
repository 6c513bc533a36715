"""The figures of the paper's results, from results/paper.csv and, where movements are shown, from run directories.

Each is written as png and svg. A figure without its data is left out, and a line says what it lacks.

  errors         error against movements, five learners           (fig. a of the paper's results)
  demonstrators  the same with each of three demonstrators         (b)
  landing        where the float landed, tiles reached             (c, needs RUNS)
  trajectories   what the demonstrators show, joint by joint       (d)
  large_space    error where the task space is 10^4 times larger   (e)
  goals          the goals chosen there                            (f, needs RUNS)
  variants       what each change of SGIM-D, and each rival, makes

Example:
  python experiments/figures.py --results results --runs runs --out results/figures
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from judging import NotRun
from paper_figures import FIGURES, Data
from read_results import read_results
from sgimd_torch.figures.save import save_figure
from sgimd_torch.runs.log import make_folder
from sgimd_torch.runs.process import command


def main(argv: Sequence[str] | None = None) -> int:
    """Draw what can be drawn; the exit code is 2 when the results make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of paper.csv (default: %(default)s)"
    )
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="run directories (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/figures"), help="default: %(default)s")
    parser.add_argument("--only", choices=FIGURES, help="this figure alone")
    options = parser.parse_args(argv)
    data = Data(read_results(options.results / "paper.csv"), options.runs)
    make_folder(options.out)
    for name in FIGURES if options.only is None else [options.only]:
        try:
            png, _ = save_figure(partial(FIGURES[name], data), options.out / name, "png", "svg")
            print(png)
        except NotRun as missing:
            print(f"{name} is left out; not run: {missing}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
