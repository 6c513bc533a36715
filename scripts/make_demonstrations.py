"""Make the shipped demonstrations of demonstrator 3: simulated kinesthetic recordings on the fishing rod.

The paper's demonstrator 3 was a person who led the arm by hand. These recordings are *simulated*, with the properties
that the paper describes: every joint moves monotonically from the start to an end posture, and all joints follow one
scaled curve. ``end_posture`` gives the end postures, to which random deviations are added. Recordings are chosen so
that outcomes spread evenly over the plane. The speed varies smoothly, so no recording is exactly a motor primitive.
"""

from __future__ import annotations

import argparse

import numpy as np
from jsonargparse.typing import NonNegativeInt, Path_fc, PositiveInt
from tqdm import tqdm

from sgimd_torch.demonstrations import SHIPPED, save_demonstrations
from sgimd_torch.environments.fishing_rod import JOINT_RANGES, FishingRod
from sgimd_torch.spaces import Array, Demonstration, stream

RATE = 50  # Hz, sampling rate
DURATIONS = (1.0, 1.4)  # s, shortest and longest recording
HAND = 0.04  # rad, standard deviation of end postures
TREMOR = 0.4  # standard deviation of the speed, relative to the speed


def end_posture(turn: float, stretch: float) -> Array:
    """End posture ``(6,)`` rad: ``turn`` in [-1, 1] goes from right to left, ``stretch`` in [-1, 1] from far behind to
    far ahead. Yaw and wrist make the turn; shoulder, elbow and wrist make the stretch."""
    middle = (JOINT_RANGES.low + JOINT_RANGES.high) / 2
    sideways = np.array([1.5, 0.0, 0.0, 0.0, 0.0, 1.2])
    ahead = np.array([0.0, -0.65, 0.1, 0.0, -0.75, 0.0])
    return JOINT_RANGES.clip(middle + turn * sideways + stretch * ahead)


def lead(end: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Times ``(n,)`` s and angles ``(n, 6)`` rad, at ``RATE``, of the arm led from the start to the posture ``end``."""
    start = (JOINT_RANGES.low + JOINT_RANGES.high) / 2
    n = round(rng.uniform(*DURATIONS) * RATE) + 1
    times = np.arange(n) / RATE
    phase = times / times[-1]
    pace = (phase * (1 - phase)) ** 2  # minimum jerk: bell-shaped speed
    waver = sum(
        rng.normal(0, TREMOR / 2, (1, 6)) * np.sin(2 * np.pi * (f * times[:, None] + rng.random((1, 6))))
        for f in (2.0, 3.5, 5.0, 7.0)
    )
    speed = pace[:, None] * np.maximum(1 + waver, 0.1)  # never backwards, so that the movement is monotone
    share = np.concatenate([np.zeros((1, 6)), np.cumsum((speed[1:] + speed[:-1]) / 2, axis=0)])
    return times, start + share / share[-1] * (end - start)


def farthest_points(points: Array, n: int) -> list[int]:
    """Rows of ``n`` spread ``points``: first the point nearest to the mean, then always the point farthest from all
    chosen ones."""
    chosen = [int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmin())]
    distances = np.full(len(points), np.inf)
    while len(chosen) < n:
        distances = np.minimum(distances, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(distances.argmax()))
    return chosen


def main() -> None:
    """Make many recordings, and keep some whose outcomes spread evenly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path_fc, default=SHIPPED, help="file to write (default: the shipped one)")
    parser.add_argument("--n", type=PositiveInt, default=127, help="demonstrations (default: 127, as in the paper)")
    parser.add_argument("--candidates", type=PositiveInt, default=4000, help="recordings made (default: %(default)s)")
    parser.add_argument("--seed", type=NonNegativeInt, default=2014, help="seed of all draws (default: %(default)s)")
    options = parser.parse_args()
    if options.n > options.candidates:
        parser.error(f"--n must be at most --candidates, {options.candidates}, got {options.n}")
    rod, rng = FishingRod(noise=0.0), stream(options.seed, "demonstrator 3")
    recordings: list[Demonstration] = []
    for _ in tqdm(range(options.candidates), desc="recording"):
        end = JOINT_RANGES.clip(end_posture(*rng.uniform(-1, 1, 2)) + rng.normal(0, HAND, 6))
        times, trajectory = lead(end, rng)
        outcome = rod.replay(times, trajectory)
        if rod.outcomes.contains(outcome):
            recordings.append(Demonstration(np.zeros(0), times, trajectory, outcome))
    if options.n > len(recordings):
        parser.error(f"only {len(recordings)} recordings land inside T, fewer than --n {options.n}; more --candidates?")
    chosen = farthest_points(np.stack([recording.outcome for recording in recordings]), options.n)
    save_demonstrations(options.out, [recordings[row] for row in chosen])
    print(f"{len(chosen)} demonstrations of {len(recordings)} recordings inside T: {options.out}")


if __name__ == "__main__":
    main()
