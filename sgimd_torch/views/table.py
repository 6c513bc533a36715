"""One table of what runs came to: error, noise floor and costs of each learner, over its seeds.

Example:
  for seed in 0 1 2 3 4; do python experiments/run.py --algorithm sgim-d --seed $seed; done
  python experiments/table.py runs
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import numpy as np

from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import with_streams
from sgimd_torch.runs.read import Run, find_runs, read_run

COLUMNS = ("learner", "seeds", "error at 1000", "at 5000 (m)", "noise floor (m)", "physics (ms)", "learning (ms)")


def row(name: str, runs: Sequence[Run], early: int, late: int) -> list[str]:
    """One learner: means over its runs, and the standard deviation over seeds of the late error.

    Raises:
        RunError: a run was not evaluated after ``late`` movements, or its summary is missing.
    """
    evaluated = [run for run in runs if late in run.evaluation["movements"]]
    if len(evaluated) < len(runs):
        missing = next(run.path for run in runs if late not in run.evaluation["movements"])
        raise RunError(f"{missing} has no evaluation after {late} movements; let it run on with --resume, or see --at")
    errors = _at(runs, late, "mean_error_m")
    milliseconds = [np.mean([_milliseconds(run, part) for run in runs]) for part in ("physics", "learner")]
    spread = f" ± {errors.std(ddof=1):.3f}" if len(runs) > 1 else ""
    return [
        name,
        str(len(runs)),
        _metres(_at(runs, early, "mean_error_m")),
        f"{errors.mean():.3f}{spread}",
        _metres(_at(runs, late, "noise_floor_m")),
        *(f"{value:.2f}" for value in milliseconds),
    ]


def _metres(lengths: np.ndarray) -> str:
    mean = lengths.mean()
    return f"{mean:.3f}" if np.isfinite(mean) else "-"


def _milliseconds(run: Run, part: str) -> float:
    """Of one movement, on the mean."""
    try:
        return 1e3 * float(run.summary[f"seconds_{part}"] / run.summary["movements"])
    except (KeyError, TypeError, ZeroDivisionError) as error:
        raise RunError(f"{run.path}: its summary.json is missing or damaged; --resume writes it again") from error


def _at(runs: Sequence[Run], movements: int, column: str) -> np.ndarray:
    values = [run.evaluation[column][run.evaluation["movements"] == movements] for run in runs]
    return np.array([value[0] if value.size else np.nan for value in values])


def main(argv: Sequence[str] | None = None) -> int:
    """Print the table, worst learner first.

    Returns:
        The exit code: 2 when there is nothing to tell.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, help="where the runs are: the --out of run.py")
    parser.add_argument("--at", type=int, default=5000, help="movements after which to compare (default: %(default)s)")
    options = parser.parse_args(argv)
    try:
        found = {name: [read_run(path) for path in paths] for name, paths in find_runs(options.runs).items()}
        found = dict(sorted(found.items(), key=lambda item: -_at(item[1], options.at, "mean_error_m").mean()))
        rows = [row(name, runs, 1000, options.at) for name, runs in found.items()]
    except RunError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    table = [[column.replace("5000", str(options.at)) for column in COLUMNS], *rows]
    widths = [max(map(len, cells)) for cells in zip(*table, strict=True)]
    for cells in table:
        print("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
