"""The evidence that claims and tables are drawn from: values by seed, pairs of them, and how a number is told.

evidence = Evidence(read_results("results/paper.csv"), read_goals("results/goals.csv")); evidence.errors("sgim-d")
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from read_results import LAST, Evaluated
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, difference_interval

SEED: Final = 2014  # of the bootstrap: each number draws from its own default_rng(SEED), whatever else is computed


class NotRun(LookupError):
    """A claim needs runs, or evaluations, that are not there."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What claims are judged on: ``results`` as of ``read_results``, ``goals`` as of ``read_goals``."""

    results: Mapping[str, Evaluated]
    goals: Mapping[str, Array]

    def at(self, variant: str, movements: int = LAST, values: str = "errors") -> dict[int, float]:
        """Seed -> value.

        Raises:
            NotRun: fewer than 2 seeds have it.
        """
        found = self.results[variant].at(movements, values) if variant in self.results else {}
        if len(found) < 2:
            what = "" if variant not in self.results else f": {len(found)} with {values} at {movements}"
            raise NotRun(f"not run: {variant}{what}")
        return found

    def errors(self, variant: str, movements: int = LAST) -> Array:
        """``(n_seeds,)`` m; raises as ``at`` does."""
        return np.array(list(self.at(variant, movements).values()))

    def curves(self, variant: str) -> tuple[Array, Array]:
        """``(n,)`` movements and ``(n_seeds, n)`` errors (m), of the seeds evaluated at each; raises as ``at`` does."""
        self.at(variant)
        movements, errors = self.results[variant].curves()
        if len(errors) < 2 or len(movements) < 2:
            raise NotRun(f"not run: {variant}: {len(errors)} whole curves")
        return movements, errors

    def difference(self, ours: str, theirs: str, *, values: str = "errors") -> Interval:
        """Ours - theirs (m), on the seeds that both have; raises as ``at`` does."""
        return difference_interval(*shared(self.at(ours, LAST, values), self.at(theirs, LAST, values)), rng=rng())


def rng() -> np.random.Generator:
    """A fresh stream for one number."""
    return np.random.default_rng(SEED)


def shared(ours: dict[int, float], theirs: dict[int, float]) -> tuple[dict[int, float], dict[int, float]]:
    """Both, cut down to the seeds that both have.

    Raises:
        NotRun: fewer than 2.
    """
    seeds = [seed for seed in ours if seed in theirs]
    if len(seeds) < 2:
        raise NotRun("not run: fewer than 2 seeds in common")
    return {seed: ours[seed] for seed in seeds}, {seed: theirs[seed] for seed in seeds}


def show(found: Interval, form: str = ".2f", unit: str = "") -> str:
    """``0.48 [0.45, 0.52]``, a unit behind."""
    return f"{found.value:{form}} [{found.low:{form}}, {found.high:{form}}]" + (f" {unit}" if unit else "")


def metres(found: Interval, form: str = "+.4f") -> str:
    """A difference in metres, sign shown."""
    return show(found, form, "m").replace("-", "−")
