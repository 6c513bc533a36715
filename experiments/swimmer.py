"""Gymnasium's Swimmer-v5 as a task: a swimmer of three links travels for 6 seconds.

theta: amplitude, phase and offset of a sinusoid for each of the two joints, and their frequency. The outcome is the
distance travelled (m), along x and y. The noise is a small random change of posture and speeds at the start.
    sgimd run --environment experiments.swimmer:swimmer          # in the root folder of the repository
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from sgimd_torch.extras.gymnasium.controllers import Sinusoids
from sgimd_torch.extras.gymnasium.from_gymnasium import FromGymnasium, gymnasium
from sgimd_torch.spaces import Array, Box
from sgimd_torch.tasks import Task

DATA: Final = Path(__file__).with_name("data")
STEPS: Final = 150  # number of actions of a movement, .04 s each
FREQUENCIES: Final = (0.2, 2.0)  # lowest and highest (Hz)
START: Final = 0.02  # largest random change of positions (m, rad) and speeds (m/s, rad/s) at the start
NOISE: Final = 0.015  # m, measured by `measured_noise`


class Swimmer(FromGymnasium):
    """theta in [0, 1]^7 -> distance travelled (m), along x and y.

    Args:
        start: largest random change of positions (m, rad) and speeds (m/s, rad/s) at the start; 0 for no noise.
    """

    def __init__(self, *, start: float = START) -> None:
        super().__init__(
            gymnasium.make(
                "Swimmer-v5",
                reset_noise_scale=start,
                exclude_current_positions_from_observation=False,
                disable_env_checker=True,  # the checker costs time
            ),
            Sinusoids(Box.cube(-1.0, 1.0, 2), FREQUENCIES),
            outcomes=Box.cube(-1.5, 1.5, 2, names=("x", "y"), unit="m"),
            rest=np.zeros(2),
            outcome_noise=NOISE * start / START,
            steps=STEPS,
            outcome=travelled,
        )


def travelled(observations: Sequence[Any]) -> Array:
    """``(2,)`` m, distance along x and y from the first observation to the last; an observation begins with x and y."""
    return np.asarray(observations[-1][:2] - observations[0][:2], dtype=np.float64)


def swimmer() -> Task:
    """The swimmer with its shipped goals and demonstrations; a demonstration is a sequence of torques."""
    return Task(Swimmer(), DATA / "swimmer_benchmark.npz", DATA / "swimmer_demonstrations.npz")
