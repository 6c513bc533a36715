"""Refinement side by side: three searches around the same answers, at equal movements and at equal time.

    experiments/refinement.py                                       the lives of the page FORWARD_MODEL
    experiments/refinement.py --seeds 1000 1001 --results development

The searches are the simplex of Nguyen & Oudeyer (2014), descents through the forward model, and a simplex that begins
where a descent ends. The lives of a robot and a seed differ in the search alone. The next movement is always made by
the life that has taken the least time, so all of them share the machine. Once one life has all its movements, all have
had equal time. Then each one makes the movements that it lacks. Time is processor time of one thread, spent by learner,
model and robot; evaluations do not count.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import product
from typing import Any, Final

from lives import make_lives, parser
from sgimd_torch.evaluation import evaluate
from sgimd_torch.options.build import build
from sgimd_torch.options.catalogue import ROD
from sgimd_torch.options.config import Config
from sgimd_torch.runs.signals import command
from sgimd_torch.session import run

SEARCHES: Final = ("nelder-mead", "gradient", "gradient-then-nelder-mead")
SGIM_D: Final = {"algorithm": "sgim-d", "environment.threads": 1}
ROBOTS: Final[Mapping[str, Mapping[str, Any]]] = {  # options of a run, by names of robot and inverse model
    "rod by paper": {**SGIM_D, "environment": ROD, "inverse": "paper"},
    "rod by process": {**SGIM_D, "environment": ROD},
    "planar-arm-7 by process": {"algorithm": "sgim-d", "environment": "planar-arm-7"},
    "spatial-arm by process": {"algorithm": "sagg-riac", "environment": "experiments.toys:spatial_arm"},  # not taught
}
MOVEMENTS: Final = 2000
WARM: Final = 200  # movements of lives before those that count, so that everything is loaded and compiled
SEEDS: Final = range(260, 265)
TABLE: Final = "refinement.csv"


class Life:
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


def trio(
    robot: str, seed: int, *, movements: int = MOVEMENTS, clock: Callable[[], float] = time.process_time
) -> dict[str, tuple[float, ...]]:
    """By search: movements, seconds and error at equal movements, then the same at equal time."""
    settings = {search: {**ROBOTS[robot], "search": search, "seed": seed} for search in SEARCHES}
    for chosen in settings.values():
        warm = Life(chosen, WARM, clock)
        for _ in range(WARM):
            warm.move()
    lives = {search: Life(chosen, movements, clock) for search, chosen in settings.items()}
    while all(life.learner.movements < movements for life in lives.values()):
        min(lives.values(), key=lambda life: life.seconds).move()
    at_equal_time = {search: life.now() for search, life in lives.items()}
    while left := [life for life in lives.values() if life.learner.movements < movements]:
        min(left, key=lambda life: life.seconds).move()
    return {search: (*life.now(), *at_equal_time[search]) for search, life in lives.items()}


def main(argv: Sequence[str] | None = None) -> int:
    options = parser(__doc__)
    options.add_argument("--robots", nargs="+", default=[*ROBOTS], choices=ROBOTS, help="robots (default: all)")
    options.add_argument("--seeds", nargs="+", type=int, default=[*SEEDS], help="seeds (default: those of the page)")
    options.add_argument("--movements", type=int, default=MOVEMENTS, help="movements of a life (default: %(default)s)")
    options.set_defaults(processes=1)
    chosen = options.parse_args(argv)
    n_movements = len(SEARCHES) * chosen.movements
    lives = {(robot, seed): n_movements for seed, robot in product(chosen.seeds, chosen.robots)}
    make_lives(chosen.results, TABLE, partial(trio, movements=chosen.movements), lives, chosen.processes)
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
