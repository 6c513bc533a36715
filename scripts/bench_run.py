"""What a board and a forward model cost: processor time within a run; other processes do not count.

``board`` gives the board's share of an SGIM-D run, how many tags it has and how large its file gets. ``model`` gives
the cost of training and of searching, relative to the physics. Each search runs SGIM-D on the fishing rod for the same
number of movements, one after the other in one process, so all numbers are from one machine in one state. Refining is
the time of a search beyond the simplex of the first line; answering is the time for one goal of an evaluation, all
goals in one batch.

Examples:
  python scripts/bench_run.py board --movements 1000
  python scripts/bench_run.py board --movements 50000 --environment planar-arm-7     a long run, hardly any physics
  python scripts/bench_run.py model                                                  some minutes
  python scripts/bench_run.py model --movements 1000 --search gradient
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from options import at_least
from sgimd_torch.board.writer import read_events
from sgimd_torch.catalogue import CATALOGUE, ROD
from sgimd_torch.runs import command_line
from sgimd_torch.runs.board import RunBoard
from sgimd_torch.runs.build import build
from sgimd_torch.runs.chosen import part_of
from sgimd_torch.runs.config import Config
from sgimd_torch.session import live, run
from sgimd_torch.spaces import Array, Estimate
from sgimd_torch.strategies import GoalBabbling

HEAD = f"{'search':22}{'physics (s)':>12}{'training':>10}{'refining':>10}{'together':>10}{'answering (ms)':>16}"


class Clock:
    """Processor time (s) within what it wraps; a call within a call counts once."""

    def __init__(self) -> None:
        self.seconds, self._running = 0.0, False

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """``function``, timed."""

        def timed(*arguments: Any, **options: Any) -> Any:
            if self._running:
                return function(*arguments, **options)
            self._running, begun = True, time.process_time()
            try:
                return function(*arguments, **options)
            finally:
                self._running = False
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


def board(options: argparse.Namespace) -> int:
    """Time a run with a board, and print a line."""
    clock, begun = Clock(), time.process_time()
    watched: Any = RunBoard
    for name in ("__init__", "episode", "evaluation", "begin", "flush", "finish", "__exit__"):
        setattr(watched, name, clock.around(getattr(watched, name)))
    with tempfile.TemporaryDirectory() as folder:
        given = {"movements": options.movements, "seed": options.seed, "environment": options.environment}
        words = [f"--{name}={value}" for name, value in given.items()]
        if code := command_line.main([*words, f"--out={folder}", "--board=true"]):
            return code
        rest = time.process_time() - begun - clock.seconds
        (path,) = Path(folder).rglob("events.out.tfevents.*")
        tags = {value.tag for event in read_events(path) for value in event.summary.value}
        size = path.stat().st_size
    print(
        f"{options.movements} movements: board {clock.seconds:.2f} s, the run without it {rest:.2f} s, "
        f"{100 * clock.seconds / rest:.1f} %; {len(tags)} tags, {size / 1e6:.2f} MB"
    )
    return 0


def model(options: argparse.Namespace) -> int:
    """Time a run with each search, and print a line for each."""
    torch.set_num_threads(1)
    print(f"{options.movements} movements, seed {options.seed}, {options.training:g} steps each")
    print(f"training, refining and both over physics\n{HEAD}")
    simplex = 0.0
    for search in ("nelder-mead", *([options.search] if options.search else searches())):
        physics, training, searching, answering = measure(search, options.movements, options.seed, options.training)
        simplex = simplex or searching
        shares = training / physics, (searching - simplex) / physics, (training + searching - simplex) / physics
        print(
            f"{search:22}{physics:12.1f}" + "".join(f"{share:10.3f}" for share in shares) + f"{1000 * answering:16.1f}"
        )
    return 0


def measure(search: str, movements: int, seed: int, steps: float) -> tuple[float, float, float, float]:
    """Seconds of physics, training and searching, and of answering a goal."""
    chosen = {"search": search, "inverse": "model", "model.rate": steps}
    parts = build(Config(movements=movements, seed=seed, parts=chosen))
    physics, training, searching, answering = Clock(), Clock(), Clock(), Clock()
    autonomous, model, memory = parts.learner.autonomous, parts.model, parts.learner.memory
    assert isinstance(autonomous, GoalBabbling)
    assert model is not None
    autonomous.search = searching.through(autonomous.search)
    refresh, execute = training.around(model.refresh), physics.around(live(parts.environment, seed))
    lives = run(parts.learner, parts.environment, seed, movements=movements, teacher=parts.teacher, execute=execute)
    for episode in tqdm(lives, total=movements, desc=search, unit="movement", leave=False, disable=None):
        refresh(memory, episode.move.goal if episode.move else None)
    goals, contexts = parts.benchmark.goals, parts.environment.contexts
    answering.around(parts.inverse.many)((contexts.low + contexts.high) / 2, goals)  # type: ignore[attr-defined]
    return physics.seconds, training.seconds, searching.seconds, answering.seconds / len(goals)


def searches() -> list[str]:
    """The searches through the model."""
    return [word for word in CATALOGUE["search"] if "model" in part_of("search", "search", word).takes]


def main() -> int:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True, metavar="board | model")
    for part, movements in ((board, 1000), (model, 5000)):
        command = commands.add_parser(part.__name__, help=part.__doc__)
        command.set_defaults(part=part)
        command.add_argument("--movements", type=at_least(200), default=movements, help="of a run (%(default)s)")
        command.add_argument("--seed", type=at_least(0), default=1000, help="of a run (%(default)s)")
        if part is board:
            command.add_argument("--environment", default=ROD, help="of the run (%(default)s)")
        else:
            command.add_argument(
                "--training",
                type=float,
                default=Config(parts={"inverse": "model"})["model.rate"],
                help="steps a movement (%(default)g)",
            )
            command.add_argument("--search", choices=searches(), help="only this one and the simplex")
    options = parser.parse_args()
    code: int = options.part(options)
    return code


if __name__ == "__main__":
    sys.exit(main())
