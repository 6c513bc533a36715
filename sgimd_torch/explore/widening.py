"""Global exploration around the middle of Pi; its width grows while outcomes are predicted well.

Our addition. Rolf, Steil & Gienger (2010) begin goal babbling at one posture and widen from there, so that all
movements belong to one family. The best width depends on the robot. With the fishing rod (25 dimensions of Pi), the
outcome of a uniform movement tells nothing about other movements; with an arm of three joints it tells much.
    explore = Widening(problem); theta = explore(context)
All parts of a learner share one `Width`; the search `Vary` uses it for variations of remembered movements.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.spaces import Array

_FIRST, _NARROWEST, _WIDEST = 0.1, 0.03, 0.3  # standard deviations, relative to the sides of Pi
_FACTOR: Final = 1.15  # factor by which the width changes after each prediction
_WELL: Final = 0.1  # largest squared error of a good prediction, relative to the variance of the outcomes
_LOOKED_AT: Final = 1000  # largest number of exemplars from which the variance of the outcomes is computed


class Width:
    """Width ``sd`` of exploration: standard deviation of movements, relative to the sides of Pi."""

    def __init__(self) -> None:
        self.sd = _FIRST

    def update(self, well: bool) -> None:
        """Increase the width after a good prediction, and reduce it after a bad one."""
        self.sd = float(np.clip(self.sd * (_FACTOR if well else 1 / _FACTOR), _NARROWEST, _WIDEST))


class Widening(Explore):
    """Gaussian movements around the middle of Pi, wider while outcomes are predicted well.

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
        variance = memory.outcomes[:: 1 + len(memory) // _LOOKED_AT].var(axis=0).sum()
        for theta, outcome in expected:
            for row in new.start + np.flatnonzero(self.problem.policies.same(memory.thetas[new.start :], theta)):
                self.width.update(bool(((memory.outcomes[row] - outcome) ** 2).sum() <= _WELL * variance))
