"""Statistics over seeds: interquartile means, bootstrap intervals, improvement, Holm.

After Agarwal et al. (2021), "Deep reinforcement learning at the edge of the statistical precipice": few seeds, so every
number comes with an interval. ``errors`` are mean benchmark errors (m), one for each seed; smaller is better.
    found = iqm_interval(errors, rng=rng()); show(iqm_interval(errors, rng=rng()))
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping
from typing import Final, NamedTuple, TypeVar

import numpy as np
from scipy import optimize, stats

from sgimd_torch.spaces import Array

Key = TypeVar("Key", bound=Hashable)
LEVEL = 0.95
RESAMPLES = 9999
LEAST_SEEDS: Final = 5  # with fewer there are points: no interval, no verdict
SEED: Final = 2014  # of the bootstrap: each number draws from its own default_rng(SEED)


class Interval(NamedTuple):
    """A statistic of the data, and its interval from ``low`` to ``high``, of 95 % unless said; NaN for few seeds."""

    value: float
    low: float
    high: float


def rng() -> np.random.Generator:
    """A fresh stream for one number."""
    return np.random.default_rng(SEED)


def show(found: Interval, form: str = ".2f", unit: str = "") -> str:
    """``0.48 [0.45, 0.52]``, followed by a unit; without brackets for few seeds. A minus is a hyphen, for programs."""
    between = "" if np.isnan(found.low) else f" [{found.low:{form}}, {found.high:{form}}]"
    return f"{found.value:{form}}{between}{f' {unit}' if unit else ''}"


def metres(found: Interval, form: str = "+.4f") -> str:
    """A difference in metres, sign shown: ``−0.0103 [−0.0162, −0.0074] m``."""
    return show(found, form, "m").replace("-", "−")


def interquartile_mean(values: Array) -> Array:
    """Mean of the middle half: a quarter of the ``(..., n_seeds)`` values, rounded down, is cut at either end.

    With 2 or 3 seeds nothing is cut and it is the mean; of 10 it is the mean of the middle 6.
    """
    means: Array = stats.trim_mean(values, 0.25, axis=-1)
    return means


def interval(
    statistic: Callable[..., Array],
    *samples: Array,
    rng: np.random.Generator,
    paired: bool = False,
    level: float = LEVEL,
) -> Interval:
    """Percentile bootstrap: the statistic of seeds drawn again with replacement, 9999 times; its middle 95 %.

    Stratified: seeds are drawn from each sample by itself, as many as it has. If errors are normal, the interval holds
    the true interquartile mean 94 % of the time with 10 or 20 seeds, but 90 % with 5: there it is too narrow. With
    fewer than ``LEAST_SEEDS`` in a sample there is only a `point`.

    Args:
        statistic: of arrays ``(..., n_seeds, *rest)``, one for each sample; returns ``(...)``.
        samples: ``(n_seeds, *rest)`` each.
        rng: draws the seeds.
        paired: all samples are of the same seeds in the same order, which are drawn together.
        level: confidence, .95 or another one; see `holm`.

    Raises:
        ValueError: a sample of fewer than 2 seeds, one that is not finite, or paired ones of unequal length.
    """
    samples = tuple(np.asarray(sample, dtype=np.float64) for sample in samples)
    for sample in samples:
        if len(sample) < 2:
            raise ValueError(f"an interval needs 2 or more seeds, got {len(sample)}")
        if not np.isfinite(sample).all():
            raise ValueError(f"values must be finite, got {sample[~np.isfinite(sample)][0]}; is an evaluation missing?")
    if paired and len({len(sample) for sample in samples}) > 1:
        raise ValueError(f"pairs need the same seeds, got samples of {[len(sample) for sample in samples]}")

    if min(map(len, samples)) < LEAST_SEEDS:
        return point(float(statistic(*samples)))

    def of_rows(*rows: Array, axis: int) -> Array:
        return statistic(*(sample[row] for sample, row in zip(samples, rows, strict=True)))

    rows = [np.arange(len(sample)) for sample in samples]
    found = stats.bootstrap(
        rows,
        of_rows,
        n_resamples=RESAMPLES,
        vectorized=True,
        paired=paired,
        confidence_level=level,
        method="percentile",
        rng=rng,
    )
    return Interval(float(statistic(*samples)), *map(float, found.confidence_interval))


def iqm_interval(*strata: Array, rng: np.random.Generator, level: float = LEVEL) -> Interval:
    """Interquartile mean of all values together; seeds are drawn within each stratum ``(n_seeds,)``.

    Raises:
        ValueError: see ``interval``.
    """
    return interval(lambda *drawn: interquartile_mean(np.concatenate(drawn, axis=-1)), *strata, rng=rng, level=level)


def point(value: float) -> Interval:
    """A statistic of too few seeds for an interval."""
    return Interval(value, np.nan, np.nan)


def over_seeds(values: Array) -> Interval | None:
    """Interquartile mean of ``(n_seeds,)``; its interval with ``LEAST_SEEDS`` or more; None if a value is missing."""
    if not len(values) or not np.isfinite(values).all():
        return None
    return point(float(values[0])) if len(values) == 1 else iqm_interval(values, rng=rng())


def improvement(ours: Array, theirs: Array) -> Array:
    """P(X < Y): how often ours ``(..., n)`` have a smaller error than theirs ``(..., m)``; a tie counts half.

    The Mann-Whitney statistic over n m; Agarwal et al. (2021) call it the probability of improvement.
    """
    x, y = np.asarray(ours)[..., :, None], np.asarray(theirs)[..., None, :]
    shares: Array = np.mean((x < y) + 0.5 * (x == y), axis=(-2, -1))
    return shares


def improvement_interval(ours: Array, theirs: Array, *, level: float = LEVEL) -> Interval:
    """``improvement`` of ``(n,)`` over ``(m,)``, with a score interval, which few seeds keep wide.

    Wilson's interval for this statistic: all probabilities that are not rejected by what was seen (Newcombe 2006,
    Statistics in Medicine 25:559, method 5). A bootstrap would give [1, 1] whenever all of ours are below all of
    theirs, even with two seeds; this gives [.80, 1] with ten and [.90, 1] with twenty. Of normal errors it holds the
    truth in 95 to 98 % of cases, with 5, 10 or 20 seeds. With fewer than ``LEAST_SEEDS`` on a side there is only a
    `point`.

    Raises:
        ValueError: fewer than 2 seeds on a side, or errors that are not finite.
    """
    for sample in (ours, theirs):
        if len(sample) < 2 or not np.isfinite(sample).all():
            raise ValueError(f"an interval needs 2 or more seeds with finite errors, got {np.asarray(sample).tolist()}")
    n, m, found = len(ours), len(theirs), float(improvement(ours, theirs))
    if min(n, m) < LEAST_SEEDS:
        return point(found)
    z = float(stats.norm.isf((1 - level) / 2))

    def excess(p: float) -> float:
        """Above 0 where p is rejected: squared distance to what was found, less z^2 times the variance under p."""
        variance = p * (1 - p) * (1 + ((n + m) / 2 - 1) * ((1 - p) / (2 - p) + p / (1 + p))) / (n * m)
        return (found - p) ** 2 - z * z * variance

    inside = float(np.clip(found, 1e-9, 1 - 1e-9))
    low = optimize.brentq(excess, 0.0, inside) if found > 0 else 0.0
    high = optimize.brentq(excess, inside, 1.0) if found < 1 else 1.0
    return Interval(found, low, high)


def holm(claims: Iterable[Key], rejects: Callable[[Key, float], bool]) -> set[Key]:
    """Which of several claims stand together: the chance that any of them is wrong is at most 5 %.

    Holm's method (1979) by intervals: all are asked at the level that Bonferroni's method gives for their number; what
    stands is set aside, and the others are asked again at the level for the number that is left.

    Args:
        claims: all of them, also those that stand no chance.
        rejects: (claim, level) -> whether an interval of this confidence decides the claim.
    """
    left = list(dict.fromkeys(claims))
    standing: set[Key] = set()
    while left:
        level = 1 - (1 - LEVEL) / len(left)
        decided = {claim for claim in left if rejects(claim, level)}
        if not decided:
            break
        standing |= decided
        left = [claim for claim in left if claim not in decided]
    return standing


def paired_differences(ours: Mapping[int, float], theirs: Mapping[int, float]) -> Array:
    """``(n_seeds,)`` ours - theirs, seed by seed: runs of one seed have the same motor noise, which cancels.

    Args:
        ours, theirs: seed -> error (m).

    Raises:
        ValueError: they are not of the same seeds.
    """
    if ours.keys() != theirs.keys():
        alone = sorted(ours.keys() ^ theirs.keys())
        raise ValueError(f"pairs need the same seeds on both sides, but only one side has {alone}")
    return np.array([ours[seed] - theirs[seed] for seed in sorted(ours)])


def common_differences(ours: Mapping[int, float], theirs: Mapping[int, float]) -> Array:
    """The same, of the seeds that both have."""
    both = ours.keys() & theirs.keys()
    return paired_differences({seed: ours[seed] for seed in both}, {seed: theirs[seed] for seed in both})


def movements_to_reach(movements: Array, errors: Array, level: Array | float) -> Array:
    """After how many movements the error first falls to a level; straight lines between evaluations.

    Args:
        movements: ``(n,)``, increasing, 2 or more.
        errors: ``(..., n)`` m.
        level: ``(...)`` m.

    Returns:
        ``(...)``, the first evaluation at the earliest, inf if the level is never reached.

    Raises:
        ValueError: ``movements`` do not increase, or values do not match them or are not finite.
    """
    movements, errors = _checked_curves(movements, errors)
    level = np.asarray(level, dtype=np.float64)[..., None]
    reached = errors <= level
    after = np.clip(reached.argmax(axis=-1, keepdims=True), 1, None)
    high, low = (np.take_along_axis(errors, after - step, axis=-1) for step in (1, 0))
    fall = np.where(high > low, high - low, 1.0)
    share = np.clip((high - level) / fall, 0, 1)  # 0 where the first evaluation is low enough already
    found = movements[after - 1] + share * (movements[after] - movements[after - 1])
    return np.where(reached.any(axis=-1), found[..., 0], np.inf)


def _checked_curves(movements: Array, errors: Array) -> tuple[Array, Array]:
    movements, errors = np.asarray(movements, dtype=np.float64), np.asarray(errors, dtype=np.float64)
    if movements.ndim != 1 or len(movements) < 2 or not (np.diff(movements) > 0).all():
        raise ValueError(f"a curve needs 2 or more increasing numbers of movements, got {movements.tolist()}")
    if errors.shape[-1:] != movements.shape:
        raise ValueError(f"errors must have shape (..., {len(movements)}), got {errors.shape}")
    if not np.isfinite(errors).all():
        raise ValueError("errors of a curve must be finite; is an evaluation missing?")
    return movements, errors
