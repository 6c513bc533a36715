"""A simulated hand that leads the rod as a person does on the page of ``sgimd teach``, and makes ten lessons.

    lessons = lessons_of_a_script()          # the experiment by-hand uses their demonstrations
The hand takes the rod by its tip, swings the rod to one side in one sweep, and releases it. A sweep is curved and has a
bell-shaped speed. The hand trembles, and a sweep ends a few centimetres beside its aim. Pauses before and after a sweep
are cut off, and the robot executes each lesson once.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.demonstrations.units import moving
from sgimd_torch.runs.tasks.rods import fishing_rod
from sgimd_torch.spaces import Array, stream
from sgimd_torch.teach.leading import Leading
from sgimd_torch.teach.led import hand_led_of
from sgimd_torch.teach.lessons import HandLesson, lesson_by_hand

LESSONS: Final = 10
SEED: Final = 2014  # seed of the hand; all learners get the same lessons
HEARD: Final = 0.05  # s, time between two positions of the hand, as from a browser
LASTS: Final = (0.9, 1.4)  # s, duration of a sweep
WAITS: Final = 0.3  # s, pause before and after a sweep
REACHES: Final = (0.25, 0.7)  # m, distance from the base at the end of a sweep
HEIGHTS: Final = (0.6, 0.8)  # m, height at the end of a sweep, which begins at .85 m
BESIDE: Final = 0.03  # m, standard deviation of the end of a sweep around its aim
ARCH: Final = 0.05  # m, standard deviation of the middle of a sweep around its arc
TREMBLE: Final = 0.004  # m, standard deviation of the tremor at full speed; at rest there is no tremor


def sweep(tip: Array, end: Array, rng: np.random.Generator) -> Array:
    """``(n, 3)`` m, places of the hand every ``HEARD`` s, from ``tip`` around the base to ``end``."""
    lasts = rng.uniform(*LASTS)
    phase = np.clip((np.arange(0, lasts + 2 * WAITS, HEARD) - WAITS) / lasts, 0, 1)
    share = (phase**3 * (10 - 15 * phase + 6 * phase**2))[:, None]  # minimum jerk: bell-shaped speed
    way = _around(tip) + share * (_around(end) - _around(tip))
    turn, reach, height = way.T
    hand = np.stack([reach * np.sin(turn), reach * np.cos(turn), height], axis=1)
    hand += 4 * share * (1 - share) * rng.normal(0, ARCH, 3) + share * rng.normal(0, BESIDE, 3)
    bell = (16 * phase**2 * (1 - phase) ** 2)[:, None]  # speed of minimum jerk, relative to its peak
    return np.asarray(hand + bell * rng.normal(0, TREMBLE, hand.shape))


def lead(leading: Leading, end: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Lead the arm by its tip from the start to ``end``, and release it. Returns times and joints of the recording."""
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
    """Ten lessons on the rod. Their sweeps end on all sides of the base, near the base and far from it."""
    task = fishing_rod()
    leading, found = Leading(hand_led_of(task)), list[HandLesson]()
    for number in range(LESSONS):
        rng = stream(SEED, "hand", number)
        turn = np.pi * (2 * (number * (3 - np.sqrt(5)) / 2 % 1) - 1)  # golden angle: no two sweeps go to the same side
        near, far = REACHES
        reach, height = np.sqrt(rng.uniform(near**2, far**2)), rng.uniform(*HEIGHTS)
        end = np.array([reach * np.sin(turn), reach * np.cos(turn), height])
        found.append(lesson_by_hand(*lead(leading, end, rng), task, stream(SEED, "lessons", number)))
    return found


def _around(place: Array) -> Array:
    """Cylindrical coordinates ``(3,)`` of a place: angle (rad) from straight ahead, radius (m), and height (m)."""
    return np.array([np.arctan2(place[0], place[1]), np.hypot(place[0], place[1]), place[2]])
