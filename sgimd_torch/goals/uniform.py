"""Goals that are uniform in T and do not depend on what was learnt; a baseline for the interest map.

goals = UniformGoals(problem)
"""

from __future__ import annotations

from numpy.typing import ArrayLike

from sgimd_torch.goals.checks import check_attempt, check_in
from sgimd_torch.parts import Goals
from sgimd_torch.spaces import Array


class UniformGoals(Goals):
    """Uniform goals, anywhere in T."""

    def sample(self, context: ArrayLike) -> Array:
        """A goal ``(outcome_dim,)``, uniform in T."""
        check_in(self.problem.contexts, "context", context)
        return self.problem.outcomes.sample(self.rng)

    def add(
        self, context: ArrayLike, goal: ArrayLike, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Check the arguments, and remember nothing."""
        check_attempt(self.problem, context, goal, competence, gain)
