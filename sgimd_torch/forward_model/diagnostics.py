"""Can the forward model be believed? Whether its spread is right.

Not in Nguyen & Oudeyer (2014). Use predictions that were made before the model learnt from their outcomes (prequential
analysis: Dawid, J. R. Stat. Soc. A 147, 1984); on exemplars that it was trained on, any model looks good.
    spread = np.hypot(prediction.epistemic, prediction.aleatoric); coverage(outcomes, prediction.mean, spread, 0.8)
"""

from __future__ import annotations

from typing import Final

from scipy.special import gammaincinv

from sgimd_torch.spaces import Array

TRUSTED_UP_TO: Final = 0.25  # relative error (`ForwardModel.relative_error`); with a larger one a model is not asked


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
