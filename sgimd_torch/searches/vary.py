"""The simplest search: theta_g plus noise.

search = Vary(problem)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Final

from sgimd_torch.parts import Problem, Search
from sgimd_torch.spaces import Array, Estimate

TRIES: Final = 16  # largest number of variations that are tried for one that Pi allows
WIDER: Final = 1.4  # factor of the noise after each; the last ones lie anywhere in Pi


class Vary(Search):
    """Answer of the inverse model plus a little Gaussian noise.

    All movements vary theta_g; their outcomes do not change the search. Movements are clipped to Pi; the search never
    ends. Where Pi does not allow a movement, the noise grows until it allows one.

    The search is meant for an accurate inverse model and for one or two movements at each goal. The outcomes correct
    the inverse model, and show how the outcome changes with theta.

    Args:
        problem: problem to learn.
        sd: standard deviation of the noise, as a fraction of each parameter's range in Pi.

    Raises:
        ValueError: ``sd`` is not positive.
    """

    def __init__(self, problem: Problem, *, sd: float = 0.03) -> None:
        super().__init__(problem)
        if not sd > 0:
            raise ValueError(f"sd must be positive, got {sd}; without noise nothing new is tried")
        self.sd = sd

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around theta_g of ``start``."""
        theta = self.problem.policies.check("theta of the estimate", start.theta)
        while True:
            yield self.varied(theta)

    def varied(self, theta: Array) -> Array:
        """``theta`` plus noise, clipped to Pi."""
        policies = self.problem.policies
        for k in range(TRIES):
            sides = self.sd * WIDER**k * policies.sides
            varied = policies.clip(theta + sides * self.rng.standard_normal(policies.dim))  # faster than rng.normal
            if policies.allows(varied):
                break
        return varied
