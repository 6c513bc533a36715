"""What a forward model costs: processor time for training it and for searching through it, relative to the physics.

Each search runs SGIM-D on the fishing rod for the same number of movements, one after the other in one process, so
all numbers are from one machine in one state. Refining is the time of a search beyond the simplex of the first line;
answering is the time for one goal of an evaluation, all goals in one batch.

Examples:
  python scripts/bench_forward_model.py                                some minutes
  python scripts/bench_forward_model.py --movements 1000 --search gradient
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "experiments"))

import torch
from tqdm import tqdm

from options import at_least
from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.runs.build import build
from sgimd_torch.runs.config import Config
from sgimd_torch.session import live, run
from sgimd_torch.spaces import Array, Estimate
from sgimd_torch.strategies import GoalBabbling

HEAD = f"{'search':22}{'physics (s)':>12}{'training':>10}{'refining':>10}{'together':>10}{'answering (ms)':>16}"


class Clock:
    """Processor time (s) within what it wraps; other processes do not count."""

    def __init__(self) -> None:
        self.seconds = 0.0

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """``function``, timed."""

        def timed(*arguments: Any) -> Any:
            begun = time.process_time()
            try:
                return function(*arguments)
            finally:
                self.seconds += time.process_time() - begun

        return timed

    def through(self, search: Callable[..., Generator[Array, Array, None]]) -> Callable[..., Any]:
        """A search whose own work is timed, without what happens between its movements."""

        def timed(start: Estimate, goal: Array) -> Generator[Array, Array, None]:
            movements = search(start, goal)
            advance = self.around(movements.send)
            try:
                theta = self.around(next)(movements, None)
                while theta is not None:
                    theta = advance((yield theta))
            except StopIteration:
                return
            finally:
                movements.close()

        return timed


def measure(search: str, movements: int, seed: int, steps: float) -> tuple[float, float, float, float]:
    """Seconds of physics, training and searching, and of answering a goal."""
    parts = build(Config(search=search, inverse="model", movements=movements, seed=seed, training=steps))
    physics, training, searching = Clock(), Clock(), Clock()
    autonomous, model, memory = parts.learner.autonomous, parts.model, parts.learner.memory
    assert isinstance(autonomous, GoalBabbling)
    assert model is not None
    autonomous.search = searching.through(autonomous.search)
    refresh, execute = training.around(model.refresh), physics.around(live(parts.environment, seed))
    lives = run(parts.learner, parts.environment, seed, movements=movements, teacher=parts.teacher, execute=execute)
    for episode in tqdm(lives, total=movements, desc=search, unit="movement", leave=False, disable=None):
        refresh(memory, episode.move.goal if episode.move else None)
    answering, goals = Clock(), parts.benchmark.goals
    context = (parts.environment.contexts.low + parts.environment.contexts.high) / 2
    answering.around(parts.inverse.many)(context, goals)  # type: ignore[attr-defined]
    return physics.seconds, training.seconds, searching.seconds, answering.seconds / len(goals)


def main() -> int:
    """Measure, and print a line for each search."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--movements", type=at_least(200), default=5000, help="of each run (5000)")
    parser.add_argument("--seed", type=at_least(0), default=1000, help="of the runs (1000)")
    parser.add_argument("--training", type=float, default=Config.training, help="steps for each movement (%(default)s)")
    through_model = [word for word, entry in CATALOGUE["search"].items() if "model" in entry.uses.values()]
    parser.add_argument("--search", choices=through_model, help="only this one and the simplex")
    options = parser.parse_args()
    torch.set_num_threads(1)
    searches = [options.search] if options.search else through_model
    print(f"{options.movements} movements, seed {options.seed}, {options.training:g} steps each")
    print(f"training, refining and both over physics\n{HEAD}")
    simplex = 0.0
    for search in ("nelder-mead", *searches):
        physics, training, searching, answering = measure(search, options.movements, options.seed, options.training)
        simplex = simplex or searching
        shares = training / physics, (searching - simplex) / physics, (training + searching - simplex) / physics
        print(
            f"{search:22}{physics:12.1f}" + "".join(f"{share:10.3f}" for share in shares) + f"{1000 * answering:16.1f}"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
