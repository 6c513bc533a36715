"""Do demonstrated, learnt and random movements have different means? The paper's analyses of variance of theta.

Section 6 of Nguyen & Oudeyer (2014). Each line is one comparison: one-way analyses of variance, one for each dimension
of theta, their p values adjusted by Holm's method for their number. Printed, and written between these marker lines:

  <!-- anova -->     <!-- end of anova -->

A demonstrator's movements are the thetas that reproduce his recordings closest, eq. (6); as many random ones are drawn
from Pi. Movements of one run repeat and refine each other, so a run counts as one: the mean theta that it executed.
What has not been run is left out, with a line that says so.

Example:
  python experiments/anova.py --runs runs --out results/RESULTS.md
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

import numpy as np

from claims import EMPTY
from evidence import SEED, NotRun
from pages import markdown, read_page, write_page
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.runs.process import say, telling_errors, with_streams
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.views.statistics import Anova, anova
from variants import shipped

SECTION = "\n## Means of movements, by analysis of variance\n\n<!-- anova -->\n<!-- end of anova -->\n"
COLUMNS = ("means compared", "of", "dimensions of theta in which they differ", "smallest p", "largest p")
TAUGHT = {1: "sgim-d-teacher-1", 2: "sgim-d-teacher-2", 3: "sgim-d"}  # SGIM-D by who teaches it


class Line(NamedTuple):
    """One comparison: its groups in words, what their rows are, and what was found, or why there is nothing."""

    groups: str
    rows: str
    found: Anova | str


def shown_by(teacher: int) -> Array:
    """``(n, theta_dim)``, the thetas that reproduce the shipped recordings of a demonstrator closest, eq. (6).

    Raises:
        NotRun: that file is not there.
        ValueError: it is damaged, or of another robot.
    """
    path = shipped(teacher)
    if not path.exists():
        raise NotRun(f"not there: {path}; scripts/make_teachers.py makes it")
    say(f"translating {path.name}")
    primitive = FishingRod().primitive
    demonstrations = load_demonstrations(path, n_joints=len(JOINTS))
    return np.stack([primitive.correspondence(shown.times, shown.trajectory) for shown in demonstrations])


def random_thetas(n: int, name: str) -> Array:
    """``(n, theta_dim)``, uniform in Pi; each name has its own."""
    policies, rng = FishingRod().policies, stream(SEED, f"random thetas for {name}")
    return np.stack([policies.sample(rng) for _ in range(n)])


def mean_thetas(folder: Path, variant: str) -> Array:
    """``(n_runs, theta_dim)``, the mean theta that each finished run executed, movements at rest left out.

    Raises:
        NotRun: fewer than 2 runs are finished.
        RunError: one is damaged.
    """
    paths = sorted(config.parent for config in folder.glob(f"{variant}/seed-*/config.json"))
    if paths:
        say(f"reading {folder}/{variant}: {len(paths)} runs")
    runs = [run for run in map(read_run, paths) if run.summary.get("finished")]
    if len(runs) < 2:
        raise NotRun(f"not run: {variant}, {len(runs)} finished in {folder}, at least 2 are needed")
    return np.stack([run.thetas[np.isfinite(run.thetas).all(axis=1)].mean(axis=0) for run in runs])


def against_random(teacher: int) -> list[Array]:
    """What a demonstrator shows, and as many random movements; raises as ``shown_by`` does."""
    shown = shown_by(teacher)
    return [shown, random_thetas(len(shown), f"demonstrator {teacher}")]


def compare(runs: Path) -> list[Line]:
    """All comparisons; ``runs`` is the folder of run directories.

    Raises:
        ValueError: a file is damaged.
    """

    def means(*variants: str) -> list[Array]:
        return [mean_thetas(runs, variant) for variant in variants]

    return [
        *(
            _line(f"demonstrator {teacher}, random movements", "movements", partial(against_random, teacher))
            for teacher in TAUGHT
        ),
        *(
            _line(f"SGIM-D taught by demonstrator {teacher}, Random", "runs", partial(means, variant, "random"))
            for teacher, variant in TAUGHT.items()
        ),
        _line("SGIM-D taught by demonstrators 1, 2, 3", "runs", partial(means, *TAUGHT.values())),
    ]


def _line(groups: str, unit: str, gather: Callable[[], Sequence[Array]]) -> Line:
    try:
        arrays = gather()
    except NotRun as missing:
        return Line(groups, "-", str(missing))
    return Line(groups, f"{', '.join(str(len(array)) for array in arrays)} {unit}", anova(*arrays))


def cells(line: Line) -> list[str]:
    """A line of the table in markdown."""
    if isinstance(line.found, str):
        return [line.groups, line.rows, line.found, "", ""]
    adjusted = line.found.adjusted
    return [
        line.groups,
        line.rows,
        f"{line.found.rejected} of {len(adjusted)}",
        *(f"{p:.1e}" if p < 0.001 else f"{p:.3f}" for p in (adjusted.min(), adjusted.max())),
    ]


@telling_errors
def main(argv: Sequence[str] | None = None) -> int:
    """Print the table and write it; the exit code is 2 when a file makes no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="--out of compare.py, default: %(default)s")
    parser.add_argument("--out", type=Path, default=Path("results/RESULTS.md"), help="default: %(default)s")
    options = parser.parse_args(argv)
    table = markdown(COLUMNS, [cells(line) for line in compare(options.runs)])
    text = read_page(options.out, EMPTY)
    if "<!-- anova -->" not in text and "<!-- end of anova -->" not in text:
        text += SECTION
    write_page(options.out, text, {"anova": table})
    print(f"{table}\n{options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(with_streams(main))
