"""A script that leads the rod as a person does at the page of ``sgimd teach``, and makes ten lessons.

    python experiments/hand.py --out by-hand.npz          ten lessons, and a line for each
The script takes the rod by its tip, swings it to one side in one sweep, and releases it. A sweep is curved, has a
bell-shaped speed, trembles, and ends a few centimetres beside its aim. Pauses are cut off, and the robot executes each
lesson once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.runs.process import command
from sgimd_torch.runs.tasks.rods import fishing_rod
from sgimd_torch.spaces import Array, Demonstration, stream
from sgimd_torch.teach.leading import Leading
from sgimd_torch.teach.led import hand_led_of
from sgimd_torch.teach.lessons import HandLesson, lesson_by_hand, moving, resampled

LESSONS: Final = 10
SEED: Final = 2014  # of the hand, which is the same for every learner
HEARD: Final = 0.05  # s, from one word of the hand to the next, as from a browser
LASTS: Final = (0.9, 1.4)  # s, of a sweep
WAITS: Final = 0.3  # s, before and after it
REACHES: Final = (0.25, 0.7)  # m, how far from the base a sweep ends
HEIGHTS: Final = (0.6, 0.8)  # m, and how high; it begins at .85
BESIDE: Final = 0.03  # m, standard deviation of where it ends
ARCH: Final = 0.05  # m, the same of how far the middle of a sweep lies off the way
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


def lead(leading: Leading, end: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Lead the arm by its hand from its start to ``end``, and release it."""
    leading.home()
    leading.grab()
    leading.begin_recording()
    for place in sweep(leading.point, end, rng):
        leading.drag(place)
        leading.step(HEARD)
    leading.release()
    leading.step(WAITS)
    return moving(*leading.end_recording())


def lessons_of_a_script() -> list[HandLesson]:
    """Ten lessons on the rod; their sweeps end all around the base, nearer and farther."""
    task = fishing_rod()
    leading, found = Leading(hand_led_of(task)), list[HandLesson]()
    for number in range(LESSONS):
        rng = stream(SEED, "hand", number)
        turn = np.pi * (2 * (number * (3 - np.sqrt(5)) / 2 % 1) - 1)  # golden angle: never twice the same side
        near, far = REACHES
        reach, height = np.sqrt(rng.uniform(near**2, far**2)), rng.uniform(*HEIGHTS)
        end = np.array([reach * np.sin(turn), reach * np.cos(turn), height])
        found.append(lesson_by_hand(*lead(leading, end, rng), task, stream(SEED, "lessons", number)))
    return found


def jerk(shown: Demonstration) -> float:
    """Root mean square over time and joints (rad/s^3) of a recording's third derivative, at 50 samples a second."""
    times, joints = resampled(shown.times, shown.trajectory)
    return float(np.sqrt(np.mean((np.diff(joints, 3, axis=0) / times[1] ** 3) ** 2)))


def _around(place: Array) -> Array:
    """``(3,)`` turn (rad) around the base from straight ahead, distance (m) from its axis, and height (m)."""
    return np.array([np.arctan2(place[0], place[1]), np.hypot(place[0], place[1]), place[2]])


def main(argv: Sequence[str] | None = None) -> int:
    """Write the lessons, and say how they went; returns 0."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, metavar="FILE.npz")
    options = parser.parse_args(argv)
    lessons = lessons_of_a_script()
    for number, lesson in enumerate(lessons):
        shown = lesson.demonstration
        x, y = shown.outcome
        words = f"{shown.times[-1]:.2f} s, lands at ({x:.2f}, {y:.2f}) m, misfit {lesson.misfit:.3f} rad"
        print(f"{number}: {words}, jerk {jerk(shown):.0f} rad/s^3; {'; '.join(lesson.remarks)}")
    for whose, each in (
        ("of the script", [lesson.demonstration for lesson in lessons]),
        ("shipped", load_demonstrations()),
    ):
        found = [jerk(shown) for shown in each]
        print(f"jerk, {whose}: {np.median(found):.0f} (median), {min(found):.0f} to {max(found):.0f} rad/s^3")
    save_demonstrations(options.out, [lesson.demonstration for lesson in lessons])
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
