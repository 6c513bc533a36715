"""Can the forward model be believed? Whether its spread is right, and whether refining a guess helps.

Not in Nguyen & Oudeyer (2014). Use predictions that were made before the model learnt from their outcomes (prequential
analysis: Dawid, J. R. Stat. Soc. A 147, 1984); on exemplars that it was trained on, any model looks good.
    spread = np.hypot(prediction.epistemic, prediction.aleatoric); coverage(outcomes, prediction.mean, spread, 0.8)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

from sgimd_torch.spaces import Array

TRUSTED_UP_TO: Final = 0.25  # relative error (`ForwardModel.relative_error`); with a larger one a model is not asked
_NOT_REFINING: Final = ("imitate", "global")  # movements with a goal that do not start from an estimate for it


def coverage(observed: Array, mean: Array, spread: Array, level: float) -> float:
    """Which share of the outcomes fell inside the regions that should contain the share ``level``.

    The regions are ellipsoids along the axes, of a Gaussian with independent dimensions. With less than the level the
    model is overconfident, with more it is too cautious.

    Args:
        observed, mean: ``(n, outcome_dim)``, n >= 1.
        spread: ``(n, outcome_dim)``, standard deviations > 0: the root of epistemic plus aleatoric ones, squared.
        level: between 0 and 1.
    """
    squared = (((observed - mean) / spread) ** 2).sum(axis=1)
    return float((squared <= 2 * gammaincinv(observed.shape[1] / 2, level)).mean())  # a quantile of chi-square


def improved(goals: Array, outcomes: Array, origins: NDArray[np.str_]) -> float:
    """Share of the goals for which a later movement came nearer than the first; NaN without a goal of two movements.

    A goal is pursued as long as consecutive movements have it. Imitation does not count, nor do the random movements of
    the global regime, compared with which any guess would look good. By noise alone the best of several is nearer than
    the first, so a useless search does not get 0.

    Args:
        goals, outcomes: ``(n, outcome_dim)``, in order of movements; a goal is NaN where there was none.
        origins: ``(n,)`` what proposed each, ``Move.origin``.
    """
    rows = np.flatnonzero(np.isfinite(goals).all(axis=1) & ~np.isin(origins, _NOT_REFINING))
    if not len(rows):
        return float("nan")
    distances = np.linalg.norm(outcomes[rows] - goals[rows], axis=1)
    pursuit = np.cumsum(np.any(goals[1:] != goals[:-1], axis=1))  # also NaN != NaN
    begins = np.flatnonzero(np.diff(np.append(0, pursuit)[rows], prepend=-1))
    refined = np.diff(begins, append=len(rows)) > 1
    nearer = np.minimum.reduceat(distances, begins) < distances[begins]
    return float(nearer[refined].mean()) if refined.any() else float("nan")
