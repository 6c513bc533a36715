"""Make the shipped goals and demonstrations of the swimmer (gymnasium's Swimmer-v5).

Goals: the script executes random movements, cuts T into tiles, and draws one goal in each tile that was reached twice.
Demonstrations: in a simulated recording the swimmer moves like a snake. A wave of torques travels along the body,
forwards or backwards, and a constant torque steers. Added noise keeps recordings from being exact sinusoids. All
recordings have the same start, without noise. The script makes many recordings, and keeps some whose outcomes spread
evenly.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from jsonargparse.typing import NonNegativeInt, PositiveInt
from tqdm import tqdm

from make_demonstrations import farthest_points
from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.environments.swimmer import STEPS, Swimmer
from sgimd_torch.evaluation import Benchmark, save_benchmark, tile_goals
from sgimd_torch.spaces import Array, Demonstration, stream

DATA = Path(__file__).resolve().parents[1] / "sgimd_torch" / "data"
SIDE = 0.15  # side of a tile (m)
SHAKE = 0.05  # standard deviation of the noise in recordings, relative to half the range of a torque


def wave(rng: np.random.Generator, times: Array) -> Array:
    """Torques ``(n_times, 2)``: a sinusoid in each joint, the second a quarter of a period earlier or later."""
    strength, frequency, steer = rng.uniform(0.2, 1.0), rng.uniform(0.3, 1.2), rng.uniform(-0.4, 0.4)
    lag, start = rng.choice([-0.25, 0.25]), rng.random()
    phases = frequency * times[:, None] + start + np.array([0.0, lag])
    shaking = sum(
        rng.normal(0, SHAKE / 2, (1, 2)) * np.sin(2 * np.pi * (f * times[:, None] + rng.random((1, 2))))
        for f in (1.7, 2.9, 4.3, 6.1)
    )
    return np.clip(strength * np.sin(2 * np.pi * phases) + steer + shaking, -1.0, 1.0)


def main() -> None:
    """Write the goals and the demonstrations."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=DATA, help="folder of both files (default: the shipped ones)")
    parser.add_argument("--movements", type=PositiveInt, default=2500, help="random movements (default: %(default)s)")
    parser.add_argument("--candidates", type=PositiveInt, default=600, help="recordings made (default: %(default)s)")
    parser.add_argument("--n", type=PositiveInt, default=100, help="demonstrations (default: %(default)s)")
    parser.add_argument("--seed", type=NonNegativeInt, default=2015, help="seed of all draws (default: %(default)s)")
    options = parser.parse_args()
    if options.n > options.candidates:
        parser.error(f"--n must be at most --candidates, {options.candidates}, got {options.n}")
    still, rng = Swimmer(start=0.0), stream(options.seed, "teacher of the swimmer")
    times = still.dt * np.arange(STEPS, dtype=np.float64)
    shown = []
    for _ in tqdm(range(options.candidates), desc="recording"):
        torques = wave(rng, times)
        shown.append(Demonstration(np.zeros(0), times, torques, still.replay(times, torques)))
    chosen = farthest_points(np.stack([each.outcome for each in shown]), options.n)
    save_demonstrations(options.out / "swimmer_demonstrations.npz", [shown[row] for row in chosen])

    swimmer, rng = Swimmer(), stream(options.seed, "random movements")
    reached = [
        swimmer.execute(np.zeros(0), swimmer.policies.sample(rng), rng)
        for _ in tqdm(range(options.movements), desc="tiling")
    ]
    goals = tile_goals(np.stack(reached), swimmer.outcomes, SIDE, stream(options.seed, "goals"))
    save_benchmark(options.out / "swimmer_benchmark.npz", Benchmark("Swimmer", goals, SIDE))
    print(f"{len(chosen)} demonstrations, {len(goals)} goals: {options.out}")


if __name__ == "__main__":
    main()
