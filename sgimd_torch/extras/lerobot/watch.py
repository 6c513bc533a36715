"""How the joints of an arm follow their commands: a reading that cannot be, or a joint that stalls, is a failure.

watch.check(measured); watch.see(now, measured); watch.command(now, wanted, push)    # at each look at the arm
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.spaces import Array, Box

BEGUN: Final = 0.2  # s after which all joints follow their commands
HELD: Final = 0.05  # s in which a stalled joint has not moved
MOVED: Final = 0.01  # rad, least way of a joint that moves
FASTER: Final = 2.0  # times its allowed speed at which a joint may catch up with its command
FIRST: Final = 0.12  # rad, length of a first step; then no joint may go farther than twice that and its tolerance
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
        for k in np.flatnonzero(np.abs(measured - measured.clip(self._low, self._high)) > self._tolerance).tolist():
            raise SimulationError(
                f"{self._told(k, measured)}; is its unit or its calibration another one? torque is off"
            )
        return measured

    def begin(self, now: float, command: Array) -> None:
        """A movement begins."""
        still = np.zeros(len(command))
        self._begun, self._sent, self._seen = now, [(now, command, still)], list[Array]()
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
            for k in np.flatnonzero(np.abs(measured - readings) > most).tolist():
                told = f"{self._told(k, measured)}, {now - before:.2g} s after {readings[k]:.3g} rad"
                raise SimulationError(f"{told}: no joint moves that far in the time; torque is off")
        self.last = now, measured
        self._seen.append(measured)
        first = self._seen[0] if np.isinf(self.delays).any() else measured
        for k in np.flatnonzero(np.abs(measured - first) > 2 * FIRST + self._tolerance).tolist():
            told = f"{self._told(k, measured)}, after {first[k]:.3g} rad and a first step of {FIRST:g} rad"
            raise SimulationError(f"{told}: does it read what it is commanded in? torque is off")
        times, commands, gone = (np.array(part) for part in zip(*self._sent, strict=True))
        heard = np.maximum(np.searchsorted(times, now - self.delays, "right") - 1, 0)  # what each joint follows now
        if heard.min() > 0:  # the rest is not needed any more
            self._sent = self._sent[heard.min() :]
        since = np.arange(len(times))[:, None] >= heard
        low, high = np.where(since, commands, np.inf).min(axis=0), np.where(since, commands, -np.inf).max(axis=0)
        behind, gone = np.maximum(low - measured, measured - high) - self.errors, gone[heard, range(len(heard))]
        free = (behind <= min(self._stall, self._step)) | (np.abs(measured - self._free) > MOVED)
        free |= now - self._begun < BEGUN + self.delays
        self._free_at[free], self._free[free], self._gone[free] = now, measured[free], gone[free]
        for k in np.flatnonzero(
            (gone - self._gone > self._stall) & (now - self._free_at > HELD + self.delays / 2)
        ).tolist():
            told = f"{self._joints[k]} stalls at {measured[k]:.3g} rad on its way to {commands[-1, k]:.3g}"
            raise SimulationError(f"{told}; torque is off")

    def learn(self, k: int) -> None:
        """Measure how late joint ``k`` has followed its first step, the movement that ends now.

        Raises:
            SimulationError: it did not go the way of its command.
        """
        seen, sent = np.array(self._seen), np.array([command for _, command, _ in self._sent])[:-1, k]
        asked, ways = sent[-1] - sent[0], seen[-1] - seen[0]
        if not FOLLOWS[0] <= ways[k] / asked <= FOLLOWS[1]:
            other = int(np.abs(ways).argmax())
            told = f"{self._told(k, seen[-1])}: it was asked for a first step of {asked:.2g} rad and went {ways[k]:.2g}"
            hint = f", and {self._joints[other]} moved" if other != k and abs(ways[other]) > FIRST / 2 else ""
            raise SimulationError(f"{told}{hint}; torque is off")
        late, due = (int(np.argmax((one - one[0]) / asked > CROSSED)) for one in (seen[:, k], sent))
        self.delays[k] = self._sent[1 + late][0] - self._sent[1 + due][0]

    def _told(self, k: int, measured: Array) -> str:
        return f"{self._joints[k]} reads {measured[k]:.4g} rad, its range is {self._low[k]:.3g} to {self._high[k]:.3g}"
