"""Make the benchmark set: one goal in each tile that several learners reached together (section 5.2 of the paper).

Random, SAGG-RIAC and SGIM-D are run with several seeds each, and their landing points are put together. The side of the
tiles is chosen so that about 358 of them, the paper's number, were reached. One goal is drawn at random in each.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from itertools import product

import numpy as np
from tqdm import tqdm

from options import at_least, writable_file
from sgimd_torch.algorithms import random_exploration, sagg_riac, sgim_d
from sgimd_torch.demonstrations import load_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.evaluation import SHIPPED, Benchmark, save_benchmark, tile_goals
from sgimd_torch.session import run
from sgimd_torch.spaces import Array, stream
from sgimd_torch.teachers import PeriodicTeacher


def memory_of(algorithm: str, seed: int, movements: int) -> tuple[Array, Array]:
    """What one learner remembers: thetas ``(movements, theta_dim)``, outcomes ``(movements, 2)`` m."""
    rod = FishingRod(threads=1)
    teacher = None
    if algorithm == "random":
        learner = random_exploration(rod, seed)
    elif algorithm == "sagg-riac":
        learner = sagg_riac(rod, seed)
    else:
        learner = sgim_d(rod, seed, correspondence=rod.primitive.correspondence)
        teacher = PeriodicTeacher(load_demonstrations(), stream(seed, "teacher"))
    for _ in run(learner, rod, seed, movements=movements, teacher=teacher):
        pass
    return learner.memory.thetas, learner.memory.outcomes


def pooled(learners: Iterable[tuple[str, int]], movements: int, processes: int) -> tuple[Array, Array]:
    """The memories of all ``learners``, each an algorithm with a seed, put together."""
    with ProcessPoolExecutor(processes) as pool:
        pending = [pool.submit(memory_of, *each, movements) for each in learners]
        memories = [future.result() for future in tqdm(pending, desc="learning")]
    thetas, outcomes = (np.concatenate(parts) for parts in zip(*memories, strict=True))
    return thetas, outcomes


def main() -> None:
    """Run the learners, tile what they reached, draw the goals and write the file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=writable_file, default=SHIPPED, help="file to write (default: the shipped one)")
    parser.add_argument(
        "--seed", type=at_least(0), default=2000, help="of the first run and of the draw (default: %(default)s)"
    )
    parser.add_argument("--runs", type=at_least(1), default=4, help="runs of each learner (default: %(default)s)")
    parser.add_argument("--movements", type=at_least(1), default=5000, help="of each run (default: %(default)s)")
    parser.add_argument("--tiles", type=at_least(1), default=358, help="about how many (default: %(default)s)")
    parser.add_argument("--processes", type=at_least(1), default=2, help="(default: %(default)s)")
    options = parser.parse_args()
    learners = product(("random", "sagg-riac", "sgim-d"), range(options.seed, options.seed + options.runs))
    _, outcomes = pooled(learners, options.movements, options.processes)
    box = FishingRod().outcomes

    def goals(side: float) -> Array:
        return tile_goals(outcomes, box, side, stream(options.seed, "benchmark"))

    side = min(np.linspace(0.05, 0.2, 301), key=lambda side: abs(len(goals(side)) - options.tiles))
    save_benchmark(options.out, Benchmark("FishingRod", goals(side), float(side)))
    print(f"{len(goals(side))} tiles of {side:.4f} m reached by {len(outcomes)} movements: {options.out}")


if __name__ == "__main__":
    main()
