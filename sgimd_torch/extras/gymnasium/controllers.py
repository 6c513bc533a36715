"""Controllers turn a theta into a sequence of commands; the controller here plays a sinusoid for each command.

A controller has ``policies``, its Pi, and ``at(theta, times)``, the commands. `GaussianPrimitive` has both, too, so it
can replace `Sinusoids`. ``correspondence`` of both translates a recording to theta, eq. (6) of Nguyen & Oudeyer (2014).
    swim = Sinusoids(actions, frequencies=(0.2, 2.0)); commands = swim.at(theta, times)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import Primitive, check_recording
from sgimd_torch.spaces import Array, Box

_GRID: Final = 200  # number of frequencies that the fit tries before it refines the best of them
STEER: Final = 0.5  # largest offset, relative to half the range of the command


class Sinusoids(Primitive):
    """One sinusoid for each command, with an amplitude, a phase and an offset; all sinusoids share one frequency.

    theta in [0, 1]^(3 n_commands + 1) holds amplitude, phase and offset command by command, then the frequency. An
    amplitude of 1 is half the range of the command; an offset moves the middle by at most a quarter of the range.
    Commands are clipped to their ranges. The phases 0 and 1 give equal commands.

    Args:
        commands: ``(n_commands,)`` box of the ranges of the commands, such as the torques of motors.
        frequencies: lowest and highest frequency (Hz).

    Raises:
        ValueError: the frequencies do not satisfy 0 < lowest < highest.
    """

    def __init__(self, commands: Box, frequencies: tuple[float, float]) -> None:
        if not 0 < frequencies[0] < frequencies[1] < np.inf:
            raise ValueError(f"frequencies must be 0 < lowest < highest in Hz, got {frequencies}")
        self.commands = self.ranges = commands
        self.frequencies = frequencies
        self.policies = Box.cube(0.0, 1.0, 3 * commands.dim + 1)

    def at(self, theta: Array, times: Array) -> Array:
        """Commands ``(n_times, n_commands)`` at ``times`` (s)."""
        amplitudes, phases, offsets = theta[:-1].reshape(-1, 3).T
        angles = 2 * np.pi * (self._frequency(theta[-1]) * times[:, None] + phases)
        waves = amplitudes * np.sin(angles) + STEER * (2 * offsets - 1)
        low, high = self.commands.low, self.commands.high
        return self.commands.clip((low + high) / 2 + (high - low) / 2 * waves)

    def correspondence(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """theta_d, the policy whose commands come nearest to the recorded commands; see `Translating`.

        The fit takes the best frequency of a grid and refines it; for a fixed frequency the fit is linear. The fit is
        exact if no command was clipped.
        """
        from scipy.optimize import minimize_scalar

        times, trajectory = check_recording(times, trajectory, self.commands.dim)
        times = np.subtract(times, times[0])
        waves = (2 * trajectory - self.commands.low - self.commands.high) / self.commands.sides

        def fit(pace: float) -> tuple[float, Array]:
            angles = np.multiply(2 * np.pi * self._frequency(pace), times)
            columns = np.stack([np.sin(angles), np.cos(angles), np.ones_like(angles)], axis=1)
            fitted = np.linalg.lstsq(columns, waves, rcond=None)[0]  # (3, n_commands)
            return float(np.square(columns @ fitted - waves).sum()), fitted

        grid = np.linspace(0.0, 1.0, _GRID)
        best = float(min(grid, key=lambda pace: fit(pace)[0]))
        around = (max(0.0, best - grid[1]), min(1.0, best + grid[1]))
        pace = float(minimize_scalar(lambda pace: fit(pace)[0], bounds=around, method="bounded").x)
        sine, cosine, offset = fit(pace)[1]
        phases = np.arctan2(cosine, sine) / (2 * np.pi) % 1.0
        parameters = np.stack([np.hypot(sine, cosine), phases, (offset / STEER + 1) / 2], axis=1)
        return self.policies.clip(np.append(parameters.ravel(), pace))

    def _frequency(self, pace: float) -> float:
        lowest, highest = self.frequencies
        return float(lowest + pace * (highest - lowest))
