"""Global exploration around the middle of Pi, as wide as what comes of it can be predicted.

Our addition. Rolf, Steil & Gienger (2010) begin goal babbling at one posture and widen from there, so that all
movements belong to one family. How wide to look depends on the robot: a movement of the fishing rod, drawn anywhere in
25 dimensions, teaches nothing about others, one of an arm with three joints nearly everything.
    look = Widening(policies, memory, inverse, rng); theta = look(context)
A `Width` that several parts share: what is looked at around a copied movement is as wide as half of it.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box

_FIRST, _NARROWEST, _WIDEST = 0.1, 0.03, 0.3  # standard deviations, in sides of Pi
_FACTOR: Final = 1.15  # from one width to the next
_WELL: Final = 0.1  # of the outcomes' variance: a squared error of at most this is a good prediction
_LOOKED_AT: Final = 1000  # exemplars, for that variance


class Width:
    """How far to look, a standard deviation in sides of Pi: it follows how well is predicted what comes of it."""

    def __init__(self, sd: float = _FIRST) -> None:
        self.sd = sd

    def update(self, well: bool) -> None:
        """After a good prediction it is more, after a bad one less."""
        self.sd = float(np.clip(self.sd * (_FACTOR if well else 1 / _FACTOR), _NARROWEST, _WIDEST))


class Widening:
    """Gaussian noise around the middle of Pi; a good prediction of what came of it makes it wider, a bad one narrower.

    Args:
        policies: Pi; nothing outside is proposed.
        memory: of the learner, in which the outcomes of its movements are found; only read.
        inverse: predicts them before, if it has a method ``predict``, (context, theta) -> outcome or None, as
            `LocalProcess` has; otherwise the width stays what it is.
        rng: draws the noise.
        width: how far; it is changed here, and others may read it. None: one of its own.
    """

    def __init__(
        self,
        policies: Box,
        memory: Memory,
        inverse: object,
        rng: np.random.Generator,
        *,
        width: Width | None = None,
    ) -> None:
        self.policies, self.memory, self.rng = policies, memory, rng
        self.width = width if width is not None else Width()
        self._predict = getattr(inverse, "predict", lambda context, theta: None)
        self._expected: tuple[int, Array] | None = None  # of the last movement: its row in memory, its outcome

    def __call__(self, context: Array) -> Array:
        """``(theta_dim,)`` the next movement."""
        self._compare()
        middle = (self.policies.low + self.policies.high) / 2
        theta = self.policies.clip(self.rng.normal(middle, self.width.sd * self.policies.sides))
        expected = self._predict(context, theta)
        self._expected = None if expected is None else (len(self.memory), expected)
        return theta

    def _compare(self) -> None:
        """Was the last movement predicted well?"""
        if self._expected is None or self._expected[0] >= len(self.memory):
            return
        row, expected = self._expected
        variance = self.memory.outcomes[:: 1 + len(self.memory) // _LOOKED_AT].var(axis=0).sum()
        self.width.update(bool(((self.memory.outcomes[row] - expected) ** 2).sum() <= _WELL * variance))
