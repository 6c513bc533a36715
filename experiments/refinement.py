"""Refinement side by side: three searches around the same answers, at equal movements and at equal time.

    experiments/refinement.py                                       the lives of the page FORWARD_MODEL

The searches are the simplex of Nguyen & Oudeyer (2014), descents through the forward model, and a simplex that begins
where a descent ends. The lives of a robot and a seed differ in the search alone. The next movement is always made by
the life that has taken the least time, so all of them share the machine. Once one life has all its movements, all have
had equal time. Then each one makes the movements that it lacks. Time is processor time of one thread, spent by learner,
model and robot; evaluations do not count.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final

from lives import Life, collect
from sgimd_torch.evaluation import evaluate
from sgimd_torch.extras.sweep.parallel import Machine, sweep
from sgimd_torch.options.catalogue import ROD
from sgimd_torch.options.config import Config
from sgimd_torch.runs.build import build
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import command
from sgimd_torch.session import run
from table import read_table

SEARCHES: Final = ("nelder-mead", "gradient")
SGIM_D: Final = {"algorithm": "sgim-d", "environment.threads": 1}
ROBOTS: Final[Mapping[str, Mapping[str, Any]]] = {  # options of a run, by names of robot and inverse model
    "rod by paper": {**SGIM_D, "environment": ROD, "inverse": "paper"},
    "rod by process": {**SGIM_D, "environment": ROD},
    "planar-arm-7 by process": {"algorithm": "sgim-d", "environment": "planar-arm-7"},
    "spatial-arm by process": {"algorithm": "sagg-riac", "environment": "experiments.toys:spatial_arm"},  # not taught
}
MOVEMENTS: Final = 2000
WARM: Final = 200  # movements of lives before those that count, so that everything is loaded and compiled
SEEDS: Final = range(280, 285)
TABLE: Final = "refinement.csv"


class TimedLife:
    """Life of a learner, and the ``seconds`` that it has taken."""

    def __init__(self, settings: Mapping[str, Any], movements: int, clock: Callable[[], float]) -> None:
        self.parts = parts = build(Config.from_settings(settings))
        self.learner, self.clock, self.seconds = parts.learner, clock, 0.0
        self._episodes = run(
            parts.learner, parts.environment, parts.config.seed, movements=movements, teacher=parts.teacher
        )

    def move(self) -> None:
        """Make a movement, and refresh the forward model if there is one."""
        begun = self.clock()
        next(self._episodes)
        for model in self.learner.problem.trained:
            model.refresh(self.learner.memory)
        self.seconds += self.clock() - begun

    def now(self) -> tuple[int, float, float]:
        """Movements, seconds, and mean error at the goals of the benchmark (unit of T)."""
        made, (environment, benchmark) = self.learner.movements, (self.parts.environment, self.parts.benchmark)
        evaluation = evaluate(
            self.learner.inverse, environment, benchmark.goals, self.parts.config.seed, step=made, repeats=0
        )
        return made, self.seconds, evaluation.mean_error


def life(
    robot: str, seed: int, *, movements: int = MOVEMENTS, clock: Callable[[], float] = time.process_time
) -> dict[str, tuple[float, ...]]:
    """By search: movements, seconds and error at equal movements, then the same at equal time."""
    settings = {search: {**ROBOTS[robot], "search": search, "seed": seed} for search in SEARCHES}
    for chosen in settings.values():
        warm = TimedLife(chosen, WARM, clock)
        for _ in range(WARM):
            warm.move()
    lives = {search: TimedLife(chosen, movements, clock) for search, chosen in settings.items()}
    while all(life.learner.movements < movements for life in lives.values()):
        min(lives.values(), key=lambda life: life.seconds).move()
    at_equal_time = {search: life.now() for search, life in lives.items()}
    while left := [life for life in lives.values() if life.learner.movements < movements]:
        min(left, key=lambda life: life.seconds).move()
    return {search: (*life.now(), *at_equal_time[search]) for search, life in lives.items()}


def main(argv: Sequence[str] | None = None) -> int:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--results", type=Path, default=Path("results"), help="folder of the table (default: results)")
    results, n_movements = options.parse_args(argv).results, len(SEARCHES) * MOVEMENTS
    made = {*read_table(results, TABLE)[["robot", "seed"]].itertuples(index=False, name=None)}
    left = [Life(TABLE, key, n_movements) for key in product(ROBOTS, SEEDS) if key not in made]
    failures = sweep(left, Machine(1), on_end=partial(collect, results))
    say(*failures)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(command(main))
