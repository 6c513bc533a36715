"""Do demonstrated, learnt and random movements have different means? The paper's analyses of variance of theta.

Section 6 of Nguyen & Oudeyer (2014). Each row compares groups of movements: one-way analyses of variance, one for each
dimension of theta, their p values adjusted by Holm's method for their number. A demonstrator's movements are the thetas
that reproduce their recordings best, eq. (6); the same number of random ones is drawn from Pi. Movements of one run
repeat and refine each other, so a run counts as one: the mean theta that it executed.

The rows are kept in results/anova.csv, since run directories are not shipped:
    update_anova(Path("results/anova.csv"), Path("runs")); anova_cells(Path("results/anova.csv"))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from scipy import stats

from judging import NotRun
from read_results import number, read_rows, read_seeds
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.runs.process import say
from sgimd_torch.spaces import Array, stream
from sgimd_torch.views.statistics import LEVEL, SEED
from tables import Table
from variants import shipped

HEADER: Final = ("compared", "of", "differ", "dimensions", "smallest_p", "largest_p")
KEY: Final = ("compared",)
TAUGHT: Final = {1: "sgim-d-teacher-1", 2: "sgim-d-teacher-2", 3: "sgim-d"}  # SGIM-D, by its demonstrator


Gather = Callable[[Path], Sequence[Array]]  # the groups of one comparison, from the folder of run directories


class Anova(NamedTuple):
    """One test for each dimension: ``p`` ``(dim,)``, and ``adjusted`` ``(dim,)`` for their number (Holm, 1979).

    The smallest of ``adjusted`` is the p of "the groups have the same mean in all dimensions" (Bonferroni).
    """

    p: Array
    adjusted: Array

    @property
    def rejected(self) -> int:
        """In how many dimensions the means differ; the chance that any of them is wrong is at most 5 %."""
        return int((self.adjusted <= 1 - LEVEL).sum())


class Compared(NamedTuple):
    """Groups of movements in words, how many ``rows`` they have, and what was found."""

    groups: str
    rows: str
    found: Anova


def compare(runs: Path) -> tuple[list[Compared], dict[str, str]]:
    """The comparisons, and what is missing for the others. ``runs`` is the folder of run directories.

    Raises:
        ValueError: a file is damaged.
    """
    found, missing = [], {}
    for groups, (unit, gather) in COMPARISONS.items():
        try:
            arrays = gather(runs)
        except NotRun as lacking:
            missing[groups] = str(lacking)
        else:
            found.append(Compared(groups, f"{', '.join(str(len(array)) for array in arrays)} {unit}", anova(*arrays)))
    return found, missing


def anova(*groups: Array) -> Anova:
    """Do these sets of movements have different means? One-way analysis of variance in each dimension of theta.

    Section 6 of Nguyen & Oudeyer (2014): demonstrations against random movements, and the movements that learners
    executed against each other. Rows must be independent of each other. The movements of one run are not, because they
    repeat and refine each other: there a row must be the mean theta of a run, else p is far too small.

    Args:
        groups: ``(n, theta_dim)`` each, two or more groups.

    Raises:
        ValueError: fewer than 2 groups, a group of fewer than 2 rows, unequal dimensions, values that are not finite,
            or a dimension in which no group varies.
    """
    arrays = [np.asarray(group, dtype=np.float64) for group in groups]
    shapes = [array.shape for array in arrays]
    if len(shapes) < 2 or any(len(shape) != 2 or shape[0] < 2 for shape in shapes) or len({s[1] for s in shapes}) > 1:
        raise ValueError(f"anova needs two or more groups (n, theta_dim) of 2 or more rows, got shapes {shapes}")
    if not all(np.isfinite(array).all() for array in arrays):
        raise ValueError("thetas must be finite; were movements at rest left in?")
    still = np.flatnonzero(np.all([np.ptp(array, axis=0) == 0 for array in arrays], axis=0))
    if len(still):
        raise ValueError(f"dimensions {still.tolist()} vary in no group, so there is no variance to compare with")
    p = np.asarray(stats.f_oneway(*arrays, axis=0).pvalue)
    order = np.argsort(p)
    steps = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))  # Holm: the k-th smallest times those left
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(steps, 1.0)
    return Anova(p, adjusted)


def update_anova(path: Path, runs: Path) -> None:
    """Compare again. A comparison that is not possible keeps its row, and a message says what is missing.

    Raises:
        ValueError: a file is damaged.
        OSError: the table cannot be written.
    """
    table = Table(path, HEADER, KEY)
    found, missing = compare(runs)
    table.merge(
        [
            (groups, rows, each.rejected, len(each.p), float(each.adjusted.min()), float(each.adjusted.max()))
            for groups, rows, each in found
        ]
    )
    kept = table.rows()
    for groups, what in missing.items():
        say(f"{groups}: not run: {what}; " + ("its row stays the same" if (groups,) in kept else "it gets no row"))


def anova_cells(path: Path) -> list[list[str]]:
    """The rows of the page; comparisons that were not made say so.

    Raises:
        ValueError: the table is damaged.
    """
    rows = {row["compared"]: _cells(row, where) for where, row in read_rows(path, HEADER, optional=True)}
    return [rows.get(groups, [groups, "-", "not run", "", ""]) for groups in COMPARISONS]


def _cells(row: dict[str, str], where: str) -> list[str]:
    p = (number(row, name, where) for name in ("smallest_p", "largest_p"))
    in_words = (f"{each:.1e}" if each < 0.001 else f"{each:.3f}" for each in p)
    return [row["compared"], row["of"], f"{row['differ']} of {row['dimensions']}", *in_words]


def shown_by(teacher: int) -> Array:
    """``(n, theta_dim)``, the thetas that reproduce the shipped recordings of a demonstrator best, eq. (6).

    Raises:
        NotRun: the file does not exist.
        ValueError: it is damaged, or of another robot.
    """
    path = shipped(teacher)
    if not path.exists():
        raise NotRun(f"{path}; scripts/make_teachers.py makes it")
    say(f"translating {path.name}")
    primitive = FishingRod().primitive
    demonstrations = load_demonstrations(path, n_joints=len(JOINTS))
    return np.stack([primitive.correspondence(shown.times, shown.trajectory) for shown in demonstrations])


def random_thetas(n: int, name: str) -> Array:
    """``(n, theta_dim)``, uniform in Pi; each name has its own stream."""
    policies, rng = FishingRod().policies, stream(SEED, f"random thetas for {name}")
    return np.stack([policies.sample(rng) for _ in range(n)])


def mean_thetas(folder: Path, variant: str) -> Array:
    """``(n_runs, theta_dim)``, the mean theta that each finished run executed, without movements at rest.

    Raises:
        NotRun: fewer than 2 runs are finished.
        RunError: one is damaged.
    """
    runs = [run for run in read_seeds(folder, variant) if run.summary.get("finished")]
    if len(runs) < 2:
        raise NotRun(f"{variant}, {len(runs)} finished in {folder}, at least 2 are needed")
    return np.stack([run.thetas[np.isfinite(run.thetas).all(axis=1)].mean(axis=0) for run in runs])


def _against_random(teacher: int) -> Gather:
    def gather(runs: Path) -> list[Array]:
        shown = shown_by(teacher)
        return [shown, random_thetas(len(shown), f"demonstrator {teacher}")]

    return gather


def _mean_thetas(*variants: str) -> Gather:
    def gather(runs: Path) -> list[Array]:
        return [mean_thetas(runs, variant) for variant in variants]

    return gather


COMPARISONS: Final[dict[str, tuple[str, Gather]]] = {  # groups in words: what a row is, what gathers them
    **{f"demonstrator {each}, random movements": ("movements", _against_random(each)) for each in TAUGHT},
    **{
        f"SGIM-D taught by demonstrator {each}, Random": ("runs", _mean_thetas(variant, "random"))
        for each, variant in TAUGHT.items()
    },
    "SGIM-D taught by demonstrators 1, 2, 3": ("runs", _mean_thetas(*TAUGHT.values())),
}
