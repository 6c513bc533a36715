"""Ten lessons led by hand, where a script is the hand: what are they worth to a learner?

The script does what a person does at the page of ``sgimd teach``: it takes the rod by its tip, swings it to one side in
one sweep, and lets go. A sweep is curved, has a bell-shaped speed, trembles, and ends a few centimetres beside the
place that was meant; the arm hears of it 20 times a second. The pauses are cut off, and the robot executes each lesson
once.
    python experiments/by_hand.py --out by-hand.npz          a line for each lesson
    python experiments/compare.py by-hand                    against no teacher and ten shipped demonstrations
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson, LedMovement, lesson_by_hand, resampled
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.runs.process import command
from sgimd_torch.spaces import Array, Demonstration, stream

LESSONS: Final = 10
SEED: Final = 2014  # of the hand, which is the same for every learner
HEARD: Final = 0.05  # s, from one word of the hand to the next, as from a browser
LASTS: Final = (0.9, 1.4)  # s, of a sweep
WAITS: Final = 0.3  # s, before and after it
MEANT: Final = (
    (0.25, 0.7),
    (0.6, 0.8),
)  # m: how far from the base, and how high, a sweep ends; it begins at .85
BESIDE: Final = 0.03  # m, standard deviation of where it ends
ARCH: Final = 0.05  # m, the same of how far the middle of a sweep lies off the way
STILL: Final = 0.05  # of the largest speed: all joints slower than this is a pause
TREMBLE: Final = 0.004  # m, the same of the hand's trembling where it is fastest; a mouse at rest does not tremble


def sweep(tip: Array, end: Array, rng: np.random.Generator) -> Array:
    """``(n_words, 3)`` m, where the hand is every ``HEARD`` s, on its way from ``tip`` around the base to ``end``."""
    lasts = rng.uniform(*LASTS)
    phase = np.clip((np.arange(0, lasts + 2 * WAITS, HEARD) - WAITS) / lasts, 0, 1)
    share = (phase**3 * (10 - 15 * phase + 6 * phase**2))[:, None]  # minimum jerk: bell-shaped speed
    way = _around(tip) + share * (_around(end) - _around(tip))
    turn, reach, height = way.T
    hand = np.stack([reach * np.sin(turn), reach * np.cos(turn), height], axis=1)
    hand += 4 * share * (1 - share) * rng.normal(0, ARCH, 3) + share * rng.normal(0, BESIDE, 3)
    bell = (16 * phase**2 * (1 - phase) ** 2)[:, None]  # the speed of minimum jerk, 1 at its peak
    return np.asarray(hand + bell * rng.normal(0, TREMBLE, hand.shape))


def lead(leading: Leading, end: Array, rng: np.random.Generator) -> LedMovement:
    """The arm taken by the hand's place on it, led from its start to ``end``, and let go."""
    leading.home()
    leading.grab()
    leading.record()
    for place in sweep(leading.point, end, rng):
        leading.drag(place)
        leading.step(HEARD)
    leading.release()
    leading.step(WAITS)
    return without_pauses(leading.stop())


def without_pauses(recording: LedMovement) -> LedMovement:
    """Without the time before the first motion and after the last one."""
    speeds = np.abs(np.diff(recording.joints, axis=0) / np.diff(recording.times)[:, None]).max(axis=1)
    rows = np.flatnonzero(speeds > STILL * speeds.max())
    return recording.trim(recording.times[rows[0]], recording.times[rows[-1] + 1])


def lessons_of_a_script(n: int = LESSONS, seed: int = SEED) -> list[HandLesson]:
    """``n`` lessons on the rod; their sweeps end all around the base, nearer and farther."""
    rod = FishingRod()
    leading, found = Leading(rod.hand_led), list[HandLesson]()
    for number in range(n):
        rng = stream(seed, "hand", number)
        turn = np.pi * (2 * (number * (3 - np.sqrt(5)) / 2 % 1) - 1)  # golden angle: never twice the same side
        (near, far), heights = MEANT
        reach, height = np.sqrt(rng.uniform(near**2, far**2)), rng.uniform(*heights)
        end = np.array([reach * np.sin(turn), reach * np.cos(turn), height])
        recording = lead(leading, end, rng)
        noise = stream(seed, "lessons", number)
        found.append(lesson_by_hand(recording, rod, rod.primitive.correspondence, rod.hand_led, noise))
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Write the lessons, and say how they went; returns 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.npz")
    options = parser.parse_args(argv)
    found = lessons_of_a_script()
    made = [lesson.demonstration for lesson in found]
    print("lesson  lasts (s)  lands            misfit (rad)  jerk (rad/s^3)  remarks")
    for number, lesson in enumerate(found):
        shown = lesson.demonstration
        x, y = shown.outcome
        remarks = "; ".join(lesson.remarks) or "-"
        says = f"{number:<6}  {shown.times[-1]:<9.2f}  ({x:5.2f}, {y:5.2f})   {lesson.misfit:<12.3f}"
        print(f"{says}  {jerk(shown):<14.0f}  {remarks}")
    shipped, ours = (np.array([jerk(shown) for shown in each]) for each in (load_demonstrations(), made))
    print(f"jerk: {_range(ours)}, of the shipped demonstrations {_range(shipped)}")
    save_demonstrations(options.out, made)
    return 0


def jerk(shown: Demonstration) -> float:
    """Root mean square over time and joints (rad/s^3) of a recording's third derivative, at 50 samples a second."""
    times, joints = resampled(shown.times, shown.trajectory)
    return float(np.sqrt(np.mean((np.diff(joints, 3, axis=0) / times[1] ** 3) ** 2)))


def _range(values: Array) -> str:
    return f"{np.median(values):.0f} (median), {values.min():.0f} to {values.max():.0f} rad/s^3"


def _around(place: Array) -> Array:
    """``(3,)`` turn (rad) around the base from straight ahead, distance (m) from its axis, and height (m)."""
    return np.array([np.arctan2(place[0], place[1]), np.hypot(place[0], place[1]), place[2]])


if __name__ == "__main__":
    sys.exit(command(main))
