"""Robots that change: errors after a change, with what was learnt before, beside a learner that starts anew.

    experiments/compare.py changes                                                     the lives of the page CHANGES
    experiments/compare.py changes --only fishing-rod --seeds 1000,1001 --results mine    others, on one of the robots

The learner is `practice`. On "random-robots", each seed has another robot; those of the page are 720 to 739.
What was learnt before may also come from a simulator: "simulator" is the arm of docs/how-to/sim-to-real.md, and the
learner "wrong" begins with a simulator that mirrors the outcomes.
"""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Collection, Iterable
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from lives import Life
from random_robots import RandomRobot
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.evaluation import evaluate, tile_goals, tile_side
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import ROD, load_word
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.tasks import benchmark_of

AFTER: Final = (100, 250, 500, 1000)  # movements after the change at which a learner is evaluated
BEGUN: Final = (50, *AFTER)  # movements after a simulator
GOALS: Final = 48  # largest number of goals of an evaluation
GRADUAL: Final = 2000  # number of movements in which a gradual change grows
UNDONE: Final = 500  # number of movements after which a change is undone
RANDOM_ROBOTS: Final = "random-robots"  # those of random_robots.py; each seed has another one
FIRST_RANDOM: Final = 440  # number of the random robot of seed 0
# Movements before a change.
ROBOTS: Final = {ROD: 500, RANDOM_ROBOTS: 1000}
# Changes after which much of what was learnt still holds, in some way.
PARTIAL: Final = ("offset-0.1", "offset-0.02", "gain", "stuck", "swap", "shift", "gradual", "undone")
CHANGES: Final = (*PARTIAL, "mirrored", "noise")
GOES_ON: Final = "goes-on"  # learner that goes on after a change
ANEW: Final = "anew"  # learner that begins after the change
BLIND: Final = "blind"  # learner that goes on and notices no change
WRONG: Final = "wrong"  # learner that begins with a simulator that mirrors the outcomes
ARM: Final = "mujoco-arm"  # the arm of docs/how-to/sim-to-real.md
SIMULATOR: Final = "simulator"  # the change from the simulated arm to the real one
SIMULATED: Final = 2000  # movements in the simulator
SEEDS: Final = range(280, 300)
TABLE: Final = "changes.csv"
PAGE: Final = Path(__file__).parents[1] / "docs" / "how-to" / "sim-to-real.md"


