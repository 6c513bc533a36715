"""The hand that leads an arm: where it wants the point that it holds to be, without its jumps.

hand = Hand(body, place, target); hand.target = elsewhere; velocity = hand.follow(point)
"""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np

from sgimd_torch.spaces import Array

STEP: Final = 0.01  # s, from one posture of the arm to the next
FOLLOW: Final = 15.0  # 1/s, how quickly a held point follows: nearly all of a jump within 5 / FOLLOW
REACH: Final = 0.4  # s: how long ago the hand may have been where the held point is now


class Hand:
    """Holds a ``place`` ``(3,)`` m on a ``body``, in its frame, and wants it at ``target`` ``(3,)`` m in the world.

    A browser tells of a hand about 20 times a second, so it jumps. What the arm is asked to follow, ``_wanted`` (m),
    goes after the target in a critically damped motion of velocity ``_pull`` (m/s).
    """

    def __init__(self, body: int, place: Array, target: Array) -> None:
        self.body, self.place, self.target = body, place, target
        self._wanted, self._pull = target, np.zeros(3)
        self._lately = deque([target], maxlen=round(REACH / STEP))  # targets

    def follow(self, point: Array) -> Array:
        """``(3,)`` m/s, the velocity that the held ``point`` should have in the next step."""
        self._pull = self._pull + STEP * FOLLOW**2 * (self.target - self._wanted - 2 / FOLLOW * self._pull)
        self._wanted = self._wanted + STEP * self._pull
        self._lately.append(self.target)
        velocity: Array = self._pull + FOLLOW * (self._wanted - point)
        return velocity

    def gap(self, point: Array) -> float:
        """m, from the held ``point`` to the nearest target of the last moments."""
        return float(np.linalg.norm(np.stack(self._lately) - point, axis=1).min())
