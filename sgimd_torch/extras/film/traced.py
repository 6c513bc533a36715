"""Movements that can be filmed: the trajectory of a movement as drawings, and a check of what a user's robot draws.

Sketch(outcome, 0.05, [arm, puck])        # result of a method trace(context, theta, rng) of an environment
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, read_only

if TYPE_CHECKING:
    from sgimd_torch.environments.rod_physics import RodTrace


@dataclass(frozen=True, eq=False)
class Sketch:
    """Drawings of a movement for `sgimd film`.

    An environment may have a method ``trace(context, theta, rng)`` that returns a Sketch.

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


def traced(environment: Any, context: Array, theta: Array, rng: np.random.Generator) -> RodTrace | Sketch:
    """Call the optional method ``trace`` of an environment, and check the result.

    Raises:
        ValueError: ``trace`` fails, or its result cannot be drawn.
    """
    name, dim = type(environment).__name__, environment.outcomes.dim
    try:
        movement: Any = environment.trace(context, theta, rng)
    except (Exception, SystemExit) as error:  # code of the user may raise anything
        raise ValueError(f"trace() of {name} failed: {type(error).__name__}: {error}") from error
    if hasattr(movement, "states"):  # the RodTrace of the fishing rod, or a Filmed
        return movement
    if not isinstance(movement, Sketch) or len(movement.outcome) != dim:
        what = f"one of {len(movement.outcome)}" if isinstance(movement, Sketch) else type(movement).__name__
        wanted = f"a Sketch with an outcome of {dim} dimension{'s' * (dim != 1)}"
        raise ValueError(f"trace() of {name} must give {wanted}, got {what}")
    return movement
