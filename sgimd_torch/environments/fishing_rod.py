"""The fishing rod: a six-joint arm casts a float on the water, simulated by MuJoCo.

Section 4 of Nguyen & Oudeyer (2014); the model is ``fishing_rod.xml``. A movement is open loop: all its commands, noise
included, are computed first, and then ``rod_physics.py`` simulates them. If the float has not met the water ``HOLD``
seconds after the end of the movement, the line is let out.
    outcome = FishingRod().execute(context, theta, rng)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.protocol import SimulationError, check_movement, check_recording
from sgimd_torch.spaces import Array, Box, check_count, check_rng

if TYPE_CHECKING:
    from sgimd_torch.environments.rod_physics import RodTrace

MODEL = Path(__file__).with_name("fishing_rod.xml")
JOINTS = ("yaw", "shoulder", "elbow", "forearm_roll", "wrist_pitch", "wrist_yaw")
JOINT_RANGES = Box(np.array([-1.6, 0.1, -1.2, -0.6, -0.4, -1.4]), np.array([1.6, 1.5, 0.8, 0.6, 1.4, 1.4]))  # rad
DURATIONS = (0.8, 1.6)  # durations (s) of the shortest and of the longest movement
HOLD = 0.15  # time (s) from the end of a movement until the line is let out
CORRELATION = 0.96  # correlation of the motor noise at one step with that at the next step
LONGEST = 60.0  # duration (s) of the longest recording that can be replayed

_BLOCK = 32  # number of movements simulated in parallel; small blocks need little memory, and Ctrl-C works between them


class FishingRod:
    """theta in [0, 1]^25 -> the landing point of the float (m) on the water plane.

    Only one Python thread at a time may use a rod; ``execute_many`` starts threads of its own. When a simulation
    diverges, a ``SimulationError`` is raised, and MuJoCo adds a line to ``MUJOCO_LOG.TXT`` in the current directory.

    Args:
        noise: motor noise (s): standard deviation of the command (rad) for each rad/s of commanded speed; 0 for none.
        outcomes: T, the task space (m); [-1, 1]^2 in the paper, [-100, 100]^2 in its large-space experiment.
        max_wind: largest force (N) of a side wind on the float, which weighs 0.2 N; 0 for no wind. The force is the
            context; without wind the context is empty.
        threads: number of threads of ``execute_many``; None for one per core.

    Raises:
        ValueError: a number is out of its range, or ``outcomes`` does not contain ``rest``.
    """

    def __init__(
        self,
        *,
        noise: float = 0.032,
        outcomes: Box | None = None,
        max_wind: float = 0.0,
        threads: int | None = None,
    ) -> None:
        from sgimd_torch.environments.rod_physics import Caster  # MuJoCo is loaded only when a rod is made

        for name, value in (("noise", noise), ("max_wind", max_wind)):
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and >= 0, got {value}")
        self.noise = noise
        self.primitive = GaussianPrimitive(JOINT_RANGES, DURATIONS, sharpness=6.0)
        self.policies = self.primitive.policies
        self.outcomes = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m") if outcomes is None else outcomes
        self.outcome_noise = 1.15 * noise  # m; scripts/check_physics.py measures 1.15 m for each s of motor noise
        windy = max_wind > 0
        self.contexts = Box.cube(-max_wind, max_wind, int(windy), names=("wind (N)",) * windy)
        threads = None if threads is None else check_count("threads", threads, 1, 1024)
        self._caster = Caster(MODEL, (JOINT_RANGES.low + JOINT_RANGES.high) / 2, threads)
        self.model = self._caster.model
        self._draws = len(self._times(DURATIONS[1] + HOLD))  # number of draws of the motor noise per joint
        self.rest = self.outcomes.check("rest, below the hanging float,", self._caster.hanging[:2].copy(), "is T in m?")
        self.rest.flags.writeable = False

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, the context of the next movement, uniform in ``contexts``; empty without wind."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(2,)`` m, landing point of the float; the number of draws does not depend on theta. See `Environment`."""
        context, theta = check_movement(self, context, theta)
        (landing,) = self.execute_many(context[None], theta[None], [rng])
        if np.isnan(landing).any():
            raise SimulationError(f"the simulation diverged in context {context.tolist()}", theta)
        return landing

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, 2)`` m, landing points; NaN if a simulation diverged. See `BatchEnvironment`."""
        # Each block has as many steps as its longest movement, so movements of similar duration share a block.
        order = thetas[:, -1].argsort(kind="stable")
        outcomes = np.empty((len(thetas), self.outcomes.dim))
        for start in range(0, len(order), _BLOCK):
            block = order[start : start + _BLOCK]
            commands = [self._commands(thetas[row], rngs[row]) for row in block]
            ends = np.array([self.primitive.duration(thetas[row]) + HOLD for row in block])
            outcomes[block] = self._caster.cast(commands, ends, contexts[block].sum(axis=1))  # an empty sum is 0
        return outcomes

    def trace(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> RodTrace:
        """Run one movement and keep the state at every step, for films."""
        context, theta = check_movement(self, context, theta)
        end = self.primitive.duration(theta) + HOLD
        return self._caster.trace(self._commands(theta, rng), end, float(context.sum()))

    def replay(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """``(2,)`` m, landing point if the arm follows a recording of at most 60 s, without wind; see `Replaying`."""
        times, trajectory = check_recording(times, trajectory, len(JOINTS), longest=LONGEST)
        if times[0] != 0:
            raise ValueError(f"times must start at 0, got {times[0]}; subtract the first one")
        end = float(times[-1]) + HOLD
        steps = self._times(end)
        commands = np.stack([np.interp(steps, times, column) for column in trajectory.T], axis=1)
        (landing,) = self._caster.cast([commands], np.array([end]), np.zeros(1))
        if np.isnan(landing).any():
            raise SimulationError("the simulation of a recorded trajectory diverged", trajectory[-1])
        return landing

    def _times(self, end: float) -> Array:
        """Times (s) of the commands up to ``end``, and of one more, as sensors show the state *before* each step."""
        step = self._caster.timestep
        return step * np.arange(math.ceil(end / step) + 1, dtype=np.float64)

    def _commands(self, theta: Array, rng: np.random.Generator) -> Array:
        """``(n_steps, 6)`` rad, the trajectory of theta with motor noise proportional to its speed."""
        check_rng(rng)
        times = self._times(self.primitive.duration(theta) + HOLD)
        trajectory = self.primitive.at(theta, times)
        if not self.noise:
            return trajectory
        from scipy.signal import lfilter  # only here, because this import takes longer than all imports of sgimd_torch

        # All movements draw equally many numbers, so that later draws do not depend on their durations.
        draws = rng.standard_normal((self._draws, len(JOINTS)))[: len(times)]
        draws[1:] *= math.sqrt(1 - CORRELATION**2)
        noise = lfilter([1.0], [1.0, -CORRELATION], draws, axis=0)  # AR(1) of unit variance
        speed = np.abs(trajectory[1:] - trajectory[:-1]) / self._caster.timestep
        trajectory[:-1] += self.noise * speed * noise[:-1]
        return trajectory
