"""What a board costs: its share of a run's processor time, how many tags it has, how large its file gets.

Examples:
  python scripts/bench_board.py                            SGIM-D on the rod, 1000 movements
  python scripts/bench_board.py --movements 5000
  python scripts/bench_board.py --movements 50000 --arm    on the planar arm, without physics or pictures: a long run
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "experiments"))

import numpy as np

from sgimd_torch import Demonstration, InterestMap, PeriodicTeacher, PlanarArm, evaluate, run, sgim_d, stream
from sgimd_torch.board.writer import Board, read_events
from sgimd_torch.runs import command_line as experiment
from sgimd_torch.runs.board import RunBoard
from sgimd_torch.strategies import GoalBabbling

CALLS = ("__init__", "episode", "evaluation", "begin", "flush", "finish", "__exit__")


class Clock:
    """Processor time (s) within the calls that it wraps; other processes do not count."""

    def __init__(self) -> None:
        self.seconds, self._running = 0.0, False

    def around(self, function: Callable[..., Any]) -> Callable[..., Any]:
        """``function``, timed; a call within a call counts once."""

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


def main() -> int:
    """Measure, and print a line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--movements", type=int, default=1000, help="of the run (1000)")
    parser.add_argument("--seed", type=int, default=1000, help="of the run (1000)")
    parser.add_argument("--arm", action="store_true", help="the planar arm instead of the fishing rod")
    options = parser.parse_args()
    if options.movements < 1 or options.seed < 0:
        parser.error("--movements must be at least 1, --seed at least 0")
    clock = Clock()
    watched: Any = Board if options.arm else RunBoard
    for name in CALLS:
        if name in vars(watched):
            setattr(watched, name, clock.around(getattr(watched, name)))
    with tempfile.TemporaryDirectory() as folder:
        begun = time.process_time()
        if options.arm:
            reach(Path(folder), options.movements, options.seed)
        else:
            arguments = {"--movements": options.movements, "--seed": options.seed, "--out": folder, "--board": "true"}
            code = experiment.main([f"{name}={value}" for name, value in arguments.items()])
            if code:
                return code
        total = time.process_time() - begun
        (path,) = Path(folder).rglob("events.out.tfevents.*")
        tags = {value.tag for event in read_events(path) for value in event.summary.value}
        size = path.stat().st_size
    rest = total - clock.seconds
    print(
        f"{options.movements} movements: board {clock.seconds:.2f} s, the run without it {rest:.2f} s, "
        f"{100 * clock.seconds / rest:.1f} %; {len(tags)} tags, {size / 1e6:.2f} MB"
    )
    return 0


def reach(folder: Path, movements: int, seed: int) -> None:
    """SGIM-D on the planar arm, with a board that gets its curves and an evaluation every 1000 movements."""
    arm, rng = PlanarArm(), stream(seed, "bench")
    thetas = rng.random((50, arm.policies.dim))
    outcomes = [arm.execute(np.zeros(0), theta, rng) for theta in thetas]
    shown = [
        Demonstration(np.zeros(0), np.arange(2.0), np.stack((theta, theta)), outcome)
        for theta, outcome in zip(thetas, outcomes, strict=True)
    ]
    learner = sgim_d(arm, seed, correspondence=lambda times, trajectory: trajectory[-1])
    teacher = PeriodicTeacher(shown, stream(seed, "teacher"))
    goals = np.stack([arm.outcomes.sample(rng) for _ in range(300)])
    babbling = learner.autonomous
    assert isinstance(babbling, GoalBabbling)
    assert isinstance(babbling.goals, InterestMap)
    with Board(folder, arm.outcomes) as board:
        for episode in run(learner, arm, seed, movements=movements, teacher=teacher):
            board.episode(episode)
            if board.due:
                board.regions(babbling.goals.regions)
            if board.movements % 1000 == 0:
                found = evaluate(babbling.inverse, arm, goals, seed, board.movements, repeats=0)
                board.evaluation(goals, found.errors, found.noise_floor)


if __name__ == "__main__":
    sys.exit(main())
