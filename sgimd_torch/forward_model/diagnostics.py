"""Calibration of the forward model: do outcomes lie in its predicted regions as often as they should?

Not in Nguyen & Oudeyer (2014). Predictions must be made before the model learns from the outcomes (prequential
analysis: Dawid, J. R. Stat. Soc. A 147, 1984), because on its training exemplars any model looks good.
    spread = np.hypot(prediction.epistemic, prediction.aleatoric); coverage(outcomes, prediction.mean, spread, 0.8)
"""

from __future__ import annotations

from scipy.special import gammaincinv

from sgimd_torch.spaces import Array


def coverage(observed: Array, mean: Array, spread: Array, level: float) -> float:
    """Share of the outcomes that lie in their predicted regions, which should contain the share ``level``.

    The regions are ellipsoids, because the predictions are Gaussians with independent dimensions. A share below
    ``level`` means that the predicted standard deviations are too small, a share above that they are too large.

    Args:
        observed: ``(n, outcome_dim)`` outcomes, n >= 1.
        mean: ``(n, outcome_dim)`` predicted outcomes.
        spread: ``(n, outcome_dim)`` standard deviations > 0, epistemic and aleatoric together.
        level: share between 0 and 1.
    """
    squared = (((observed - mean) / spread) ** 2).sum(axis=1)
    return float((squared <= 2 * gammaincinv(observed.shape[1] / 2, level)).mean())  # a quantile of chi-square
