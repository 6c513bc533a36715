"""Drawings of a movement: the result of the optional method ``trace(context, theta, rng)`` of an environment.

Sketch(outcome, 0.05, [arm, puck])
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, read_only


@dataclass(frozen=True, eq=False)
class Sketch:
    """Drawings of a movement, for films.

    Args:
        outcome: ``(outcome_dim,)``, equal to the outcome of ``execute`` with an equal random stream. Its first two
            dimensions are x and y in the drawing; if it has one dimension, y is 0.
        step: time between two drawings (s).
        chains: arrays ``(n_steps, n_points, 2)``, one for each chain of the robot and for each object: points that the
            film joins by lines, or a single point, which it draws as a ball. The film also shows the path of each
            chain's last point.

    Raises:
        ValueError: an array has another shape or is not finite, or the step is not above 0.
    """

    outcome: Array
    step: float
    chains: Sequence[Array]

    def __post_init__(self) -> None:
        object.__setattr__(self, "outcome", _drawn("outcome", self.outcome, "(outcome_dim,)", 1))
        chains = tuple(_drawn("each chain", chain, "(n_steps, n_points, 2)", 3) for chain in self.chains)
        shapes = [chain.shape for chain in chains]
        if len({shape[0] for shape in shapes}) != 1 or any(shape[2] != 2 for shape in shapes):
            raise ValueError(
                f"chains of a Sketch must be one array (n_steps, n_points, 2) or more, got shapes {shapes}"
            )
        object.__setattr__(self, "chains", chains)
        if not 0 < self.step < np.inf:
            raise ValueError(f"step of a Sketch must be above 0 s, got {self.step}")

    @property
    def landed(self) -> float:
        """Duration (s) of the movement."""
        return self.step * (len(self.chains[0]) - 1)


def _drawn(name: str, given: ArrayLike, wanted: str, axes: int) -> Array:
    value = np.asarray(given)
    if value.size == 0 or value.dtype.kind not in "iuf" or not np.isfinite(value).all() or value.ndim != axes:
        raise ValueError(f"{name} of a Sketch must be finite numbers {wanted}, got shape {value.shape}")
    return read_only(value.astype(np.float64))
