"""Make the shipped demonstrations of demonstrators 1 and 2, robots that have learnt alone by SAGG-RIAC.

Section 5.3 of the paper. The script runs several SAGG-RIAC learners on the fishing rod and puts their memories
together. Demonstrator 1 is naive: it shows random exemplars. Demonstrator 2 is careful: it chooses tiles of T that
spread evenly, and executes the exemplars of each tile several times. On each tile it shows the exemplar with the least
scatter of landings. Recordings are joint trajectories, as for demonstrator 3, so the learner has to find theta_d.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from jsonargparse.typing import NonNegativeInt, Path_dw, PositiveInt

from make_benchmark import pooled
from make_demonstrations import farthest_points
from sgimd_torch.demonstrations import SHIPPED, save_demonstrations
from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.protocol import execute_many
from sgimd_torch.spaces import Array, Demonstration, stream

CANDIDATES = 10  # largest number of exemplars that demonstrator 2 compares on a tile
EXECUTIONS = 10  # number of executions of each exemplar


def demonstrate(rod: FishingRod, theta: Array, outcome: Array) -> Demonstration:
    """A demonstration: the commanded trajectory of ``theta`` at 50 Hz, with the remembered ``outcome``."""
    return Demonstration(np.zeros(0), *rod.primitive.trajectory(theta), outcome)


def on_tiles(outcomes: Array, n: int) -> list[np.ndarray]:
    """Rows of ``outcomes`` ``(m, 2)`` m in each tile; tiles have a side at which about 1.1 n tiles are not empty."""
    side = min(np.linspace(0.05, 0.4, 141), key=lambda side: abs(len(np.unique(outcomes // side, axis=0)) - 1.1 * n))
    _, tile_of = np.unique(outcomes // side, axis=0, return_inverse=True)
    return [np.flatnonzero(tile_of == tile) for tile in range(tile_of.max() + 1)]


def execute_again(rod: FishingRod, thetas: Array, rng: np.random.Generator) -> Array:
    """Landings ``(EXECUTIONS, n, 2)`` m of ``thetas`` ``(n, theta_dim)``, each time with different motor noise."""
    copies = np.tile(thetas, (EXECUTIONS, 1))
    rngs = [stream(int(rng.integers(2**32)), "re-execution", k) for k in range(len(copies))]
    return execute_many(rod, np.zeros((len(copies), 0)), copies, rngs).reshape(EXECUTIONS, len(thetas), 2)


def most_reliable(landed: Array) -> tuple[int, Array]:
    """The column of ``landed`` ``(n_executions, n, 2)`` m that varies least, and the landing nearest to its mean."""
    best = int(landed.var(axis=0).sum(axis=1).argmin())
    typical = np.linalg.norm(landed[:, best] - landed[:, best].mean(axis=0), axis=1).argmin()
    return best, landed[typical, best]


def careful(rod: FishingRod, thetas: Array, outcomes: Array, n: int, rng: np.random.Generator) -> list[Demonstration]:
    """Demonstrations on ``n`` evenly spread tiles: the most reliable of several exemplars on each tile.

    Raises:
        ValueError: too few tiles were reached.
    """
    tiles = [rng.permutation(rows)[:CANDIDATES] for rows in on_tiles(outcomes, n)]
    landed = execute_again(rod, thetas[np.concatenate(tiles)], rng)
    shown = []
    for rows, again in zip(tiles, np.split(landed, np.cumsum([len(rows) for rows in tiles])[:-1], axis=1), strict=True):
        best, outcome = most_reliable(again)
        if rod.outcomes.contains(outcome):
            shown.append(demonstrate(rod, thetas[rows[best]], outcome))
    if len(shown) < n:
        raise ValueError(f"only {len(shown)} tiles have a movement to show, too few for --n {n}; more --movements?")
    chosen = farthest_points(np.stack([demonstration.outcome for demonstration in shown]), n)
    return [shown[k] for k in chosen]


def main() -> None:
    """Run the learners, then choose the demonstrations of both demonstrators."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path_dw, default=SHIPPED.parent, help="folder of both files (default: shipped)")
    parser.add_argument("--n", type=PositiveInt, default=127, help="demonstrations by each (default: %(default)s)")
    parser.add_argument("--runs", type=PositiveInt, default=4, help="SAGG-RIAC learners (default: %(default)s)")
    parser.add_argument("--movements", type=PositiveInt, default=5000, help="length of a run (default: %(default)s)")
    parser.add_argument("--seed", type=NonNegativeInt, default=4000, help="first seed (default: %(default)s)")
    parser.add_argument("--processes", type=PositiveInt, default=2, help="runs at a time (default: %(default)s)")
    options = parser.parse_args()
    learners = [("sagg-riac", options.seed + k) for k in range(options.runs)]
    thetas, outcomes = pooled(learners, options.movements, options.processes)
    rod = FishingRod()
    inside = rod.outcomes.contains(outcomes)
    thetas, outcomes = thetas[inside], outcomes[inside]
    if len(thetas) < options.n:
        parser.error(f"only {len(thetas)} movements landed inside T, fewer than --n {options.n}; more --movements?")
    rows = stream(options.seed, "demonstrator 1").choice(len(thetas), options.n, replace=False)
    naive = [demonstrate(rod, thetas[row], outcomes[row]) for row in rows]
    try:
        shown = {1: naive, 2: careful(rod, thetas, outcomes, options.n, stream(options.seed, "demonstrator 2"))}
    except ValueError as error:
        parser.error(str(error))
    for number, demonstrations in shown.items():
        path = Path(options.out) / f"demonstrator_{number}.npz"
        save_demonstrations(path, demonstrations)
        print(f"{len(demonstrations)} demonstrations: {path}")


if __name__ == "__main__":
    main()
