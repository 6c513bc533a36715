"""Make benchmark goals from runs: one random goal in each tile of T that the runs reached (section 5.2 of the paper).

T is cut into tiles. A tile counts as reached if at least two movements of all runs together landed in the tile. Use
several learners, because goals made from only one learner favour that learner. Use seeds that no comparison uses.

  sgimd sweep --environment mypackage.toss:make --vary algorithm=random,sagg-riac --seeds 2000-2003 --out pool
  sgimd benchmark pool --out goals.npz
  sgimd run --environment mypackage.toss:make --algorithm sagg-riac --benchmark goals.npz

  sgimd benchmark pool --out goals.npz --tiles 100      fewer goals, so evaluations are faster
  sgimd benchmark pool/random/seed-2000 more --out goals.npz

The side of the tiles is chosen so that about --tiles goals are made. In the plane the side is between 1/40 and 1/10 of
the sides of T. The file names the class of the environment, and runs of other environments refuse the file.

Exit code: 0 the file was written, 2 the request is wrong and nothing was written.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sgimd_torch.evaluation import TILES, Benchmark, save_benchmark, tile_goals, tile_side, tile_sides
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import parser_of
from sgimd_torch.runs.read import Run, find_runs, read_run
from sgimd_torch.spaces import Box, check_count, stream


def main(argv: Sequence[str] | None = None) -> int:
    """Write the goals and return the exit code 0.

    Raises:
        ValueError: there are no runs, the runs have several environments, or no tile was reached.
        OSError: a file cannot be read or written.
    """
    options = _options(argv)
    paths = [
        path for folder in options.runs for paths_of_variant in find_runs(folder).values() for path in paths_of_variant
    ]
    runs = [read_run(path) for path in dict.fromkeys(paths)]
    name, box = _reached_by(runs)
    outcomes = np.concatenate([run.outcomes[np.isfinite(run.outcomes).all(axis=1)] for run in runs])
    side = tile_side(outcomes, box, options.tiles)
    goals = tile_goals(outcomes, box, side, stream(options.seed, "benchmark"))
    tile = box.amount(side, ".4g")
    if not len(goals):
        inside = int(box.contains(outcomes).sum())
        raise ValueError(
            f"no tile of {tile} was reached twice: {inside} of {len(outcomes)} movements ended in T; make longer runs, "
            "or choose fewer --tiles"
        )
    save_benchmark(options.out, Benchmark(name, goals, side))
    n, made = len(goals), f"{len(outcomes)} movements of {len(runs)} run{'s' * (len(runs) > 1)}"
    print(f"{n} goals, on tiles of {tile} reached by {made}: {options.out}")
    (finest, *_, largest), asked = tile_sides(outcomes, box), f"{options.tiles} goals were requested, and {n} made"
    if n > 2 * options.tiles and side > 0.9 * largest:
        say(f"{asked}: no tiles are larger than {box.amount(largest)}; runs that reach less of T give fewer")
    elif n < options.tiles / 2 and side < 1.1 * finest:
        least = box.amount(finest)
        say(f"{asked}: no tiles are smaller than {least}; a smaller T or runs that reach more of it give more")
    elif n < options.tiles / 2:
        say(f"{asked}: tiles smaller than {tile} were seldom reached twice; longer runs give more")
    return 0


def _reached_by(runs: Sequence[Run]) -> tuple[str, Box]:
    """The name of the class of the environment of all runs, and the T of this environment.

    Raises:
        ValueError: the runs have different environments.
    """
    run_of: dict[str, Run] = {}
    for run in runs:
        space = run.spaces["outcomes"]
        run_of.setdefault(f"{run.robot}, {space.low.tolist()} to {space.high.tolist()}", run)
    if len(run_of) > 1:
        apart = ", ".join(f"{run.path} is of {words}" for words, run in run_of.items())
        raise ValueError(f"all runs must be of one environment with one T: {apart}; make one file for each of them")
    return runs[0].robot, runs[0].spaces["outcomes"]


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd benchmark``."""
    parser = parser_of("benchmark", __doc__)
    parser.add_argument(
        "runs", type=Path, nargs="+", metavar="RUNS", help="folder of a run, of a variant or of variants"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="FILE", help="file of goals to write, .npz")
    parser.add_argument("--tiles", type=int, default=TILES, help="approximate number of goals (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the draw within tiles (default: %(default)s)")
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    options = parser().parse_args(argv)
    check_count("--tiles", options.tiles, 1)
    check_count("--seed", options.seed, 0)
    if options.out.suffix != ".npz" or options.out.is_dir() or not options.out.parent.is_dir():
        raise ValueError(f"--out must be a .npz file in a folder that exists, got {options.out}")
    return options
