"""The figures of the paper's results, from results/paper.csv and, where movements are shown, from run directories.

Each is written as png and svg. One whose data are missing is left out, and a line says what it lacks.

  errors         error against movements, five learners           (fig. a of the paper's results)
  demonstrators  the same with each of three demonstrators         (b)
  landing        where the float landed, tiles reached             (c, needs RUNS)
  trajectories   what the demonstrators show, joint by joint       (d)
  large_space    error where the task space is 10^4 times larger   (e)
  goals          the goals chosen there                            (f, needs RUNS)
  variants       what each change of SGIM-D, and each rival, makes

Example:
  python experiments/figures.py --results results/paper.csv --runs runs --out results/figures
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

from matplotlib import rc_context
from matplotlib.figure import Figure

from evidence import NotRun
from paper_figures import FIGURES, Data
from read_results import read_results
from sgimd_torch.runs.log import make_folder
from sgimd_torch.runs.process import telling_errors, with_streams

STYLE: Any = {
    "font.size": 12,
    "axes.titlesize": 13,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 2,
    "legend.fontsize": 10.5,
    "svg.hashsalt": "sgimd_torch",  # the same data give the same file
}


def _save(figure: Figure, path: Path) -> None:
    for kind, options in (("png", {"dpi": 150}), ("svg", {"dpi": 150, "metadata": {"Date": None}})):
        whole = path.with_name(f"{path.name}.{kind}")
        partial = whole.with_name(whole.name + ".part")
        figure.savefig(partial, format=kind, **options)
        partial.replace(whole)


@telling_errors
def main(argv: Sequence[str] | None = None) -> int:
    """Draw what can be drawn; the exit code is 2 when the results make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results/paper.csv"), help="default: %(default)s")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="the --out of run.py (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/figures"), help="default: %(default)s")
    parser.add_argument("--only", choices=FIGURES, help="this figure alone")
    options = parser.parse_args(argv)
    data = Data(read_results(options.results), options.runs)
    make_folder(options.out)
    for name, draw in FIGURES.items():
        if options.only not in (None, name):
            continue
        try:
            with rc_context(STYLE):
                _save(draw(data), options.out / name)
            print(f"{options.out / name}.png")
        except NotRun as missing:
            print(f"{name} is left out, for want of {str(missing).removeprefix('not run: ')}")
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
