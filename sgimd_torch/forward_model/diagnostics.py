"""Can the forward model be believed? Where its errors are, whether its spread is right, whether refining a guess helps.

Not in Nguyen & Oudeyer (2014). Use predictions that were made before the model learnt from their outcomes (prequential
analysis: Dawid, J. R. Stat. Soc. A 147, 1984); on exemplars that it was trained on, any model looks good.
    spread = np.hypot(prediction.epistemic, prediction.aleatoric); coverage(outcomes, prediction.mean, spread)
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaincinv

from sgimd_torch.spaces import Array, Box, check_count, check_vector, first_entry

LEVELS: Final = (0.5, 0.8, 0.95)
TRUSTED_UP_TO: Final = 0.25  # relative error (`ForwardModel.relative_error`); with a larger one a model is not asked
_NOT_REFINING: Final = ("imitate", "global")  # movements with a goal that do not start from an estimate for it


class CellErrors(NamedTuple):
    """Mean ``errors`` (m), NaN in empty cells, and ``counts`` on a grid with an axis for each outcome dimension."""

    errors: Array
    counts: NDArray[np.int64]


class Windows(NamedTuple):
    """For each window: the row of its ``last`` prediction ``(n_windows,)``, mean ``errors`` ``(n_windows,)`` m, and
    ``coverages`` ``(n_windows, n_levels)``."""

    last: NDArray[np.int64]
    errors: Array
    coverages: Array


class Improvements(NamedTuple):
    """For each goal, ``(n,)``: distance (m) of the ``first`` movement from it, that of the ``nearest`` movement, the
    first one included, and the number of ``movements``."""

    first: Array
    nearest: Array
    movements: NDArray[np.int64]

    @property
    def share(self) -> float:
        """Share of the goals with two movements or more where a later one came nearer; NaN without such goals.

        By noise alone the best of several is nearer than the first, so a useless search does not get 0.
        """
        refined = self.movements > 1
        return float((self.nearest < self.first)[refined].mean()) if refined.any() else float("nan")


def coverage(observed: ArrayLike, mean: ArrayLike, spread: ArrayLike, levels: ArrayLike = LEVELS) -> Array:
    """Which share of the outcomes fell inside the regions that should contain the shares ``levels``.

    The regions are ellipsoids along the axes, of a Gaussian with independent dimensions. With less than the level the
    model is overconfident, with more it is too cautious.

    Args:
        observed, mean: ``(n, outcome_dim)`` m, n >= 1.
        spread: ``(n, outcome_dim)`` m, standard deviations > 0: the root of epistemic plus aleatoric ones, squared.
        levels: ``(n_levels,)`` between 0 and 1.

    Returns:
        ``(n_levels,)`` in [0, 1].

    Raises:
        ValueError: shapes that differ, nothing predicted, a spread or a level out of range.
    """
    observed, mean, spread = _checked(observed, mean, spread)
    return _inside(observed, mean, spread, levels).mean(axis=0)


def error_by_cell(observed: ArrayLike, mean: ArrayLike, box: Box, cells: int = 10) -> CellErrors:
    """Distance between prediction and outcome, by the place of the outcome; those outside ``box`` do not count.

    Args:
        observed, mean: ``(n, outcome_dim)`` m.
        box: T, or a part of it.
        cells: along each side of ``box``, of equal size.

    Raises:
        ValueError: shapes that differ or do not fit ``box``, or no cell.
    """
    check_count("cells", cells, 1)
    observed, mean = _checked(observed, mean)
    if observed.shape[1] != box.dim:
        raise ValueError(f"observed has {observed.shape[1]} dimensions, the box {box.dim}; is it the task space?")
    sides = list(zip(box.low, box.high, strict=True))
    counts, _ = np.histogramdd(observed, cells, sides)
    sums, _ = np.histogramdd(observed, cells, sides, weights=np.linalg.norm(observed - mean, axis=1))
    errors = np.divide(sums, counts, out=np.full(counts.shape, np.nan), where=counts > 0)
    return CellErrors(errors, counts.astype(np.int64))


def running(
    observed: ArrayLike, mean: ArrayLike, spread: ArrayLike, window: int = 250, levels: ArrayLike = LEVELS
) -> Windows:
    """How error and coverage change from one window of predictions to the next.

    Args:
        observed, mean, spread, levels: as in ``coverage``, in the order of movements.
        window: predictions in each window, at least: the rest is spread over all windows. Fewer give one window.

    Raises:
        ValueError: as in ``coverage``, or ``window`` is less than 1.
    """
    check_count("window", window, 1)
    observed, mean, spread = _checked(observed, mean, spread)
    rows = np.array_split(np.arange(len(observed)), max(1, len(observed) // window))
    inside, errors = _inside(observed, mean, spread, levels), np.linalg.norm(observed - mean, axis=1)
    return Windows(
        np.array([each[-1] for each in rows]),
        np.array([errors[each].mean() for each in rows]),
        np.array([inside[each].mean(axis=0) for each in rows]),
    )


def improvements(goals: ArrayLike, outcomes: ArrayLike, origins: ArrayLike) -> Improvements:
    """How much nearer to its goal the learner comes by refining its first guess; one entry for each goal pursued.

    A goal is pursued as long as consecutive movements have it. Imitation does not count, nor do the random movements of
    the global regime, compared with which any guess would look good.

    Args:
        goals, outcomes: ``(n, outcome_dim)`` m, in order of movements; NaN where there was none.
        origins: ``(n,)`` what proposed each, ``Move.origin``; "" at rest.

    Raises:
        ValueError: shapes that do not match, or a movement towards a goal that has no finite outcome.
    """
    goals, outcomes = (np.asarray(values, dtype=np.float64) for values in (goals, outcomes))
    origins = np.asarray(origins)
    if goals.ndim != 2 or goals.shape != outcomes.shape or origins.shape != goals.shape[:1]:
        shapes = f"{goals.shape}, {outcomes.shape} and {origins.shape}"
        raise ValueError(f"goals, outcomes and origins must be (n, outcome_dim) twice and (n,), got {shapes}")
    rows = np.flatnonzero(np.isfinite(goals).all(axis=1) & ~np.isin(origins, _NOT_REFINING))
    reached = check_vector("outcomes", outcomes[rows], goals.shape[1], "every movement towards a goal has one")
    distances = np.linalg.norm(reached - goals[rows], axis=1)
    pursuit = np.cumsum(np.any(goals[1:] != goals[:-1], axis=1))  # also NaN != NaN
    begins = np.flatnonzero(np.diff(np.append(0, pursuit)[rows], prepend=-1))
    nearest = np.minimum.reduceat(distances, begins) if len(begins) else np.empty(0)
    return Improvements(distances[begins], nearest, np.diff(begins, append=len(rows)))


def _checked(observed: ArrayLike, *others: ArrayLike) -> tuple[Array, ...]:
    """``(n, outcome_dim)`` each, n >= 1: observed, mean, and a spread above 0 if it is given."""
    observed = np.asarray(observed)
    if observed.ndim != 2 or 0 in observed.shape:
        raise ValueError(f"observed must be (n, outcome_dim) with at least one outcome, got {observed.shape}")
    arrays = [check_vector("observed", observed, observed.shape[1])]
    for name, values in zip(("mean", "spread"), others, strict=False):
        array = check_vector(name, values, observed.shape[1])
        if array.shape != observed.shape:
            raise ValueError(f"{name} must have the shape of observed, {observed.shape}, got {array.shape}")
        arrays.append(array)
    if len(arrays) > 2 and not (arrays[2] > 0).all():
        raise ValueError(f"spread must be above 0, but {first_entry(arrays[2], arrays[2] <= 0)}")
    return tuple(arrays)


def _inside(observed: Array, mean: Array, spread: Array, levels: ArrayLike) -> NDArray[np.bool_]:
    """``(n, n_levels)`` whether the squared Mahalanobis distance is below that level's quantile of chi-square."""
    wanted = np.asarray(levels, dtype=np.float64)
    if wanted.ndim != 1 or not ((wanted > 0) & (wanted < 1)).all():
        raise ValueError(f"levels must lie between 0 and 1, got {wanted}; were they in percent?")
    squared = (((observed - mean) / spread) ** 2).sum(axis=1)
    return squared[:, None] <= 2 * gammaincinv(observed.shape[1] / 2, wanted)
