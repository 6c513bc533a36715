"""Global exploration: movements that do not depend on the goal (section 4.4.1).

`Anywhere` is the paper's: uniform in Pi. `Returning` is our addition.
    explore = Returning(problem); theta = explore(context)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.searches.doubt import Doubt, Stuck
from sgimd_torch.spaces import Array, Estimate, check_count

_ENOUGH: Final = 16  # least number of exemplars with an effect from which an inverse model can learn
_LEAST_SHARE: Final = 0.05  # least probability of a movement that is uniform in Pi
_GREATEST_SHARE: Final = 0.2  # greatest probability of such a movement after the first movements
_WIDE: Final = 25  # number of parameters from which on the share of the way from the middle is uniform
_ANYWHERE: Final = 0.5  # share of the global movements that are uniform in Pi, to find other effects
_SIMILAR: Final = 10  # number of movements with an effect, in the most similar contexts, of which one is varied
_FIRST_WIDTH: Final = 0.1  # standard deviation of the first variations, relative to the sides of Pi
_NARROWEST: Final = 0.03  # least standard deviation
_WIDEST: Final = 0.3  # greatest standard deviation
_LEAVE: Final = 0.5  # probability of a global movement at a goal where the learner is stuck
_FACTOR: Final = 1.15  # factor by which the standard deviation changes after each variation


class Anywhere(Explore):
    """Uniform movements, anywhere in Pi."""

    draws_from = "regime"

    def __call__(self, context: Array) -> Array:
        """A movement ``(theta_dim,)``, uniform in Pi."""
        return self.problem.policies.sample(self.rng)


class Returning(Explore):
    """First around the middle of Pi, then anywhere; if effects are rare, variations of movements that had an effect.

    While every movement has an effect, the first movements go a uniform share of the way from the middle of Pi to a
    uniform movement, because small movements can often be predicted from few exemplars; the fewer parameters, the
    farther. Later global movements are
    uniform in Pi; their probability is ``first`` / n after n movements, within bounds.

    Otherwise movements are uniform in Pi until one has an effect; then half of them are variations of a movement that
    had an effect in a similar context. Forestier et al. (2022) reach goals for an object by variations of movements
    that moved the object. Go-Explore (Ecoffet et al. 2021) returns to a state before it explores. Variations widen
    after one with an effect, else narrow: the success rule of evolution strategies (Rechenberg 1973).

    A global movement that nothing explains is repeated, and a goal that is missed again and again gets a global one,
    see `searches.doubt`.

    Args:
        problem: problem to learn. If its inverse model reports no ``effects``, every movement counts as effective.
        first: number of movements at the start that are global.
        uniform: share of these that are uniform in Pi.

    Raises:
        ValueError: ``first`` is no count, or ``uniform`` no share.
    """

    def __init__(self, problem: Problem, *, first: int = 20, uniform: float = 0.0) -> None:
        super().__init__(problem)
        self.first, self.uniform = check_count("first", first, 0), uniform
        if not 0 <= uniform <= 1:
            raise ValueError(f"uniform must be a share of movements, from 0 to 1, got {uniform}")
        self.width = _FIRST_WIDTH
        self._varied: list[Array] = []  # variations whose effect is not known yet
        self._doubt, self._stuck = Doubt(problem), Stuck(problem)
        inverse = type(problem.inverse)
        if inverse.effects is Inverse.effects:
            problem.remarks.append(f"exploration does not look for effects: {inverse.__name__} does not report them")

    def share(self) -> float:
        """Probability of a global movement; 1, too, if effects are rare and fewer than 16 movements had one."""
        n = len(self.problem.memory)
        if n < self.first or len(self._doubt):
            return 1.0
        uniform = min(max(self.first / n, _LEAST_SHARE), _GREATEST_SHARE) if n else 1.0
        effective = self.problem.inverse.effects()
        return uniform if effective is None else uniform / _ANYWHERE if len(effective) >= _ENOUGH else 1.0

    def instead(self, estimate: Estimate, goal: Array) -> bool:
        """Half of the time, if goals near this one were answered again and again by movements known to miss them."""
        return self._stuck(estimate, goal) and bool(self.rng.random() < _LEAVE)

    def add(self, theta: Array) -> None:
        """Doubt the outcome of a movement; widen or narrow variations."""
        effective = self.problem.inverse.effects()
        if effective is None:
            self._doubt.add(theta)
        for k, varied in enumerate(self._varied):
            if np.array_equal(varied, theta):
                del self._varied[k]
                has_effect = effective is not None and bool(self.problem.policies.same(effective.thetas, theta).any())
                self.width = float(np.clip(self.width * _FACTOR ** (1 if has_effect else -1), _NARROWEST, _WIDEST))
                break

    def __call__(self, context: Array) -> Array:
        """The next movement ``(theta_dim,)``."""
        if len(self._doubt):
            return self._doubt.next()
        effective, policies = self.problem.inverse.effects(), self.problem.policies
        anywhere = policies.sample(self.rng)
        if effective is None:
            middle = (policies.low + policies.high) / 2
            is_uniform = len(self.problem.memory) >= self.first or self.rng.random() < self.uniform
            far = 1.0 if is_uniform else self.rng.random() ** min(1.0, policies.dim / _WIDE)
            return policies.clip(middle + far * (anywhere - middle))
        if not len(effective) or self.rng.random() < _ANYWHERE:
            return anywhere
        order = np.linalg.norm(effective.contexts - context, axis=1).argsort(kind="stable")
        theta = effective.thetas[self.rng.choice(order[:_SIMILAR] if effective.context_dim else order)]
        varied = policies.clip(self.rng.normal(theta, self.width * policies.sides))
        self._varied.append(varied)
        return varied
