"""Make the shipped benchmark: one goal in each tile of T that several learners reached together (paper, section 5.2).

The script runs Random, SAGG-RIAC and SGIM-D on the fishing rod, each with several seeds. `sgimd benchmark` then cuts T
into tiles. The side of a tile is chosen so that the learners together reached about 358 tiles, as many as in the paper.
Each of these tiles gets one random goal.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from jsonargparse.typing import NonNegativeInt, Path_fc, PositiveInt

from sgimd_torch.evaluation import SHIPPED
from sgimd_torch.options.config import Config
from sgimd_torch.runs.parallel import sweep
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.signals import Failed
from sgimd_torch.spaces import Array
from sgimd_torch.views import benchmark


def live(learners: Iterable[tuple[str, int]], movements: int, processes: int, folder: Path) -> list[Path]:
    """Carry out runs of ``learners`` (algorithm, seed) without evaluations, and return their directories, in order."""
    configs = [
        Config(algorithm=algorithm, seed=seed, movements=movements, evaluate_at=(), out=folder)
        for algorithm, seed in learners
    ]
    if failures := sweep(configs, processes):
        raise Failed("\n".join(failures))
    return [config.directory for config in configs]


def pooled(learners: Iterable[tuple[str, int]], movements: int, processes: int) -> tuple[Array, Array]:
    """Movements of all ``learners`` together: thetas ``(n, theta_dim)``, outcomes ``(n, 2)`` m."""
    with TemporaryDirectory() as folder:
        runs = [read_run(path) for path in live(learners, movements, processes, Path(folder))]
    moved = [np.isfinite(run.outcomes).all(axis=1) for run in runs]
    thetas, outcomes = (
        np.concatenate([getattr(run, name)[rows] for run, rows in zip(runs, moved, strict=True)])
        for name in ("thetas", "outcomes")
    )
    return thetas, outcomes


def main() -> None:
    """Run the learners, and make the goals from their outcomes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path_fc, default=SHIPPED, help="file to write (default: the shipped one)")
    parser.add_argument("--seed", type=NonNegativeInt, default=2000, help="first seed (default: %(default)s)")
    parser.add_argument("--runs", type=PositiveInt, default=4, help="runs of each learner (default: %(default)s)")
    parser.add_argument("--movements", type=PositiveInt, default=5000, help="length of a run (default: %(default)s)")
    parser.add_argument("--tiles", type=PositiveInt, default=358, help="wanted number of tiles (default: %(default)s)")
    parser.add_argument("--processes", type=PositiveInt, default=2, help="runs at a time (default: %(default)s)")
    options = parser.parse_args()
    learners = product(("random", "sagg-riac", "sgim-d"), range(options.seed, options.seed + options.runs))
    with TemporaryDirectory() as folder:
        live(learners, options.movements, options.processes, Path(folder))
        benchmark.main([folder, f"--out={options.out}", f"--seed={options.seed}", f"--tiles={options.tiles}"])


if __name__ == "__main__":
    main()
