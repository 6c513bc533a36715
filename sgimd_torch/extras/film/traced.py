"""Movements that can be filmed: a check of what a user's robot draws."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.spaces import Array

if TYPE_CHECKING:
    from sgimd_torch.environments.rod_physics import RodTrace


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
