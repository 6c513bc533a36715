"""Physics of the fishing rod: the arm follows commands in MuJoCo, the line swings, and the float lands on the water.

Section 4 of Nguyen & Oudeyer (2014); ``fishing_rod.py`` computes the commands. All commands are known before a movement
begins, so MuJoCo simulates many movements in parallel, outside Python.
    landings = Caster(path, posture).cast([commands], ends, winds)

The landing point is where the float first meets the water (z = 0), interpolated between two steps. If the float has not
met the water when the commands end, the line is let out: the float then flies freely, pushed by the wind, and lands
where its parabola meets the water. So every movement has exactly one landing point.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

from sgimd_torch.spaces import Array

TOP_SPEED = 500.0  # rad/s; a diverging simulation exceeds it, and 100,000 random movements stayed far below

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, eq=False)
class RodTrace:
    """States of the rod at each step of a movement.

    After the line is let out, arm and rod hold their last posture, and only ``float_at`` gives the float's position.

    Args:
        outcome: ``(2,)`` m, landing point of the float.
        landed: time (s) when the float landed.
        let_out: time (s) when the line was let out; None if the float met the water before.
        step: time between two states (s).
        states: ``(n_steps, n_state)``, MuJoCo's full physics states, up to the first one at or after ``landed``.
        floats: ``(n_steps, 6)``, position (m) and velocity (m/s) of the float in ``states``, always on its line.
        push: acceleration (m/s^2) along x that the wind gives to a freely flying float.
        gravity: downward acceleration (m/s^2) of a freely flying float.
    """

    outcome: Array
    landed: float
    let_out: float | None
    step: float
    states: Array
    floats: Array
    push: float
    gravity: float

    def float_at(self, time: float) -> Array:
        """``(3,)`` m, position of the float at ``time`` (s); after ``landed`` it lies on the water."""
        if time >= self.landed:
            return np.append(self.outcome, 0.0)
        if self.let_out is None or time <= self.let_out:
            return self._on_the_line(time)[:3]
        free, left = time - self.let_out, self._on_the_line(self.let_out)
        return left[:3] + (left[3:] + np.array([self.push, 0.0, -self.gravity]) * free / 2) * free

    def _on_the_line(self, time: float) -> Array:
        row, share = divmod(time / self.step, 1.0)
        before, after = self.floats[int(row)], self.floats[min(int(row) + 1, len(self.floats) - 1)]
        return before + share * (after - before)


class Caster:
    """The rod in MuJoCo; all movements begin in the same start configuration.

    Args:
        path: file of the MuJoCo model, ``fishing_rod.xml``.
        posture: ``(6,)`` rad, start posture of the arm.
        threads: number of threads that simulate several movements; None for one per core.
    """

    def __init__(self, path: Path, posture: Array, threads: int | None = None) -> None:
        self.model = model = _damped(mujoco.MjModel.from_xml_path(str(path)))
        self.timestep = float(model.opt.timestep)
        self._gravity = -float(model.opt.gravity[2])
        self._float_mass = float(model.body("float").mass[0])
        self._threads = os.cpu_count() or 1 if threads is None else threads
        self._pools: dict[int, tuple[rollout.Rollout, list[mujoco.MjData]]] = {}
        self.home, self.hanging = self._settle(posture)
        """Start configuration (a full physics state), and position (m) and velocity (m/s) ``(6,)`` of its float."""

    def cast(self, commands: list[Array], ends: Array, winds: Array) -> Array:
        """Simulate movements in parallel; the outcome of each is the same, bit for bit, as if simulated alone.

        Args:
            commands: n arrays ``(n_steps, 6)`` rad, a row for each time step.
            ends: ``(n,)`` s, times when the line is let out, each within the last step of its movement.
            winds: ``(n,)`` N, forces of the wind on the float along x.

        Returns:
            ``(n, 2)`` m, landing points of the floats; NaN if the simulation diverged.
        """
        run, seen = self._rollout(*self._begin(commands, winds))
        movements = zip(run, seen, map(len, commands), ends.tolist(), winds.tolist(), strict=True)
        return np.stack([self._land(states[:n], track[:n], end, wind)[0] for states, track, n, end, wind in movements])

    def trace(self, commands: Array, end: float, wind: float) -> RodTrace:
        """Trace of one movement."""
        states, controls = self._begin([commands], np.array([wind]))
        run, seen = self._rollout(states, controls)
        outcome, landed, let_out = self._land(run[0], seen[0], end, wind)
        states, floats = np.concatenate([states, run[0]]), seen[0]
        n_steps = math.ceil(landed / self.timestep) + 1
        if n_steps > len(floats):
            held = np.repeat(controls[:, -1:], n_steps - len(floats), axis=1)
            run, seen = self._rollout(states[-1:], held)
            states, floats = np.concatenate([states, run[0]]), np.concatenate([floats, seen[0]])
        kept, push = (states[:n_steps], floats[:n_steps]), wind / self._float_mass
        return RodTrace(outcome, landed, let_out, self.timestep, *kept, push, self._gravity)

    def _land(self, states: Array, track: Array, end: float, wind: float) -> tuple[Array, float, float | None]:
        """Landing point ``(2,)`` m and time (s) of a movement, NaN if it diverged; time (s) when the line was let out.

        Args:
            states: ``(n_steps, n_state)``, states after each step.
            track: ``(n_steps, 6)``, position (m) and velocity (m/s) of the float before each step.
            end: time (s) when the line is let out, if the float has not met the water before.
            wind: force (N) of the wind on the float along x.
        """
        speed = states[:, 1 + self.model.nq : 1 + self.model.nq + self.model.nv]
        if not (speed.max() < TOP_SPEED and speed.min() > -TOP_SPEED):  # also true for NaN
            return np.full(2, np.nan), np.nan, None
        if wet := int((track[:, 2] <= 0).argmax()):  # first step with the float in the water; 0 if there is none
            above, below = track[wet - 1], track[wet]
            share = above[2] / (above[2] - below[2])
            return above[:2] + share * (below[:2] - above[:2]), float(self.timestep * (wet - 1 + share)), None
        after = len(track) - 1 - end / self.timestep  # number of steps from end to the last state
        x, y, z, dx, dy, dz = (track[-1] + after * (track[-2] - track[-1])).tolist()
        flight = (dz + math.sqrt(dz * dz + 2 * self._gravity * max(z, 0.0))) / self._gravity
        landing = np.array([x + (dx + wind / self._float_mass * flight / 2) * flight, y + dy * flight])
        return landing, end + flight, end

    def _settle(self, posture: Array) -> tuple[Array, Array]:
        """Start configuration c_org, with the arm in ``posture`` and the line hanging still, and state of its float."""
        data = mujoco.MjData(self.model)
        data.qpos[:6] = posture
        data.qpos[6] = -(posture[1] + posture[2] + posture[4])  # opposite to the rod's pitch, so the line hangs plumb
        data.act[:6] = data.ctrl[:6] = posture
        mujoco.mj_step(self.model, data, nstep=1000)
        data.qvel[:] = 0
        data.time = 0
        mujoco.mj_forward(self.model, data)
        home = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, data, home, _STATE)
        return home, data.sensordata.copy()

    def _begin(self, commands: list[Array], winds: Array) -> tuple[Array, Array]:
        """Start states ``(n, n_state)`` and controls ``(n, n_steps, 7)``; short movements repeat their last command."""
        n = len(commands)
        controls = np.zeros((n, max(map(len, commands)), self.model.nu))
        for k, sequence in enumerate(commands):
            controls[k, : len(sequence), :6] = sequence
            controls[k, len(sequence) :, :6] = sequence[-1]
        controls[:, :, 6] = winds[:, None]
        return np.repeat(self.home[None], n, axis=0), controls

    def _rollout(self, states: Array, controls: Array) -> tuple[Array, Array]:
        """States after each step; position and velocity of the float *before* each step, when sensors are read."""
        threads = self._threads if len(states) > 1 else 1
        if threads not in self._pools:
            data = [mujoco.MjData(self.model) for _ in range(threads)]
            self._pools[threads] = (rollout.Rollout(nthread=threads if threads > 1 else 0), data)
        pool, data = self._pools[threads]
        n, n_steps = controls.shape[:2]
        run, seen = np.empty((n, n_steps, states.shape[1])), np.empty((n, n_steps, self.model.nsensordata))
        # MuJoCo's own checks and copies would take as long as four time steps; the shapes are right by construction.
        pool.rollout(
            [self.model] * n, data, states, controls, state=run, sensordata=seen, nstep=n_steps, skip_checks=True
        )
        return run, seen


def _damped(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model with the damping that MuJoCo gives its servos from 3.15 on; before, it took less of the arm's inertia.

    Damping is critical for the inertia that each joint of the arm has at zero angles while all others are free.
    """
    data, inverse = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_solveM(model, data, inverse, np.eye(model.nv))
    servos = np.flatnonzero(model.actuator_biasprm[:, 1])
    inertias = 1 / np.diag(inverse)[model.jnt_dofadr[model.actuator_trnid[servos, 0]]]
    model.actuator_biasprm[servos, 2] = -2 * np.sqrt(model.actuator_gainprm[servos, 0] * inertias)
    return model
