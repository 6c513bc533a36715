"""Variants against a baseline, seed by seed: what can be said of the difference, and when nothing can.

With fewer than `LEAST_SEEDS` common seeds there are points only: no interval and no verdict.
    chosen = baseline_of(variants, "random"); [(row.variant.label, row.verdict) for row in compare(variants, chosen)]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from sgimd_torch.catalogue import unknown
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import LEAST_SEEDS, Interval, common_differences, over_seeds
from sgimd_torch.views.variants import Variant

USUAL: Final = "sgim-d"  # the baseline where nobody chose one


@dataclass(frozen=True, eq=False)
class Comparison:
    """The last error of a ``variant`` less that of the baseline: ``seeds`` ``(n_seeds,)`` m, one for each common seed,
    and their interquartile mean ``found`` (m), whose interval is NaN where there are few."""

    variant: Variant
    seeds: Array
    found: Interval

    @property
    def verdict(self) -> str:
        """What the interval says of the difference."""
        if len(self.seeds) < LEAST_SEEDS:
            return f"fewer than {LEAST_SEEDS} common seeds"
        return "better" if self.found.high < 0 else "worse" if self.found.low > 0 else "not told apart"


def baseline_of(variants: Sequence[Variant], name: str | None = None) -> Variant | None:
    """The variant of this ``name``, among those with errors; without a name SGIM-D, else the one with the smallest.

    Raises:
        ValueError: no variant has this name, or it has no errors to compare with.
    """
    evaluated = {variant.name: variant for variant in variants if variant.last_error}
    if name is None:
        return evaluated.get(USUAL) or next(iter(evaluated.values()), None)
    if name not in evaluated:
        raise unknown("--baseline, a variant with errors to compare,", name, sorted(evaluated))
    return evaluated[name]


def compare(variants: Sequence[Variant], baseline: Variant | None) -> list[Comparison]:
    """The others against the baseline: those that have a seed in common, and the same number of movements."""
    if baseline is None:
        return []
    theirs = _last_errors(baseline)
    others = [variant for variant in variants if variant is not baseline and variant.last == baseline.last]
    differences = [(variant, common_differences(_last_errors(variant), theirs)) for variant in others]
    return [Comparison(variant, seeds, found) for variant, seeds in differences if (found := over_seeds(seeds))]


def _last_errors(variant: Variant) -> dict[int, float]:
    return {int(run.config["seed"]): run.at(variant.last) for run in variant.used}
