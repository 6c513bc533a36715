"""How the joints of an arm follow their commands: a reading that cannot be, or a joint that stalls, is a failure.

watch.check(measured); watch.see(now, measured); watch.command(now, wanted, push)    # at each look at the arm
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.spaces import Array, Box

BEGUN: Final = 0.2  # s after which all joints follow their commands
HELD: Final = 0.05  # s in which a stalled joint has not moved
MOVED: Final = 0.01  # rad, least way of a joint that moves
FASTER: Final = 2.0  # times its allowed speed at which a joint may catch up with its command
LOOK: Final = 0.004  # s between two looks in first steps
FIRST: Final = 0.12  # rad, length of a first step; in it no joint may leave its commands by more than its tolerance
FOLLOWS: Final = (0.4, 1.6)  # least and largest way of a joint that follows, in ways of its command
CROSSED: Final = 0.25  # share of a step; a command and its joint cross it one delay apart


class Watch:
    """What is known of the joints of an arm, and what they read.

    Args:
        joints: names of the joints.
        ranges: ``(n_joints,)`` box of what they read (rad).
        tolerance: distance (rad) from its range at which a joint cannot be.
        stall: distance (rad) behind its command at which a joint that does not move stalls.
        speed, step: options of the arm.

    Attributes:
        delays: ``(n_joints,)`` s between a command and the motion; inf: unknown, so no joint stalls.
        errors: ``(n_joints,)`` rad, steady errors, sag included.
        last: time (s) and readings of the last look; None: none since torque is on.
    """

    def __init__(
        self, joints: Sequence[str], ranges: Box, tolerance: float, stall: float, speed: float, step: float
    ) -> None:
        self._joints, self._low, self._high, self._tolerance = joints, ranges.low, ranges.high, tolerance
        self._stall, self._speed, self._step = stall, speed, step
        self.delays, self.errors = np.full(len(joints), np.inf), np.zeros(len(joints))
        self.last: tuple[float, Array] | None = None

    def check(self, measured: Array) -> Array:
        """The readings, none of which lies outside the range of its joint."""
        beyond = np.abs(measured - measured.clip(self._low, self._high)) > self._tolerance
        self._fail(beyond, measured, lambda k: "; is its unit or its calibration another one?")
        return measured

    def begin(self, now: float, command: Array) -> None:
        """A movement begins."""
        still = np.zeros(len(command))
        self._begun, self._sent, self._seen = now, [(now, command, still)], list[tuple[float, Array]]()
        self._free_at, self._free, self._gone = still + now, still + np.inf, still.copy()

    def command(self, now: float, wanted: Array, push: Array) -> None:
        """Note a command that goes on by ``push`` (rad), were it not for the limit of its distance from the arm."""
        self._sent.append((now, wanted, self._sent[-1][2] + push))

    def see(self, now: float, measured: Array) -> None:
        """Look at the joints.

        Raises:
            SimulationError: a joint has jumped, or stalls.
        """
        if self.last is not None:
            before, readings = self.last
            most = self._step + FASTER * self._speed * (now - before)
            after = f", {now - before:.2g} s after {{:.3g}} rad: no joint moves that far in the time"
            self._fail(np.abs(measured - readings) > most, measured, lambda k: after.format(readings[k]))
        self.last = now, measured
        self._seen.append((now, measured))
        times, commands, gone = (np.array(part) for part in zip(*self._sent, strict=True))
        if np.isinf(self.delays).any():
            first = self._seen[0][1]
            way, asked = measured - first, commands - commands[0]
            astray = np.maximum(asked.min(axis=0) - way, way - asked.max(axis=0))
            steps = f" rad and a first step of {FIRST:g} rad: does it read what it is commanded in?"
            self._fail(astray > self._tolerance, measured, lambda k: f", after {first[k]:.3g}{steps}")
        heard = np.maximum(np.searchsorted(times, now - self.delays, "right") - 1, 0)  # what each joint follows now
        if heard.min() > 0:  # the rest is not needed any more
            self._sent = self._sent[heard.min() :]
        since = np.arange(len(times))[:, None] >= heard
        low, high = np.where(since, commands, np.inf).min(axis=0), np.where(since, commands, -np.inf).max(axis=0)
        behind, gone = np.maximum(low - measured, measured - high) - self.errors, gone[heard, range(len(heard))]
        free = (behind <= min(self._stall, self._step)) | (np.abs(measured - self._free) > MOVED)
        free |= now - self._begun < BEGUN + self.delays
        self._free_at[free], self._free[free], self._gone[free] = now, measured[free], gone[free]
        stalls = (gone - self._gone > self._stall) & (now - self._free_at > HELD + self.delays / 2)
        for k in np.flatnonzero(stalls).tolist():
            told = f"{self._joints[k]} stalls at {measured[k]:.3g} rad on its way to {commands[-1, k]:.3g}"
            raise SimulationError(f"{told}; torque is off")

    def learn(self, k: int) -> None:
        """Measure how late joint ``k`` has followed its first step, the movement that ends now.

        Raises:
            SimulationError: it did not go the way of its command.
        """
        looks, seen = map(np.array, zip(*self._seen, strict=True))
        times, sent, _ = map(np.array, zip(*self._sent, strict=True))
        asked, ways = sent[-1, k] - sent[0, k], seen[-1] - seen[0]
        if not FOLLOWS[0] <= ways[k] / asked <= FOLLOWS[1]:
            other = int(np.abs(ways).argmax())
            told = f": it was asked for a first step of {asked:.2g} rad and went {ways[k]:.2g}"
            told += f", and {self._joints[other]} moved" * bool(other != k and abs(ways[other]) > FIRST / 2)
            self._fail(np.arange(len(ways)) == k, seen[-1], lambda k: told)
        late, due = (np.argmax((one[:, k] - one[0, k]) / asked > CROSSED) for one in (seen, sent))
        self.delays[k] = looks[late] - times[due]

    def _fail(self, wrong: NDArray[np.bool_], measured: Array, why: Callable[[int], str]) -> None:
        """Raise an error for the first joint that reads something ``wrong`` ``(n_joints,)``."""
        for k in np.flatnonzero(wrong).tolist():
            told = f"{self._joints[k]} reads {measured[k]:.4g} rad, its range is {self._low[k]:.3g} to"
            raise SimulationError(f"{told} {self._high[k]:.3g}{why(k)}; torque is off")
