"""Global exploration if most movements have no effect: find movements with an effect, and vary them.

Our addition. Forestier et al. (2022) reach goals for an object by variations of movements that moved the object.
Go-Explore (Ecoffet et al. 2021) returns to a state before it explores. Variations become wider after a variation with
an effect, else narrower, as by the success rule of evolution strategies (Rechenberg 1973).
    explore = Returning(problem); theta = explore(context)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.explore.widening import Widening, Width
from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.spaces import Array, check_count

_ENOUGH: Final = 16  # least number of exemplars with an effect from which an inverse model can learn
_SHARE: Final = 0.1  # probability of a global movement once there are enough; more make the inverse model less accurate
_ANYWHERE: Final = 0.5  # share of the global movements that are uniform in Pi, to find other effects
_NEAREST: Final = 10  # number of movements with an effect, in the most similar contexts, of which one is varied


class Returning(Explore):
    """First uniform movements, then Gaussian ones; if effects are rare, variations of movements that had an effect.

    After the first movements, while every movement has an effect, exploration is that of `Widening`. Otherwise
    movements are uniform in Pi until one has an effect; then half of them are variations of a movement that had an
    effect in a similar context.

    Args:
        problem: problem to learn. If its inverse model reports no ``effects``, exploration is always that of
            `Widening`.
        first: number of movements at the start that are uniform in Pi. With 0 exploration is around the middle of Pi
            from the start, which suits the rod.

    Raises:
        ValueError: ``first`` is no count.
    """

    def __init__(self, problem: Problem, *, first: int = 30) -> None:
        super().__init__(problem)
        self.first = check_count("first", first, 0)
        self.width, self._widening = problem.shared(Width, Width), Widening(problem)
        self._varied: list[Array] = []  # variations whose effect is not known yet
        self._seen = 0  # number of exemplars at the last look
        inverse = type(problem.inverse)
        if inverse.effects is Inverse.effects:
            problem.remarks.append(f"exploration does not look for effects: {inverse.__name__} does not report them")

    @property
    def share(self) -> float | None:
        """Probability of a global movement: 1 for the ``first`` movements, and until 16 movements had an effect, then
        .1; None if all movements have an effect."""
        if len(self.problem.memory) < self.first:
            return 1.0
        acted = self.problem.inverse.effects()
        return None if acted is None else _SHARE if len(acted) >= _ENOUGH else 1.0

    def __call__(self, context: Array) -> Array:
        """The next movement ``(theta_dim,)``."""
        acted, policies = self.problem.inverse.effects(), self.problem.policies
        if len(self.problem.memory) < self.first:
            return policies.sample(self.rng)
        if acted is None:
            return self._widening(context)
        if len(self.problem.memory) > self._seen:  # several robots may move at once
            for theta in self._varied:
                self.width.update(bool(policies.same(acted.thetas, theta).any()))
            self._varied, self._seen = [], len(self.problem.memory)
        if not len(acted) or self.rng.random() < _ANYWHERE:
            return policies.sample(self.rng)
        alike = np.linalg.norm(acted.contexts - context, axis=1).argsort(kind="stable")
        theta = acted.thetas[self.rng.choice(alike[:_NEAREST] if acted.context_dim else alike)]
        varied = policies.clip(self.rng.normal(theta, self.width.sd * policies.sides))
        self._varied.append(varied)
        return varied
