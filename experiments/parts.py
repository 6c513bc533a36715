"""What experiments need and the library lacks: rivals with tuned settings, a blind toss, lessons led by a script.

Rivals have the one setting that a search on tuning seeds found better than their defaults, see results/RIVALS.md:
    sgimd run --algorithm experiments.parts:cma_me         in the folder above
    python experiments/parts.py --out by-hand.npz          ten lessons, and a line for each
The script that leads does what a person does at the page of ``sgimd teach``: it takes the rod by its tip, swings it to
one side in one sweep, and lets go. A sweep is curved, has a bell-shaped speed, trembles, and ends a few centimetres
beside the place that was meant. The pauses are cut off, and the robot executes each lesson once.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import ArrayLike
from ribs.archives import GridArchive
from ribs.emitters import GaussianEmitter

from sgimd_torch.algorithms import Correspondence
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson, LedMovement, lesson_by_hand, resampled
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.environments.toys import toss
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.rivals import quality_diversity
from sgimd_torch.runs.process import command
from sgimd_torch.runs.tasks import Task
from sgimd_torch.runs.tasks.robots import toy_benchmark
from sgimd_torch.spaces import Array, Box, Demonstration, stream

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


def map_elites(environment: Environment, seed: int, *, memory: Memory | None = None) -> Learner:
    """MAP-Elites with cells of twice the side."""
    return quality_diversity.map_elites(environment, seed, cells=10, memory=memory)


def map_elites_middle(environment: Environment, seed: int, *, memory: Memory | None = None) -> Learner:
    """The same, with first movements around the middle of Pi, and wider variations."""

    def emitters(archive: GridArchive, rng: np.random.Generator) -> list[GaussianEmitter]:
        dim = environment.policies.dim
        bounds = {"lower_bounds": np.zeros(dim), "upper_bounds": np.ones(dim)}
        first = rng.normal(0.5, 0.1, (100, dim)).clip(0, 1)
        drawn = int(rng.integers(2**32))
        return [GaussianEmitter(archive, sigma=0.1, initial_solutions=first, batch_size=10, seed=drawn, **bounds)]

    return quality_diversity.quality_diversity(environment, seed, "map-elites", emitters, cells=10, memory=memory)


def cma_me(environment: Environment, seed: int, *, memory: Memory | None = None) -> Learner:
    """CMA-ME with a smaller first step."""
    return quality_diversity.cma_me(environment, seed, sd=0.05, memory=memory)


def cma_mae_taught(
    environment: Environment,
    seed: int,
    *,
    correspondence: Correspondence,
    imitations: int = 10,
    epsilon: float = 0.05,
    memory: Memory | None = None,
) -> Learner:
    """CMA-MAE with a smaller first step, and shown the same as SGIM-D."""
    taught = {"correspondence": correspondence, "imitations": imitations, "epsilon": epsilon}
    return quality_diversity.cma_mae(environment, seed, sd=0.05, memory=memory, **taught)  # type: ignore[arg-type]


class BlindToss:
    """The toss without a context: each movement meets a wind of its own, drawn from the same range."""

    def __init__(self) -> None:
        self._toss = toss()
        self.contexts = Box.cube(0, 1, 0)
        self.policies, self.outcomes, self.rest = self._toss.policies, self._toss.outcomes, self._toss.rest
        self.outcome_noise = self._toss.outcome_noise

    def observe(self, rng: np.random.Generator) -> Array:
        """``(0,)``: nothing."""
        return np.zeros(0)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """See `Toy.execute`."""
        return self._toss.execute(self._toss.observe(rng), theta, rng)


def blind_toss() -> Task:
    """With the goals of the toss: what is a context worth to a learner that feels the wind?"""
    goals = toy_benchmark(toss(), 0.4)
    return Task(BlindToss(), lambda: replace(goals, environment=BlindToss.__name__))


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
    return leading.stop().moving()


def lessons_of_a_script() -> list[HandLesson]:
    """Ten lessons on the rod; their sweeps end all around the base, nearer and farther."""
    rod = FishingRod()
    leading, found = Leading(rod.hand_led), list[HandLesson]()
    for number in range(LESSONS):
        rng = stream(SEED, "hand", number)
        turn = np.pi * (2 * (number * (3 - np.sqrt(5)) / 2 % 1) - 1)  # golden angle: never twice the same side
        near, far = REACHES
        reach, height = np.sqrt(rng.uniform(near**2, far**2)), rng.uniform(*HEIGHTS)
        end = np.array([reach * np.sin(turn), reach * np.cos(turn), height])
        recording = lead(leading, end, rng)
        noise = stream(SEED, "lessons", number)
        found.append(lesson_by_hand(recording, rod, rod.primitive.correspondence, rod.hand_led, noise))
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