class Changing:
    """A robot that changes after ``at`` movements. ``made`` counts them, set by the caller."""

    def __init__(self, robot: Any, change: str, at: int) -> None:
        self.robot, self.at, self.made = robot, at, 0
        self.change, _, self.size = change.partition("-")
        self.contexts, self.policies, self.outcomes = robot.contexts, robot.policies, robot.outcomes
        self.rest, self.outcome_noise = robot.rest, robot.outcome_noise

    def observe(self, rng: np.random.Generator) -> Any:
        return self.robot.observe(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        outcome = self._seen(self.robot.execute(context, self._moved(theta), rng))
        if self.change == "noise" and self._since >= 0:  # three times as large, but for robots without noise
            sd = np.sqrt(8) * self.outcome_noise or 0.015 * self.outcomes.sides.mean()
            outcome = outcome + rng.normal(0, sd, len(outcome))
        return outcome

    def effect(self, context: Array, theta: Array) -> Array:
        """Outcome of a movement of a random robot, without noise."""
        return self._seen(self.robot.effect(context, self._moved(theta)))

    @property
    def _since(self) -> int:
        return self.made - self.at

    def _moved(self, theta: ArrayLike) -> Array:
        """The movement that is made."""
        box, theta, since = self.policies, np.array(theta, dtype=np.float64), self._since
        if since < 0 or (self.change == "undone" and since >= UNDONE):
            return theta
        middle = (box.low + box.high) / 2
        match self.change:
            case "offset" | "undone":
                theta += float(self.size or 0.1) * box.sides
            case "gradual":
                theta += 0.1 * min(1.0, since / GRADUAL) * box.sides
            case "gain":
                theta = middle + 0.8 * (theta - middle)
            case "stuck":
                theta[1] = box.low[1] + 0.7 * box.sides[1]
            case "swap" | "reversed":  # only tests use the latter: nothing of before helps
                order = [1, 0, *range(2, box.dim)] if self.change == "swap" else np.arange(box.dim)[::-1]
                theta = box.low + (theta - box.low)[order] * (box.sides / box.sides[order])
            case "mirrored":
                theta = 2 * middle - theta
        return box.clip(theta)

    def _seen(self, outcome: Array) -> Array:
        """The outcome that is told."""
        if self._since >= 0 and self.change == "shift":
            return outcome + 0.04 * self.outcomes.sides
        if self._since >= 0 and self.change == "mirrored":
            return outcome * np.where(np.arange(len(outcome)) == 0, -1, 1)
        return outcome


def life(name: str, change: str, learner: str, seed: int) -> dict[int, tuple[float, int]]:
    """Errors by number of movements after the change, and how many changes the learner has noticed by then."""
    if change == SIMULATOR:
        return life_after_simulator(learner, seed)
    at, start = (0, 0) if learner == ANEW else (ROBOTS[name], ROBOTS[name] + UNDONE * (change == "undone"))
    robot, goals = robot_of(name, seed)
    world = Changing(robot, "none" if learner == ANEW and change == "undone" else change, at)
    robotic = practice(world, seed + 50 * (learner == ANEW))
    if learner == BLIND:
        robotic.watcher = None
    return errors(robotic, world, seed, goals, start, after(name))


def robot_of(name: str, seed: int) -> tuple[Any, Array | None]:
    """The rod and goals of its benchmark, or a random robot and None, as it has goals of its own."""
    if name == RANDOM_ROBOTS:
        return RandomRobot(FIRST_RANDOM + seed), None
    made = load_word("environment", name)()
    goals = benchmark_of(made, None)[0].goals
    return made.environment, goals[:: 1 + len(goals) // GOALS]


def life_after_simulator(learner: str, seed: int) -> dict[int, tuple[float, int]]:
    """Errors on the real arm of docs/how-to/sim-to-real.md, at goals that the simulated arm has reached."""
    with TemporaryDirectory() as folder:
        program = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
        subprocess.run([sys.executable, "-c", program], cwd=folder, check=True)  # writes both models
        arm = partial(MujocoRobot, outcome="site:tip:xy", low=(-1, -1), high=(1, 1))
        simulated, real = arm(Path(folder, "model.xml")), arm(Path(folder, "real.xml"), noise=0.005)
    past = practice(simulated, seed)
    for _ in run(past, simulated, seed, movements=SIMULATED):
        pass
    outcomes = past.memory.outcomes
    side = tile_side(outcomes, simulated.outcomes, 2 * GOALS)
    goals = tile_goals(outcomes, simulated.outcomes, side, stream(seed, "benchmark"))
    prior = Memory(0, simulated.policies.dim, simulated.outcomes.dim)
    prior.extend(past.memory.contexts, past.memory.thetas, outcomes * ((-1, 1) if learner == WRONG else 1))
    return errors(practice(real, seed, prior=None if learner == ANEW else prior), real, seed, goals, 0, BEGUN)


def errors(
    learner: Learner, world: Any, seed: int, goals: Array | None, start: int, counts: Collection[int]
) -> dict[int, tuple[float, int]]:
    """Mean error at the goals (unit of T), and changes noticed, by number of movements after the first ``start``.

    Without goals, ``world`` is a random robot that changes, and the error is relative to the spread of its goals.
    """
    errors_at = {}
    for episode in run(learner, world, seed, movements=start + max(counts)):
        made = episode.index + 1
        if isinstance(world, Changing):
            world.made = made
        if made - start in counts:
            if goals is None:
                error = world.robot.error(learner.inverse, world.effect)
            else:
                error = evaluate(learner.inverse, world, goals, 1, step=made, repeats=0).mean_error
            errors_at[made - start] = error, len(learner.changes)
    return errors_at


def after(robot: str) -> tuple[int, ...]:
    """Numbers of movements after a change at which a learner on this robot is evaluated."""
    return tuple(n for n in AFTER if n <= ROBOTS[robot])


def learners(change: str) -> tuple[str, ...]:
    """The learners of a page for this change."""
    return {"noise": (GOES_ON, ANEW, BLIND), SIMULATOR: (GOES_ON, ANEW, WRONG)}.get(change, (GOES_ON, ANEW))


def lives(seeds: Iterable[int] | None, only: Collection[str], out: Path) -> list[Life]:
    """The lives on these robots with these seeds, None for those of the page."""
    made = []
    for seed, robot, change in product(SEEDS if seeds is None else seeds, only, (*CHANGES, SIMULATOR)):
        for learner in learners(change) if (robot == ARM) == (change == SIMULATOR) else ():
            before = SIMULATED if robot == ARM else ROBOTS[robot] * (learner != ANEW)
            movements = before + (BEGUN if robot == ARM else after(robot))[-1]
            made.append(Life(TABLE, (robot, change, learner, seed), movements, out))
    return made
