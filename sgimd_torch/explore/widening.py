"""Global exploration around the middle of Pi, as wide as what comes of it can be predicted.

Our addition. Rolf, Steil & Gienger (2010) begin goal babbling at one posture and widen from there, so that all
movements belong to one family. How wide to look depends on the robot: a movement of the fishing rod, drawn anywhere in
25 dimensions, teaches nothing about others, one of an arm with three joints nearly everything.
    explore = Widening(problem); theta = explore(context)
All parts of a learner share one `Width`: `Practise` looks half as wide around a copied movement.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.parts import Explore, Inverse, Problem
from sgimd_torch.spaces import Array

_FIRST, _NARROWEST, _WIDEST = 0.1, 0.03, 0.3  # standard deviations, in sides of Pi
_FACTOR: Final = 1.15  # from one width to the next
_WELL: Final = 0.1  # of the outcomes' variance: a squared error of at most this is a good prediction
_LOOKED_AT: Final = 1000  # exemplars, for that variance


class Width:
    """Standard deviation of exploration, in sides of Pi: it grows while its movements are predicted well."""

    def __init__(self) -> None:
        self.sd = _FIRST

    def update(self, well: bool) -> None:
        """Widen after a good prediction, narrow after a bad one."""
        self.sd = float(np.clip(self.sd * (_FACTOR if well else 1 / _FACTOR), _NARROWEST, _WIDEST))


class Widening(Explore):
    """Gaussian movements around the middle of Pi, wider while outcomes are predicted well.

    Args:
        problem: memory and inverse model are read. Where the inverse model predicts nothing, the width stays.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.width = problem.shared(Width, Width)
        self._expected: tuple[int, Array] | None = None  # of the last movement: its row in memory, its outcome
        inverse = type(problem.inverse)
        if inverse.predict is Inverse.predict:
            problem.remarks.append(f"exploration does not widen: {inverse.__name__} predicts nothing")

    def __call__(self, context: Array) -> Array:
        """``(theta_dim,)`` the next movement."""
        self._compare()
        policies = self.problem.policies
        middle = (policies.low + policies.high) / 2
        theta = policies.clip(self.rng.normal(middle, self.width.sd * policies.sides))
        expected = self.problem.inverse.predict(context, theta)
        self._expected = None if expected is None else (len(self.problem.memory), expected)
        return theta

    def _compare(self) -> None:
        """Was the last movement predicted well?"""
        outcomes = self.problem.memory.outcomes
        if self._expected is None or self._expected[0] >= len(outcomes):
            return
        row, expected = self._expected
        variance = outcomes[:: 1 + len(outcomes) // _LOOKED_AT].var(axis=0).sum()
        self.width.update(bool(((outcomes[row] - expected) ** 2).sum() <= _WELL * variance))
