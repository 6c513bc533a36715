"""Robots that change: errors after a change, with what was learnt before, beside a learner that starts anew.

    experiments/changing.py --tasks planar-arm-7 toss --changes offset-0.1 gain --seeds 1000 1001 --out changing.jsonl
    experiments/changing.py --unchanged --seeds 1000 --out unchanged.jsonl    # false alarms

Every life is a line of the file; lives that are there already are not made again. One process uses one core.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from random_robots import RandomRobot
from sgimd_torch.algorithms.paper import sagg_riac
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.catalogue import load_word
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import evaluate
from sgimd_torch.learner import Learner
from sgimd_torch.runs.tasks import benchmark_of
from sgimd_torch.session import run
from sgimd_torch.spaces import Array

AFTER: Final = (100, 250, 500, 1000)  # movements after the change at which a learner is evaluated
GOALS: Final = 48  # largest number of goals of an evaluation
GRADUAL, UNDONE = 2000, 500  # movements in which a gradual change grows; after which a change is undone
ALGORITHMS: Final = {"practice": practice, "sagg-riac": sagg_riac}
LEARNERS: Final = ("changes", "anew", "blind")  # notices changes; begins after the change; does not notice changes


class Changing:
    """A robot that changes after ``at`` movements. ``made`` counts them, set by the caller."""

    def __init__(self, robot: Environment, change: str, at: int) -> None:
        self.robot, self.at, self.made = robot, at, 0
        self.change, _, self.size = change.partition("-")
        self.contexts, self.policies, self.outcomes = robot.contexts, robot.policies, robot.outcomes
        self.rest, self.outcome_noise = robot.rest, robot.outcome_noise

    def observe(self, rng: np.random.Generator) -> Array:
        return self.robot.observe(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        since = self.made - self.at
        if since < 0 or self.change == "none" or (self.change == "undone" and since >= UNDONE):
            return self.robot.execute(context, theta, rng)
        box, theta = self.policies, np.array(theta, dtype=np.float64)
        middle, upper = (box.low + box.high) / 2, theta[0] > (box.low + box.high)[0] / 2
        match self.change:
            case "offset" | "undone":
                theta += float(self.size or 0.1) * box.sides
            case "gradual":
                theta += 0.1 * min(1.0, since / GRADUAL) * box.sides
            case "local" if upper:
                theta += 0.1 * box.sides
            case "gain":
                theta = middle + 0.8 * (theta - middle)
            case "stuck":
                theta[1] = box.low[1] + 0.7 * box.sides[1]
            case "reversed":
                theta = box.low + (theta[::-1] - box.low[::-1]) * (box.sides / box.sides[::-1])
            case "mirrored":
                theta = 2 * middle - theta
        outcome = self.robot.execute(context, box.clip(theta), rng)
        if self.change == "mirrored":
            outcome = outcome * np.where(np.arange(len(outcome)) == 0, -1, 1)
        if self.change == "noise":  # three times as large, but for robots without noise
            outcome = outcome + rng.normal(0, max(np.sqrt(8) * self.outcome_noise, 0.03), len(outcome))
        return outcome


def life(task: str, change: str, seed: int, learner: str, algorithm: str, before: int) -> dict[str, Any]:
    """Errors of one life, by number of movements after the change."""
    made = load_word("environment", task)()
    robot, goals = made.environment, benchmark_of(made, None)[0].goals
    goals = goals[:: 1 + len(goals) // GOALS]
    at = 0 if learner == "anew" else before
    world = Changing(robot, "none" if learner == "anew" and change == "undone" else change, at)
    last = max(AFTER) if task != "fishing-rod" else 500
    counts = [*AFTER, 2000, 2500] if change == "gradual" else [n for n in AFTER if n <= last]
    counts = [UNDONE * (change == "undone" and learner != "anew") + n for n in counts]
    robotic = ALGORITHMS[algorithm](world, seed + 50 * (learner == "anew"))
    if learner == "blind":
        robotic.watcher = None
    errors = {}
    for episode in run(robotic, world, seed, movements=at + counts[-1]):
        world.made = episode.index + 1
        if world.made - at in counts:
            errors[world.made - at] = error(robotic, world, goals)
    return {"errors": errors, "changes": [tuple(each) for each in robotic.changes]}


def error(learner: Learner, world: Environment, goals: Array) -> float:
    """Mean error at the goals, in the unit of T."""
    return round(evaluate(learner.inverse, world, goals, 1, step=learner.movements, repeats=0).mean_error, 5)


def unchanged(task: str, seed: int, algorithm: str) -> dict[str, Any]:
    """Alarms in 2000 movements of a robot that does not change; ``task`` may be the number of a random robot."""
    world: Environment = RandomRobot(int(task)) if task.isdigit() else load_word("environment", task)().environment
    learner = ALGORITHMS[algorithm](world, seed)
    for _ in run(learner, world, seed, movements=2000):
        pass
    return {"changes": [tuple(each) for each in learner.changes]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tasks", nargs="+", default=["planar-arm-7"])
    parser.add_argument("--changes", nargs="+", default=["offset-0.1"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1000])
    parser.add_argument("--learners", nargs="+", default=list(LEARNERS[:2]), choices=LEARNERS)
    parser.add_argument("--algorithms", nargs="+", default=["practice"], choices=ALGORITHMS)
    parser.add_argument("--before", type=int, default=1000, help="movements before the change")
    parser.add_argument("--unchanged", action="store_true", help="count false alarms instead")
    parser.add_argument("--out", type=Path, default=Path("changing.jsonl"))
    options = parser.parse_args()
    known = (
        {tuple(json.loads(line)["life"]) for line in options.out.read_text().splitlines()}
        if options.out.exists()
        else set()
    )
    lives: dict[tuple[Any, ...], Callable[[], dict[str, Any]]] = {}
    for task, seed, algorithm in product(options.tasks, options.seeds, options.algorithms):
        if options.unchanged:
            lives[task, seed, algorithm] = partial(unchanged, task, seed, algorithm)
            continue
        for change, learner in product(options.changes, options.learners):
            key = task, change, seed, learner, algorithm, options.before
            lives[key] = partial(life, *key)
    for key, made in lives.items():
        if key not in known:
            line = json.dumps({"life": key, **made()})
            print(line, flush=True)
            with options.out.open("a") as file:
                file.write(line + "\n")


if __name__ == "__main__":
    main()
