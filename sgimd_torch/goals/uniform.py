"""Goals drawn anywhere in T, whatever was learnt: instead of the interest map they show what interest is worth.

goals = UniformGoals(contexts, outcomes, rng)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.goals.protocol import check_attempt, check_in
from sgimd_torch.spaces import Array, Box


class UniformGoals:
    """Uniform goals, see `Goals`."""

    def __init__(self, contexts: Box, outcomes: Box, rng: np.random.Generator) -> None:
        self.contexts, self.outcomes, self._rng = contexts, outcomes, rng

    def sample(self, context: ArrayLike) -> Array:
        """``(outcome_dim,)`` uniform in T."""
        check_in(self.contexts, "context", context)
        return self.outcomes.sample(self._rng)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Checked, then forgotten."""
        check_attempt(self.contexts, self.outcomes, context, goal, competence, gain)
