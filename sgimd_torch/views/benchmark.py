"""Goals of evaluation, made from runs: one goal in each tile of T that they reached, as in section 5.2 of the paper.

T is cut into tiles. A tile counts as reachable if at least two movements of all runs together landed in it, and a goal
is drawn in it at random. So a goal is near what some learner has reached. Take several learners and seeds, or the goals
favour the one that made them, and seeds that no comparison uses later.

  sgimd sweep --environment mypackage.toss:make --vary algorithm=random,sagg-riac --seeds 2000-2003 --out pool
  sgimd benchmark pool --out goals.npz
  sgimd run --environment mypackage.toss:make --algorithm sagg-riac --benchmark goals.npz

  sgimd benchmark pool --out goals.npz --tiles 100      fewer goals: an evaluation takes as long as they are many
  sgimd benchmark pool --out goals.npz --side 0.1       tiles of this side, in the unit of T
  sgimd benchmark pool/random/seed-2000 more --out goals.npz

Without --side, it is chosen so that there are about --tiles goals: a fortieth to a tenth of T's sides in the plane.
The file names the class of the environment: a run of another one refuses it.

Exit code: 0 the file was written, 2 the request is wrong; nothing is written then.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.evaluation import TILES, Benchmark, save_benchmark, tile_goals, tile_side
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import say
from sgimd_torch.runs.read import Run, config_of, find_runs, read_run
from sgimd_torch.spaces import Array, Box, check_count, stream


def main(argv: Sequence[str] | None = None) -> int:
    """Write the goals; the exit code, 0.

    Raises:
        ValueError: no runs, runs of several environments, or no tile was reached.
        OSError: a file cannot be read or written.
    """
    options = _options(argv)
    paths = [path for place in options.runs for found in find_runs(place).values() for path in found]
    runs = [read_run(path) for path in dict.fromkeys(paths)]
    name, box = _reached_by(runs)
    outcomes = np.concatenate([run.outcomes[np.isfinite(run.outcomes).all(axis=1)] for run in runs])
    benchmark = from_outcomes(
        outcomes, name, box, seed=options.seed, side=options.side, tiles=options.tiles, at_least=options.at_least
    )
    save_benchmark(options.out, benchmark)
    say(*(f"{run.path}: {file} is damaged at line {line}" for run in runs for file, line in run.damage.items()))
    n = len(benchmark.goals)
    made = f"{len(outcomes)} movements of {len(runs)} run{'s' * (len(runs) > 1)}"
    print(f"{n} goals, on tiles of {benchmark.side:.4g} reached by {made}: {options.out}")
    if options.side is None and n < options.tiles / 2:
        say(f"{n} goals are few, {options.tiles} were wanted; longer runs, or --at-least 1, give more")
    return 0


def from_outcomes(
    outcomes: Array, name: str, box: Box, *, seed: int, side: float | None, tiles: int, at_least: int
) -> Benchmark:
    """A goal in each tile that ``outcomes`` ``(n, outcome_dim)`` reached.

    Args:
        outcomes: of several runs together.
        name: of the class of their environment.
        box: its T.
        seed: of the draw.
        side: of a tile, in the unit of T; None for about so many ``tiles``.
        tiles: about how many.
        at_least: outcomes in a tile for it to be reachable.

    Raises:
        ValueError: no tile was reached, or a tile is larger than T.
    """
    if side is None:
        side = tile_side(outcomes, box, tiles, at_least=at_least)
    elif side > box.sides.max():
        raise ValueError(f"--side must be at most {box.sides.max():g}, the longest side of T, got {side:g}")
    goals = tile_goals(outcomes, box, side, stream(seed, "benchmark"), at_least=at_least)
    if not len(goals):
        inside = int(box.contains(outcomes).sum())
        raise ValueError(
            f"no tile of {side:.4g} was reached {at_least} times: {inside} of {len(outcomes)} movements ended in T; "
            "longer runs, a larger --side, or --at-least 1?"
        )
    return Benchmark(name, goals, side)


def _reached_by(runs: Sequence[Run]) -> tuple[str, Box]:
    """The class of the environment of all runs, and its T."""
    found: dict[str, tuple[Run, str, Box]] = {}
    for run in runs:
        config = config_of(run)
        options = {name: value for name, value in config.settings.items() if name.partition(".")[0] == "environment"}
        if str(options) not in found:
            robot = task_of(config).environment
            found[str(options)] = run, type(robot).__name__, robot.outcomes
    (first, name, box), *others = found.values()
    for run, other, space in others:
        if other != name or (space.low.tolist(), space.high.tolist()) != (box.low.tolist(), box.high.tolist()):
            raise ValueError(
                f"all runs must be of one environment with one T: {first.path} is of {_in_words(name, box)}, "
                f"{run.path} of {_in_words(other, space)}; make a benchmark for each"
            )
    wrong = next((run for run in runs if len(run.index) and run.outcomes.shape[1] != box.dim), None)
    if wrong is not None:
        raise RunError(f"{wrong.path} has outcomes of {wrong.outcomes.shape[1]} dimensions, {name} has {box.dim} today")
    return name, box


def _in_words(name: str, box: Box) -> str:
    return f"{name}, {box.low.tolist()} to {box.high.tolist()}"


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd benchmark``."""
    parser = argparse.ArgumentParser(
        prog="sgimd benchmark", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUN", help="a run's directory, a variant's folder, or an --out of runs"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="the goals, .npz")
    size = parser.add_mutually_exclusive_group()
    size.add_argument("--side", type=float, help="of a tile, in the unit of T (default: what leaves --tiles goals)")
    size.add_argument("--tiles", type=int, default=TILES, help="about how many goals (default: %(default)s, as paper)")
    parser.add_argument(
        "--at-least", type=int, default=2, metavar="N", help="movements in a tile that counts (default: %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the draw within tiles (default: %(default)s)")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    options = parser().parse_args(argv)
    for option, least in (("tiles", 1), ("at_least", 1), ("seed", 0)):
        check_count(f"--{option.replace('_', '-')}", getattr(options, option), least)
    if options.side is not None and not 0 < options.side < np.inf:
        raise ValueError(f"--side must be a positive number, got {options.side:g}")
    if options.out.suffix != ".npz" or options.out.is_dir() or not options.out.parent.is_dir():
        raise ValueError(f"--out must be a .npz file in a folder that exists, got {options.out}")
    return options
