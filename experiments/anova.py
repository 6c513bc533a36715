"""Do demonstrated, learnt and random movements have different means? The paper's analyses of variance of theta.

Section 6 of Nguyen & Oudeyer (2014). Each row compares groups of movements: one-way analyses of variance, one for each
dimension of theta, their p values adjusted by Holm's method for their number. A demonstrator's movements are the thetas
that reproduce their recordings best, eq. (6); the same number of random ones is drawn from Pi. Movements of one run
repeat and refine each other, so a run counts as one: the mean theta that it executed.

The rows are kept in results/anova.csv, since run directories are not shipped:
    update_anova(Path("results"), Path("runs")); anova_cells(Path("results"))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from scipy import stats

from judging import NotRun
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import JOINTS, FishingRod
from sgimd_torch.runs.process import say
from sgimd_torch.spaces import Array, stream
from sgimd_torch.views.statistics import LEVEL, SEED
from table import merge, read_seeds, read_table
from variants import shipped

TAUGHT: Final = {1: "sgim-d-teacher-1", 2: "sgim-d-teacher-2", 3: "sgim-d"}  # SGIM-D, by its demonstrator


def anova(*groups: Array) -> Array:
    """``(dim,)``: do these sets of movements have different means? One-way analysis of variance in each dimension.

    The p values are adjusted for their number (Holm, 1979): the chance that any of the dimensions below 0.05 is wrong
    is at most 5 %, and the smallest is the p of "the groups have the same mean in all dimensions" (Bonferroni).

    Args:
        groups: ``(n, theta_dim)`` each, two or more groups, of 2 or more rows that are independent of each other. The
            movements of one run are not: there a row must be the mean theta of a run, else p is far too small.

    Raises:
        ValueError: values that are not finite.
    """
    if not all(np.isfinite(group).all() for group in groups):
        raise ValueError("thetas must be finite; were movements at rest left in?")
    p = np.asarray(stats.f_oneway(*groups, axis=0).pvalue)
    order = np.argsort(p)
    adjusted = np.empty_like(p)
    adjusted[order] = np.maximum.accumulate(p[order] * np.arange(len(p), 0, -1))  # the k-th smallest times those left
    return np.minimum(adjusted, 1.0)


def update_anova(folder: Path, runs: Path) -> None:
    """Compare again. A comparison that is not possible keeps its row, and a message says what is missing.

    Raises:
        ValueError: a file is damaged.
        OSError: the table cannot be written.
    """
    rows: list[dict[str, Any]] = []
    for groups, (unit, gather) in COMPARISONS.items():
        try:
            arrays = gather(runs)
        except NotRun as missing:
            say(f"{groups}: not run: {missing}; a row of an earlier comparison stays as it is")
            continue
        p = anova(*arrays)
        counts = {"differ": int((p <= 1 - LEVEL).sum()), "dimensions": len(p)}
        smallest = {"smallest_p": float(p.min()), "largest_p": float(p.max())}
        of = f"{', '.join(str(len(array)) for array in arrays)} {unit}"
        rows.append({"compared": groups, "of": of, **counts, **smallest})
    merge(folder, "anova.csv", rows)


def anova_cells(folder: Path) -> list[list[str]]:
    """The rows of the page; comparisons that were not made say so.

    Raises:
        ResultsError: the table is damaged.
    """
    kept = read_table(folder, "anova.csv").set_index("compared").to_dict("index")

    def cells(groups: str) -> list[str]:
        if groups not in kept:
            return [groups, "-", "not run", "", ""]
        row = kept[groups]
        in_words = (f"{p:.1e}" if p < 0.001 else f"{p:.3f}" for p in (row["smallest_p"], row["largest_p"]))
        return [groups, row["of"], f"{row['differ']} of {row['dimensions']}", *in_words]

    return [cells(groups) for groups in COMPARISONS]


def shown_by(teacher: int) -> Array:
    """``(n, theta_dim)``, the thetas that reproduce the shipped recordings of a demonstrator best, eq. (6).

    Raises:
        NotRun: the file does not exist.
        ValueError: it is damaged, or of another robot.
    """
    path = shipped(teacher)
    if not path.exists():
        raise NotRun(f"{path}; scripts/make_teachers.py makes it")
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


def _against_random(teacher: int, runs: Path) -> list[Array]:
    shown = shown_by(teacher)
    return [shown, random_thetas(len(shown), f"demonstrator {teacher}")]


def _mean_thetas(variants: Sequence[str], runs: Path) -> list[Array]:
    return [mean_thetas(runs, variant) for variant in variants]


# Groups in words: what a row is, and what gathers them from the folder of run directories.
COMPARISONS: Final[dict[str, tuple[str, Callable[[Path], list[Array]]]]] = {
    **{f"demonstrator {each}, random movements": ("movements", partial(_against_random, each)) for each in TAUGHT},
    **{
        f"SGIM-D taught by demonstrator {each}, Random": ("runs", partial(_mean_thetas, (variant, "random")))
        for each, variant in TAUGHT.items()
    },
    "SGIM-D taught by demonstrators 1, 2, 3": ("runs", partial(_mean_thetas, tuple(TAUGHT.values()))),
}
