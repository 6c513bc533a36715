"""Physics of the fishing rod: the arm follows commands in MuJoCo, the line swings, and the float lands on the water.

Section 4 of Nguyen & Oudeyer (2014); ``fishing_rod.py`` says what is commanded. All commands are known before a
movement begins, so they run in C, many movements side by side.
    landings, diverged = Caster(path, posture).cast([commands], ends)

The float lands at the first point where it meets the water (z = 0), interpolated between two steps. If it has not met
the water when the commands end, the line is let out: the float flies on freely with its velocity and the push of the
wind, and lands where this parabola meets the water. So every movement has exactly one landing point.
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

TOP_SPEED = 500.0  # rad/s; 100,000 random movements stay far below, a diverging simulation exceeds it

_STATE = mujoco.mjtState.mjSTATE_FULLPHYSICS


@dataclass(frozen=True, eq=False)
class Recording:
    """A movement step by step.

    ``outcome`` ``(2,)`` m is where the float landed, and ``landed`` (s) when. ``let_out`` (s) is when the line was let
    out, None if the float met the water before. ``states`` ``(n_steps, n_state)`` are MuJoCo's full physics states
    every ``step`` seconds, from 0 to ``landed`` or just beyond; ``floats`` ``(n_steps, 6)`` are position (m) and
    velocity (m/s) of the float on its line in them. ``push`` (m/s^2) is the acceleration of a freely flying float by
    the wind, along x, and ``gravity`` (m/s^2) that downwards.

    After the line was let out, arm and rod hold their last posture, and the float is no longer that of ``states``.
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
        """``(3,)`` m, where the float is at ``time`` (s); after ``landed`` it lies on the water."""
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
        path: of the MuJoCo model, ``fishing_rod.xml``.
        posture: ``(6,)`` rad, of the arm at the start.
        threads: for several movements at once; None for one per core.
        line: how many times as long as in ``path`` the line is, and as heavy.
    """

    def __init__(self, path: Path, posture: Array, threads: int | None = None, *, line: float = 1.0) -> None:
        self.model = model = _model(path, line)
        self.steps = 0
        """Physics steps simulated so far, of all movements together."""
        self.timestep = float(model.opt.timestep)
        self._gravity = -float(model.opt.gravity[2])
        self._float_mass = float(model.body("float").mass[0])
        self._threads = os.cpu_count() or 1 if threads is None else threads
        self._pools: dict[int, tuple[rollout.Rollout, list[mujoco.MjData]]] = {}
        self._rooms: dict[str, Array] = {}
        self.home, self.hanging = self._settle(posture)
        """The start configuration, a full physics state; and ``(6,)``, position (m) and velocity (m/s) of its float."""

    def cast(self, commands: list[Array], ends: Array, yaw_wind: Array | None = None) -> tuple[Array, np.ndarray]:
        """Run movements side by side; each gives the same, bit for bit, as it would alone.

        Args:
            commands: n times ``(n_steps, 6)`` rad, a row for each time step.
            ends: ``(n,)`` s, when the line is let out: within the last step.
            yaw_wind: ``(n, 2)``, offset of the base's yaw (rad) and force of the wind on the float along x (N).

        Returns:
            ``(n, 2)`` m, where the floats landed, and ``(n,)``, whether the simulation diverged.
        """
        states, controls = self._begin(commands, yaw_wind)
        run, seen = self._rollout(states, controls)
        landings, diverged = np.full((len(commands), 2), np.nan), np.zeros(len(commands), dtype=bool)
        speeds = slice(1 + self.model.nq, 1 + self.model.nq + self.model.nv)
        for row, end in enumerate(ends):
            n_steps = len(commands[row])
            speed, track = run[row, :n_steps, speeds], seen[row, :n_steps]
            wet = int((track[:, 2] <= 0).argmax())  # 0 if no step is, as the float begins above the water
            if not (speed.max() < TOP_SPEED and speed.min() > -TOP_SPEED):  # NaN too
                diverged[row] = True
            elif wet:
                landings[row] = _crossing(track[wet - 1], track[wet])
            else:
                after = n_steps - 1 - end / self.timestep  # share of a step
                landings[row] = self._let_out(track[-1] + after * (track[-2] - track[-1]), float(controls[row, 0, 6]))
        return landings, diverged

    def record(self, outcome: Array, commands: Array, end: float, yaw_wind: Array | None = None) -> Recording:
        """The movement that, by ``cast``, lands at ``outcome``, step by step."""
        states, controls = self._begin([commands], yaw_wind)
        run, seen = self._rollout(states, controls)
        states, floats, push = (
            np.concatenate([states, run[0]]),
            seen[0].copy(),
            float(controls[0, 0, 6]) / self._float_mass,
        )
        let_out = None
        wet = np.flatnonzero(floats[:, 2] <= 0)
        if wet.size:
            above, below = floats[wet[0] - 1 : wet[0] + 1, 2]
            landed = self.timestep * float(wet[0] - 1 + above / (above - below))
        else:
            share = len(commands) - 1 - end / self.timestep
            let_out = end
            landed = end + self._flight(floats[-1] + share * (floats[-2] - floats[-1]))
        n_steps = math.ceil(landed / self.timestep) + 1
        if n_steps > len(floats):
            held = np.repeat(controls[:, -1:], n_steps - len(floats), axis=1)
            run, seen = self._rollout(states[-1:], held)
            states, floats = np.concatenate([states, run[0]]), np.concatenate([floats, seen[0]])
        kept = states[:n_steps], floats[:n_steps]
        return Recording(outcome, landed, let_out, self.timestep, *kept, push, self._gravity)

    def _settle(self, posture: Array) -> tuple[Array, Array]:
        """c_org, the start configuration: the arm in its posture, the line hanging still."""
        data = mujoco.MjData(self.model)
        data.qpos[:6] = posture
        data.qpos[6] = -(posture[1] + posture[2] + posture[4])  # undoes the rod's pitch: the line hangs plumb
        data.act[:6] = data.ctrl[:6] = posture
        mujoco.mj_step(self.model, data, nstep=1000)
        data.qvel[:] = 0
        data.time = 0
        mujoco.mj_forward(self.model, data)
        home = np.zeros(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, data, home, _STATE)
        return home, data.sensordata.copy()

    def _begin(self, commands: list[Array], yaw_wind: Array | None) -> tuple[Array, Array]:
        """``(n, n_state)`` start states, and ``(n, n_steps, 7)`` controls; the last ones of a movement are held."""
        n = len(commands)
        controls = np.zeros((n, max(map(len, commands)), self.model.nu))
        for k, sequence in enumerate(commands):
            controls[k, : len(sequence), :6] = sequence
            controls[k, len(sequence) :, :6] = sequence[-1]
        states = np.repeat(self.home[None], n, axis=0)
        if yaw_wind is not None:
            controls[:, :, 0] += yaw_wind[:, None, 0]
            controls[:, :, 6] = yaw_wind[:, None, 1]
            states[:, 1] += yaw_wind[:, 0]  # time comes first, then the angles: yaw is the first
            states[:, 1 + self.model.nq + self.model.nv] += yaw_wind[:, 0]  # and the yaw servo's own state
        return states, controls

    def _let_out(self, seen: Array, wind: float) -> tuple[float, float]:
        """Where a float of this position and velocity ``(6,)`` lands after a free flight."""
        x, y, _, dx, dy, _ = seen.tolist()
        flight = self._flight(seen)
        return x + (dx + wind / self._float_mass * flight / 2) * flight, y + dy * flight

    def _flight(self, seen: Array) -> float:
        """How long (s) the free flight of a float of this position and velocity takes."""
        z, dz = float(seen[2]), float(seen[5])
        return (dz + math.sqrt(dz * dz + 2 * self._gravity * max(z, 0.0))) / self._gravity

    def _rollout(self, states: Array, controls: Array) -> tuple[Array, Array]:
        """States after each step, and the float's position and velocity *before* it, as MuJoCo's sensors have them.

        Both are overwritten by the next call: new memory for each would take longer than everything around it.
        """
        threads = self._threads if len(states) > 1 else 1
        if threads not in self._pools:
            data = [mujoco.MjData(self.model) for _ in range(threads)]
            self._pools[threads] = (rollout.Rollout(nthread=threads if threads > 1 else 0), data)
        pool, data = self._pools[threads]
        n, n_steps = controls.shape[:2]
        self.steps += n * n_steps
        run = self._room("run", n, n_steps, states.shape[1])
        seen = self._room("seen", n, n_steps, self.model.nsensordata)
        # MuJoCo's own checks and copies would take as long as four steps; the shapes are right by construction.
        pool.rollout(
            [self.model] * n, data, states, controls, state=run, sensordata=seen, nstep=n_steps, skip_checks=True
        )
        return run, seen

    def _room(self, name: str, *shape: int) -> Array:
        size = math.prod(shape)
        if name not in self._rooms or len(self._rooms[name]) < size:
            self._rooms[name] = np.empty(size)
        return self._rooms[name][:size].reshape(shape)


def _crossing(above: Array, below: Array) -> Array:
    share = above[2] / (above[2] - below[2])
    return above[:2] + share * (below[:2] - above[:2])


def _model(path: Path, line: float) -> mujoco.MjModel:
    """The model in ``path``, each segment of its line ``line`` times as long and as heavy."""
    if line == 1:
        return mujoco.MjModel.from_xml_path(str(path))
    spec = mujoco.MjSpec.from_file(str(path))
    for body in spec.bodies:
        if body.name == "float" or body.name.startswith("line_"):
            body.pos = line * body.pos
        for geom in body.geoms:
            if geom.name.startswith("line_"):
                geom.fromto, geom.mass = line * geom.fromto, line * geom.mass
    return spec.compile()
