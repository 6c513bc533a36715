"""A recording of an arm that was led by the hand, before anybody knows where the movement lands.

    recording = leading.stop().without_pauses().trim(0.1, 1.3).within(longest=1.6).resampled()
    recording.save("swing.npz"); Recording.load("swing.npz")
``teachers/lessons.py`` makes a lesson of it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, field

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.spaces import Array, Demonstration, check_vector, read_only

RATE = 50.0  # Hz, of the shipped demonstrations and of motor primitives
STILL = 0.05  # of the largest speed: all joints slower than this is a pause


@dataclass(frozen=True, eq=False)
class Recording:
    """Joint angles over time; arrays are read-only copies.

    Args:
        times: ``(n_times,)`` s, increasing from 0, two or more.
        joints: ``(n_times, n_joints)`` rad.
        gaps: ``(n_times,)`` m, how far the led point stayed from the way that the hand wanted it to go, 0 where nothing
            was held; None for 0 everywhere. A file does not keep them.

    Raises:
        ValueError: shapes that do not fit, values that are not finite, or times that do not increase from 0.
    """

    times: Array
    joints: Array
    gaps: Array | None = field(default=None)

    def __post_init__(self) -> None:
        joints = np.asarray(self.joints)
        if joints.ndim != 2 or len(joints) < 2:
            raise ValueError(f"a recording needs 2 samples or more, got shape {joints.shape}; was it too short?")
        joints = check_vector("joints of a recording", joints, joints.shape[1], "in rad")
        times = check_vector("times of a recording", self.times, len(joints), "one time in s for each row of joints")
        if times.ndim != 1 or times[0] != 0 or not (np.diff(times) > 0).all():
            raise ValueError(f"times of a recording must increase from 0, got {times}; were its rows shuffled?")
        gaps = np.zeros(len(times)) if self.gaps is None else self.gaps
        gaps = check_vector("gaps of a recording", gaps, len(times), "one in m for each row of joints")
        for name, value in (("times", times), ("joints", joints), ("gaps", gaps)):
            object.__setattr__(self, name, read_only(value.astype(np.float64)))

    @property
    def duration(self) -> float:
        """s."""
        return float(self.times[-1])

    @property
    def speeds(self) -> Array:
        """``(n_joints,)`` rad/s, the largest between two samples."""
        largest: Array = np.abs(np.diff(self.joints, axis=0) / np.diff(self.times)[:, None]).max(axis=0)
        return largest

    def trim(self, start: float, end: float) -> Recording:
        """What happened from ``start`` to ``end`` (s), its times from 0.

        Raises:
            ValueError: fewer than two samples lie between them.
        """
        kept = (self.times >= start - 1e-9) & (self.times <= end + 1e-9)
        if kept.sum() < 2:
            raise ValueError(
                f"from {start:g} s to {end:g} s there are {int(kept.sum())} samples of a recording of "
                f"{self.duration:g} s, at least 2 are needed; were the ends swapped?"
            )
        times = self.times[kept]
        return Recording(times - times[0], self.joints[kept], self._gaps[kept])

    def without_pauses(self) -> Recording:
        """Without the time before the first motion and after the last one; all of it if nothing moves."""
        speeds = np.abs(np.diff(self.joints, axis=0) / np.diff(self.times)[:, None]).max(axis=1)
        rows = np.flatnonzero(speeds > STILL * speeds.max())
        return self.trim(self.times[rows[0]], self.times[rows[-1] + 1]) if len(rows) else self

    def within(self, longest: float) -> Recording:
        """Played faster, so that it lasts ``longest`` (s); one that is not longer stays as it is."""
        if self.duration <= longest:
            return self
        times = self.times / self.duration * longest  # ends exactly at longest
        return Recording(times, self.joints, self._gaps)

    def resampled(self, rate: float = RATE) -> Recording:
        """At equal steps, at least ``rate`` (Hz) of them a second, as `GaussianPrimitive.trajectory` has them."""
        times = np.linspace(0.0, self.duration, max(2, int(np.ceil(self.duration * rate - 1e-9)) + 1))
        joints = np.stack([np.interp(times, self.times, column) for column in self.joints.T], axis=1)
        return Recording(times, joints, np.interp(times, self.times, self._gaps))

    def save(self, path: str | os.PathLike[str]) -> None:
        """As a demonstration file with one recording, of no outcome and no context.

        Raises:
            OSError: ``path`` is a directory, or cannot be written.
        """
        save_demonstrations(path, [Demonstration(np.empty(0), self.times, self.joints, np.empty(0))])

    @classmethod
    def load(cls, path: str | os.PathLike[str], row: int = 0) -> Recording:
        """Recording number ``row`` of a demonstration file, whether or not it says where it landed.

        Raises:
            ValueError: it is no such file, or has fewer recordings.
            OSError: there is no file.
        """
        found = load_demonstrations(path)
        if not 0 <= row < len(found):
            raise ValueError(f"{path} has {len(found)} recordings, number {row} was wanted; they count from 0")
        return cls(found[row].times, found[row].trajectory)

    @property
    def _gaps(self) -> Array:
        assert self.gaps is not None  # see __post_init__
        return self.gaps
