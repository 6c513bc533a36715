"""Global exploration of all of Pi, uniformly, as in the paper.

explore = Anywhere(problem); theta = explore(context)
"""

from __future__ import annotations

from sgimd_torch.parts import Explore
from sgimd_torch.spaces import Array


class Anywhere(Explore):
    """Uniform movements, anywhere in Pi."""

    draws_from = "regime"

    def __call__(self, context: Array) -> Array:
        """A movement ``(theta_dim,)``, uniform in Pi."""
        return self.problem.policies.sample(self.rng)
