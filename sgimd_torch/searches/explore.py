"""Global exploration: movements that do not depend on the goal (section 4.4.1).

`Anywhere` is the paper's: uniform in Pi. The other two are our additions. All parts of a learner share one `Width`,
which the search `Vary` uses for variations of remembered movements.
    explore = Returning(problem); theta = explore(context)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.spaces import Array, check_count

# Of `Widening`:
_FIRST_WIDTH: Final = 0.1  # standard deviation of the first movements, relative to the sides of Pi
_NARROWEST: Final = 0.03  # least standard deviation
_WIDEST: Final = 0.3  # greatest standard deviation
_FACTOR: Final = 1.15  # factor by which the width changes after each prediction
_WELL: Final = 0.1  # largest squared error of a good prediction, relative to the variance of the outcomes
_SAMPLED: Final = 1000  # largest number of exemplars from which the variance of the outcomes is computed
# Of `Returning`:
_ENOUGH: Final = 16  # least number of exemplars with an effect from which an inverse model can learn
_SHARE: Final = 0.1  # probability of a global movement once there are enough; more make the inverse model less accurate
_ANYWHERE: Final = 0.5  # share of the global movements that are uniform in Pi, to find other effects
_SIMILAR: Final = 10  # number of movements with an effect, in the most similar contexts, of which one is varied


class Anywhere(Explore):
    """Uniform movements, anywhere in Pi."""

    draws_from = "regime"

    def __call__(self, context: Array) -> Array:
        """A movement ``(theta_dim,)``, uniform in Pi."""
        return self.problem.policies.sample(self.rng)


class Width:
    """Width ``sd`` of exploration: standard deviation of movements, relative to the sides of Pi."""

    def __init__(self) -> None:
        self.sd = _FIRST_WIDTH

    def update(self, well: bool) -> None:
        """Increase the width after a good prediction, and reduce it after a bad one."""
        self.sd = float(np.clip(self.sd * (_FACTOR if well else 1 / _FACTOR), _NARROWEST, _WIDEST))


class Widening(Explore):
    """Gaussian movements around the middle of Pi, wider while outcomes are predicted well.

    Rolf, Steil & Gienger (2010) begin goal babbling at one posture and widen from there, so that movements stay
    similar. The best width depends on the robot. With the fishing rod (25 dimensions of Pi), the outcome of a uniform
    movement tells nothing about other movements; with an arm of three joints it tells much.

    Args:
        problem: problem to learn. If its inverse model predicts nothing, the width is constant.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.width = problem.shared(Width, Width)
        self._expected: list[tuple[Array, Array]] = []  # global movements without a known outcome, and predictions
        self._compared = 0  # number of exemplars that `_compare` has seen
        inverse = type(problem.inverse)
        if inverse.predict is Inverse.predict:
            problem.remarks.append(f"exploration does not widen: {inverse.__name__} predicts nothing")

    def __call__(self, context: Array) -> Array:
        """The next movement ``(theta_dim,)``."""
        self._compare()
        policies = self.problem.policies
        middle = (policies.low + policies.high) / 2
        theta = policies.clip(self.rng.normal(middle, self.width.sd * policies.sides))
        expected = self.problem.inverse.predict(context, theta)
        if expected is not None:
            self._expected.append((theta, expected))
        return theta

    def _compare(self) -> None:
        """Update the width by the outcomes of global movements that are known since the last call."""
        memory, expected = self.problem.memory, self._expected
        new, self._compared = range(self._compared, len(memory)), len(memory)
        if not new or not expected:
            return
        self._expected = []
        variance = memory.outcomes[:: 1 + len(memory) // _SAMPLED].var(axis=0).sum()
        for theta, outcome in expected:
            for row in new.start + np.flatnonzero(self.problem.policies.same(memory.thetas[new.start :], theta)):
                self.width.update(bool(((memory.outcomes[row] - outcome) ** 2).sum() <= _WELL * variance))


class Returning(Explore):
    """First uniform movements, then Gaussian ones; if effects are rare, variations of movements that had an effect.

    Forestier et al. (2022) reach goals for an object by variations of movements that moved the object. Go-Explore
    (Ecoffet et al. 2021) returns to a state before it explores. Variations become wider after a variation with an
    effect, else narrower, as by the success rule of evolution strategies (Rechenberg 1973).

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
        self._seen = 0  # number of exemplars at the last call
        inverse = type(problem.inverse)
        if inverse.effects is Inverse.effects:
            problem.remarks.append(f"exploration does not look for effects: {inverse.__name__} does not report them")

    @property
    def share(self) -> float | None:
        """Probability of a global movement: 1 for the ``first`` movements, and until 16 movements had an effect, then
        .1; None if all movements have an effect."""
        if len(self.problem.memory) < self.first:
            return 1.0
        effective = self.problem.inverse.effects()
        return None if effective is None else _SHARE if len(effective) >= _ENOUGH else 1.0

    def __call__(self, context: Array) -> Array:
        """The next movement ``(theta_dim,)``."""
        effective, policies = self.problem.inverse.effects(), self.problem.policies
        if len(self.problem.memory) < self.first:
            return policies.sample(self.rng)
        if effective is None:
            return self._widening(context)
        if len(self.problem.memory) > self._seen:  # several robots may move at once
            for theta in self._varied:
                self.width.update(bool(policies.same(effective.thetas, theta).any()))
            self._varied, self._seen = [], len(self.problem.memory)
        if not len(effective) or self.rng.random() < _ANYWHERE:
            return policies.sample(self.rng)
        order = np.linalg.norm(effective.contexts - context, axis=1).argsort(kind="stable")
        theta = effective.thetas[self.rng.choice(order[:_SIMILAR] if effective.context_dim else order)]
        varied = policies.clip(self.rng.normal(theta, self.width.sd * policies.sides))
        self._varied.append(varied)
        return varied
