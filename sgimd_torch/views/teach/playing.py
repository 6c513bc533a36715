"""Movements that are played: those of the learner as a pale outline, trials, and a recording on the led arm.

outline = Outline(model, chain); lines, end = outline.at(recorded, seconds)
playing = Playing(recorded, speed=4.0); playing.seconds(now), playing.over(now)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import mujoco
import numpy as np

from sgimd_torch.environments.protocol import Recorded, Sketch
from sgimd_torch.spaces import Array

STILL: Final = 0.4  # s, how long the end of a movement is shown


@dataclass(frozen=True, eq=False)
class Playing:
    """A movement that is being played since ``begun`` (s, of ``time.monotonic``), ``speed`` times as fast as it is."""

    recorded: Recorded
    begun: float
    speed: float = 1.0

    def seconds(self, now: float) -> float:
        """s of the movement that are over."""
        return min((now - self.begun) * self.speed, self.recorded.landed)

    def over(self, now: float) -> bool:
        """Whether it has ended, and was shown for a moment."""
        return (now - self.begun - STILL / self.speed) * self.speed >= self.recorded.landed


class Outline:
    """A movement at a moment, as lines.

    Args:
        model: of the robot.
        chain: ``(n, 2)``, bodies of the model that a line joins.
    """

    def __init__(self, model: Any, chain: np.ndarray) -> None:
        self._model, self._data, self._chain = model, mujoco.MjData(model), chain

    def at(self, recorded: Recorded, seconds: float) -> tuple[Array, Array]:
        """``(n, 2, 3)`` m, the robot at ``seconds`` of a movement, and ``(3,)`` m, where what counts is then."""
        if isinstance(recorded, Sketch):
            row = min(round(seconds / recorded.step), len(recorded.chains) - 1)
            points = np.zeros((len(recorded.chains[row]), 3))
            points[:, :2] = recorded.chains[row]
            points[:, 2] = 0.02
            return np.stack([points[:-1], points[1:]], axis=1), points[-1]
        found: Any = recorded
        row = min(int(seconds / found.step), len(found.states) - 1)
        mujoco.mj_setState(self._model, self._data, found.states[row], mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_kinematics(self._model, self._data)
        return np.asarray(self._data.xpos[self._chain]), found.float_at(seconds)
