"""Calibration of the forward model: a check of its predicted spread.

Not in Nguyen & Oudeyer (2014). Use predictions that were made before the model learnt from their outcomes (prequential
analysis: Dawid, J. R. Stat. Soc. A 147, 1984); on its training exemplars any model looks good.
    spread = np.hypot(prediction.epistemic, prediction.aleatoric); coverage(outcomes, prediction.mean, spread, 0.8)
"""

from __future__ import annotations

from scipy.special import gammaincinv

from sgimd_torch.spaces import Array


def coverage(observed: Array, mean: Array, spread: Array, level: float) -> float:
    """Share of the outcomes inside the regions that are expected to contain the share ``level``.

    The regions are ellipsoids along the axes, of a Gaussian with independent dimensions. A share below the level means
    that the model is overconfident, a share above the level that the model is too cautious.

    Args:
        observed: ``(n, outcome_dim)`` outcomes, n >= 1.
        mean: ``(n, outcome_dim)`` predicted outcomes.
        spread: ``(n, outcome_dim)`` standard deviations > 0, epistemic and aleatoric together.
        level: share between 0 and 1.
    """
    squared = (((observed - mean) / spread) ** 2).sum(axis=1)
    return float((squared <= 2 * gammaincinv(observed.shape[1] / 2, level)).mean())  # a quantile of chi-square
