"""Check the physics of the fishing rod: stability, smoothness, motor noise, and the places where the float lands.

The script prints a line for each property with its bound; the exit code is 1 if a bound is not met.
"""

from __future__ import annotations

import argparse

import numpy as np
from jsonargparse.typing import PositiveInt
from tqdm import tqdm

from sgimd_torch.environments.fishing_rod import FishingRod
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.evaluation import load_benchmark
from sgimd_torch.spaces import Array, stream

SEED = 1
BATCH = 500
FINEST = 0.0005  # s, a time step much shorter than that of the shipped model


def execute(rod: FishingRod, thetas: Array, name: str, start: int = 0) -> Array:
    """Landings ``(n, 2)`` m; each movement has its own stream of noise."""
    rngs = [stream(SEED, name, start + row) for row in range(len(thetas))]
    return rod.execute_many(np.zeros((len(thetas), 0)), thetas, rngs)


def landings(rod: FishingRod, thetas: Array, name: str) -> tuple[int, Array]:
    """The number of movements whose simulation diverges, and the landings ``(n, 2)`` m of the others."""
    diverged, landed = 0, []
    for start in tqdm(range(0, len(thetas), BATCH), desc=f"{name} movements", unit_scale=BATCH, unit="movement"):
        batch = thetas[start : start + BATCH]
        try:
            landed.append(execute(rod, batch, name, start))
        except SimulationError:
            for row, theta in enumerate(batch):
                try:
                    landed.append(execute(rod, theta[None], name, start + row))
                except SimulationError as error:
                    diverged += 1
                    print(error)
    return diverged, np.concatenate(landed)


def at_time_step(step: float) -> FishingRod:
    """A rod without noise whose physics takes steps of ``step`` seconds."""
    rod = FishingRod(noise=0.0)
    rod.model.opt.timestep = rod._caster.timestep = step
    return rod


def main() -> int:
    """Measure all properties, compare them with their bounds, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--movements", type=PositiveInt, default=100_000, help="number of movements (default: 100000)")
    movements: int = parser.parse_args().movements
    rod, still = FishingRod(), FishingRod(noise=0.0)

    thetas = stream(SEED, "smoothness").random((500, 25))
    steps = stream(SEED, "steps").normal(0, 0.005, thetas.shape)
    moved = execute(still, np.clip(thetas + steps, 0, 1), "none") - execute(still, thetas, "none")
    smoothness = float(np.median(np.linalg.norm(moved, axis=1)))

    apart = execute(at_time_step(FINEST), thetas[:200], "none") - execute(still, thetas[:200], "none")
    coarseness = float(np.median(np.linalg.norm(apart, axis=1)))

    repeated = execute(rod, np.repeat(thetas[:200], 20, axis=0), "repeat").reshape(200, 20, 2)
    deviations = repeated.std(axis=1, ddof=1)
    ordered = np.sort(deviations.mean(axis=1))
    spread = float(ordered[-20:].mean() / ordered[:20].mean())
    # If the outcomes of all movements scattered with one Gaussian distribution, the kurtosis would be 3.
    pooled = ((repeated - repeated.mean(axis=1, keepdims=True)) / deviations.mean()).ravel()
    kurtosis = float((pooled**4).mean() / (pooled**2).mean() ** 2)

    random = stream(SEED, "thetas").random((movements, 25))
    diverged, landed = landings(rod, random, "random")
    diverged_corners, _ = landings(rod, random[: movements // 10].round(), "corner")
    benchmark = load_benchmark()

    def tiles(points: Array) -> Array:
        return np.floor((points - rod.outcomes.low) / benchmark.side).astype(int)

    cells, counts = np.unique(tiles(landed), axis=0, return_counts=True)
    natural = rod.outcomes.low + (cells[counts.argmax()] + 0.5) * benchmark.side
    share = {tuple(cell): count / len(landed) for cell, count in zip(cells, counts, strict=True)}
    rare = float(np.mean([share.get(tuple(cell), 0.0) < 0.001 for cell in tiles(benchmark.goals)]))

    sd = float(deviations.mean())
    off = float(np.linalg.norm(natural - [0.0, 0.5]))
    rows = [
        (f"{diverged} of {movements} uniform random movements diverged", "0", diverged == 0),
        (f"{diverged_corners} of {movements // 10} at random corners of Pi diverged", "0", diverged_corners == 0),
        (f"a change of theta, sd .005, moves landings by {smoothness:.4f} m (median)", "<= .03", smoothness <= 0.03),
        (
            f"a time step of {1e3 * FINEST:g} ms moves landings by {coarseness:.4f} m (median)",
            "<= .02",
            coarseness <= 0.02,
        ),
        (f"landings scatter with sd {sd:.4f} m (mean)", ".03 to .075", 0.03 <= sd <= 0.075),
        (f"outcome_noise is {rod.outcome_noise:.4f} m", "within 10 %", abs(rod.outcome_noise / sd - 1) <= 0.1),
        (f"the noisiest tenth scatters {spread:.1f} times as much as the least noisy", ">= 5", spread >= 5),
        (f"kurtosis of the pooled noise {kurtosis:.1f}", "> 4, a Gaussian has 3", kurtosis > 4),
        (f"densest tile at ({natural[0]:.2f}, {natural[1]:.2f}), {off:.2f} m from (0, .5)", "<= .25", off <= 0.25),
        (f"{100 * rare:.0f} % of benchmark tiles get < .1 % of random movements", ">= 33 %", rare >= 1 / 3),
    ]
    for measured, wanted, good in rows:
        print(f"{'ok  ' if good else 'MISS'} {measured:72s} wanted: {wanted}")
    return 0 if all(good for *_, good in rows) else 1


if __name__ == "__main__":
    raise SystemExit(main())
