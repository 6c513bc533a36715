"""The fishing rod: a six-joint arm casts a float on the water, simulated by MuJoCo.

Section 4 of Nguyen & Oudeyer (2014); the model is ``fishing_rod.xml``. A movement is open loop, so its whole sequence
of commands, noise included, is computed first and then run.    outcome = FishingRod().execute(context, theta, rng)

``rod_physics.py`` says where the float lands. If it has not met the water ``HOLD`` seconds after the movement's end,
the line is let out.
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
    from sgimd_torch.environments.rod_physics import Recording

MODEL = Path(__file__).with_name("fishing_rod.xml")
JOINTS = ("yaw", "shoulder", "elbow", "forearm_roll", "wrist_pitch", "wrist_yaw")
JOINT_RANGES = Box(np.array([-1.6, 0.1, -1.2, -0.6, -0.4, -1.4]), np.array([1.6, 1.5, 0.8, 0.6, 1.4, 1.4]))  # rad
DURATIONS = (0.8, 1.6)  # s, of a movement
HOLD = 0.15  # s, how long the last posture is held before the line is let out
CORRELATION = 0.96  # of the motor noise from one step to the next
LONGEST = 60.0  # s, the longest recording that can be replayed

_BLOCK = 32  # movements side by side: of about the same length, little memory, and Ctrl-C works between two blocks


class FishingRod:
    """theta in [0, 1]^25 -> the landing point of the float (m) on the water plane.

    A rod can be used by one Python thread at a time; its batches use threads of their own. When a simulation diverges,
    a ``SimulationError`` is raised, and MuJoCo itself adds a line to ``MUJOCO_LOG.TXT`` in the current directory.

    Args:
        noise: motor noise (s): standard deviation of the command (rad) for each rad/s of commanded speed; 0 for none.
        outcomes: T, the task space (m); [-1, 1]^2 in the paper, [-100, 100]^2 in its large-space experiment.
        max_yaw: half range of the base's yaw offset (rad), a context; 0 leaves it out.
        max_wind: half range of a side wind on the float along x (N), a context; 0 leaves it out. The float weighs
            0.2 N.
        line: its length, in units of the paper's rod, whose line has 0.42 m; above 0 and below 2.
        threads: for ``execute_many``; None for one per core.

    Raises:
        ValueError: a negative or non-finite noise or range, a line out of its range, no thread, or ``outcomes`` that
            do not contain ``rest``.
    """

    def __init__(
        self,
        *,
        noise: float = 0.032,
        outcomes: Box | None = None,
        max_yaw: float = 0.0,
        max_wind: float = 0.0,
        line: float = 1.0,
        threads: int | None = None,
    ) -> None:
        from sgimd_torch.environments.rod_physics import Caster  # MuJoCo is loaded only when a rod is made

        for name, value in (("noise", noise), ("max_yaw", max_yaw), ("max_wind", max_wind)):
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"{name} must be finite and >= 0, got {value}")
        if not 0 < line < 2:
            raise ValueError(f"line must be above 0 and below 2, got {line}; a longer one hangs in the water")
        self.noise = noise
        self.primitive = GaussianPrimitive(JOINT_RANGES, DURATIONS, sharpness=6.0)
        self.policies = self.primitive.policies
        self.outcomes = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m") if outcomes is None else outcomes
        self.outcome_noise = 1.15 * noise  # m for each s, see scripts/check_physics.py
        ranges = np.array([max_yaw, max_wind])
        self._context_columns = np.flatnonzero(ranges)
        ranges, names = ranges[self._context_columns], np.array(["yaw (rad)", "wind (N)"])[self._context_columns]
        self.contexts = Box(-ranges, ranges, tuple(names.tolist()))

        threads = None if threads is None else check_count("threads", threads, 1)
        self._caster = Caster(MODEL, (JOINT_RANGES.low + JOINT_RANGES.high) / 2, threads, line=line)
        self.model = self._caster.model
        self._home = self._caster.home
        self._draws = len(self._times(DURATIONS[1] + HOLD))  # of the motor noise, for each joint
        self.rest = self.outcomes.check("rest, below the hanging float,", self._caster.hanging[:2].copy(), "is T in m?")
        self.rest.flags.writeable = False

    @property
    def steps(self) -> int:
        """Physics steps simulated so far, of all movements together."""
        return self._caster.steps

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)`` the context of the next movement, uniform over ``contexts``; empty in the fishing task."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """Run one movement.

        Args:
            context: ``(context_dim,)`` inside ``contexts``.
            theta: ``(25,)`` in [0, 1].
            rng: of the motor noise; the number of draws does not depend on theta.

        Returns:
            ``(2,)`` m, where the float landed.

        Raises:
            ValueError: shapes, values that are not finite or outside their box.
            TypeError: ``rng`` is not a Generator.
            SimulationError: the simulation diverged; the message names theta.
        """
        context, theta = check_movement(self, context, theta)
        return self._execute(context[None], theta[None], [rng])[0]

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, 2)`` m, many movements side by side on threads; row i equals ``execute`` for row i bit for bit.

        The function `execute_many` checks what it is given: ``contexts`` ``(n, context_dim)``, ``thetas`` ``(n, 25)``.

        Raises:
            TypeError, SimulationError: as ``execute``.
        """
        # A block takes as many steps as its longest movement, so movements of about the same length run together.
        order = thetas[:, -1].argsort(kind="stable")
        outcomes = np.empty((len(thetas), self.outcomes.dim))
        for start in range(0, len(order), _BLOCK):
            block = order[start : start + _BLOCK]
            outcomes[block] = self._execute(contexts[block], thetas[block], [rngs[row] for row in block])
        return outcomes

    def record(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Recording:
        """As ``execute``, but it keeps every step, for films and for a closer look; takes twice as long."""
        context, theta = check_movement(self, context, theta)
        commands, end = self._commands(theta, rng), self.primitive.duration(theta) + HOLD
        outcome = self._cast(context[None], theta[None], [commands], np.array([end]))[0]
        return self._caster.record(outcome, commands, end, self._yaw_wind(context[None]))

    def replay(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """Where the float lands when the arm follows a recorded trajectory, without noise, in the context 0.

        Args:
            times: ``(n_times,)`` s, increasing from 0.
            trajectory: ``(n_times, 6)`` rad.

        Returns:
            ``(2,)`` m.

        Raises:
            ValueError: shapes that do not fit, values that are not finite, or times that do not increase from 0 or
                exceed 60 s.
            SimulationError: the simulation diverged.
        """
        times, trajectory = check_recording(times, trajectory, len(JOINTS), longest=LONGEST)
        if times[0] != 0:
            raise ValueError(f"times must start at 0, got {times[0]}; subtract the first one")
        end = float(times[-1]) + HOLD
        steps = self._times(end)
        commands = np.stack([np.interp(steps, times, column) for column in trajectory.T], axis=1)
        landings, diverged = self._caster.cast([commands], np.array([end]))
        if diverged.any():
            raise SimulationError("the simulation of a recorded trajectory diverged", trajectory[-1])
        return landings[0]

    def _execute(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        commands = [self._commands(theta, rng) for theta, rng in zip(thetas, rngs, strict=True)]
        ends = np.array([self.primitive.duration(theta) + HOLD for theta in thetas])
        return self._cast(contexts, thetas, commands, ends)

    def _cast(self, contexts: Array, thetas: Array, commands: list[Array], ends: Array) -> Array:
        landings, diverged = self._caster.cast(commands, ends, self._yaw_wind(contexts))
        if diverged.any():
            row = int(np.flatnonzero(diverged)[0])
            raise SimulationError(f"the simulation diverged in context {contexts[row].tolist()}", thetas[row])
        return landings

    def _yaw_wind(self, contexts: Array) -> Array | None:
        if not self.contexts.dim:
            return None
        yaw_wind = np.zeros((len(contexts), 2))
        yaw_wind[:, self._context_columns] = contexts
        return yaw_wind

    def _times(self, end: float) -> Array:
        """Times (s) of the commands up to ``end``, and one more, as sensors show the state *before* each step."""
        step = self._caster.timestep
        return step * np.arange(math.ceil(end / step) + 1, dtype=np.float64)

    def _commands(self, theta: Array, rng: np.random.Generator) -> Array:
        """``(n_steps, 6)`` rad: the trajectory of theta, with motor noise proportional to its speed."""
        check_rng(rng)
        times = self._times(self.primitive.duration(theta) + HOLD)
        trajectory = self.primitive.at(theta, times)
        if not self.noise:
            return trajectory
        from scipy.signal import lfilter  # takes longer to import than this whole library

        # A short movement draws as often as a long one, so that the stream goes on in the same way after both.
        draws = rng.standard_normal((self._draws, len(JOINTS)))[: len(times)]
        draws[1:] *= math.sqrt(1 - CORRELATION**2)
        noise = lfilter([1.0], [1.0, -CORRELATION], draws, axis=0)  # AR(1) of unit variance
        speed = np.abs(trajectory[1:] - trajectory[:-1]) / self._caster.timestep
        trajectory[:-1] += self.noise * speed * noise[:-1]
        return trajectory
