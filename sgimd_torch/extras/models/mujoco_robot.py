"""A robot from its model file: commands over time, simulated by MuJoCo, and the place of something at the end.

    robot = MujocoRobot("arm.xml", outcome="site:tip"); outcome = robot.execute(robot.observe(rng), theta, rng)
A movement is open loop: all commands are known before it begins. So MuJoCo simulates many movements in parallel,
outside Python. The folder ``models`` reads the file and finds what is named in it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import ClassVar, Final

import mujoco
import numpy as np
from mujoco import rollout
from numpy.typing import ArrayLike

from sgimd_torch.environments.motor_primitives import Controller, GaussianPrimitive
from sgimd_torch.environments.protocol import Primitive, SimulationError, check_movement, check_robot
from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.extras.models.file import file_of, load_model
from sgimd_torch.extras.models.look import NEARLY, SUNK, listed, missed, parts, reached
from sgimd_torch.extras.models.places import (
    body_of,
    check_moved,
    commands_box,
    context_box,
    coupled,
    hand_of,
    held_by_servos,
    holding,
    joint_of,
    joints_above,
    movable,
    moved_by,
    outcome_places,
    path_to,
    positions,
    pulled,
    slides_on,
)
from sgimd_torch.extras.models.posture import first_touch, gap, touching
from sgimd_torch.spaces import Array, Box, check_count, check_point, check_rng, read_only, stream

EXPLORED: Final = 300  # number of random movements that find T
REPEATED: Final = 30  # number of random movements that are executed twice to find the noise of outcomes
LOOKED: Final = 32  # number of random movements that the look before the first movement executes twice
MOVED: Final = 1e-3  # m or rad, shift of the measured place that counts as moved
FEWEST: Final = 10  # number of random movements that must move the measured place
SELDOM: Final = 0.2  # share of random movements that move the measured place; a smaller share is told
FINEST: Final = 1e-4  # share of T's longest side that a small object at rest may tremble by
TREMBLE: Final = 1e-6  # m or rad; an object at rest trembles less, which must not look like an effect of a movement
MOST_STEPS: Final = 100_000  # largest number of timesteps of a movement
POSTURES: Final = 5000  # number of random postures that show what is within reach
LOOKED_EVERY: Final = 0.01  # s between two looks at what touches on a way
_BLOCK: Final = 32  # number of movements simulated in parallel
_STATE: Final = mujoco.mjtState.mjSTATE_FULLPHYSICS
_FRAMES: Final = 25.0  # drawings of a movement per second


@dataclass(frozen=True, eq=False)
class Filmed(Sketch):
    """Drawings of a simulated movement, with the states of the simulation.

    Args:
        states: ``(n_steps, n)`` full physics states.
        path: ``(n_steps, n_places, 3)`` m, world positions of the measured places; joints have none.
    """

    states: Array
    path: Array


class MujocoRobot:
    """Robot from an MJCF or URDF file, simulated by MuJoCo.

    T, if it is not given, is found by random movements; ``remarks`` says so. Only one Python thread at a time may use
    a robot. When a simulation diverges, MuJoCo adds a line to ``MUJOCO_LOG.TXT`` in the current directory.

    Args:
        model: path of the MJCF or URDF file, or menagerie:NAME for a robot of the package mujoco-menagerie.
        outcome: comma-separated places at the end of a movement, such as site:tip, body:cup:xy, geom:ball:xz or
            joint:door.
        joints: joints that move; () for all with an actuator. Other actuators hold their initial positions.
        context: comma-separated initial positions of objects, body:NAME:AXIS:LOW:HIGH for a body with a free joint,
            joint:NAME:LOW:HIGH for a hinge or slide; "" for no context.
        displacement: whether an outcome is the shift of the place from where the movement began.
        low, high: corners of T; () for T found by random movements.
        rest: outcome of not moving; () for the outcome of a movement that holds the start.
        outcome_noise: standard deviation of outcomes if a movement is repeated; None for what ``noise`` makes of random
            movements, at least 1e-6, or less in a small T.
        durations: shortest and longest duration of a movement (s).
        n_knots: number of knots of each joint, after the start, from 2 to 100.
        settle: time (s) between the end of a movement and its outcome.
        noise: standard deviation of the motor noise, relative to the range of each command. It shifts a command by a
            random amount throughout a movement.
        servos: "auto" for position servos in place of motors, or if there are no actuators; "file" for the actuators of
            the file; "made" for position servos at all joints with an actuator, and of an arm that a mocap body pulls.
        keyframe: name of the keyframe in which each movement begins; "" for one named home or rest, or else the model's
            initial positions.
        posture: positions (rad or m) of all joints that turn or slide, in which each movement begins; () for those of
            the keyframe, or the nearest within all ranges in which the robot does not touch itself.
        threads: number of threads of an evaluation; results do not depend on this number.
        controller: function (box of commands) -> controller, such as ``partial(Sinusoids, frequencies=(0.2, 2))``;
            None for a `GaussianPrimitive`.

    Attributes:
        bodies: indices of the bodies that the joints of the robot move.
        files: model file, and files that it includes.
        found_options: T, ``rest``, ``outcome_noise`` and ``posture``, as options.
        joints: names of the joints whose positions the commands are; () if they are anything else, such as torques.
        remarks: sentences for the user, for example about T.

    Raises:
        ValueError: a name is not in the model, a number is out of its range, or the model cannot be used.
        OSError: there is no such file.
    """

    FOUND_OPTIONS: ClassVar = ("low", "high", "rest", "outcome_noise", "posture")

    def __init__(
        self,
        model: str | Path = "",
        *,
        outcome: str = "",
        joints: tuple[str, ...] = (),
        context: str = "",
        displacement: bool = False,
        low: tuple[float, ...] = (),
        high: tuple[float, ...] = (),
        rest: tuple[float, ...] = (),
        outcome_noise: float | None = None,
        durations: tuple[float, float] = (0.5, 1.5),
        n_knots: int = 4,
        settle: float = 0.5,
        noise: float = 0.0,
        servos: str = "auto",
        keyframe: str = "",
        posture: tuple[float, ...] = (),
        threads: int = 1,
        controller: Callable[[Box], Controller] | None = None,
    ) -> None:
        if model == "":
            raise ValueError("model is missing: the path of an MJCF or URDF file, such as arm.xml")
        for name, value in (("settle", settle), ("noise", noise)):
            if not 0 <= value < np.inf:
                raise ValueError(f"{name} must be finite and >= 0, got {value}")
        threads = check_count("threads", threads, 1, 1024)
        path = file_of(model)
        loaded = load_model(path, joints, servos, keyframe, posture)
        self.model, self.remarks, self.files = loaded.model, loaded.remarks, loaded.files
        self._longest, self._settle, self._displacement, self.noise = durations[1], settle, displacement, noise
        self._n_steps(self._longest)
        self._home, self._held = self._begin(loaded.start)
        commands, self._actuators, said = commands_box(self.model, joints, self._held)
        self.remarks += said
        self.joints = positions(self.model, self._actuators)
        self._joint_ids = [self.model.joint(name).id for name in self.joints]
        make = controller or partial(
            GaussianPrimitive,
            durations=durations,
            n_knots=n_knots,
            start=commands.clip(self.start) if self.joints else None,
            speeds=[loaded.speeds.get(name, np.inf) for name in self.joints] or np.inf,
            accelerations=[loaded.accelerations.get(name, np.inf) for name in self.joints] or np.inf,
        )
        self._controller = make(commands)
        self.primitive = self._controller if isinstance(self._controller, Primitive) else Primitive()
        if isinstance(self._controller, GaussianPrimitive):
            self.correspondence = self._controller.correspondence
        self.policies, self._ranges = self._controller.policies, commands
        self.bodies = moved_by(self.model, self._actuators)
        self.contexts, self._addresses = context_box(self.model, context)
        self._places = outcome_places(self.model, outcome)
        for place in self._places:
            check_moved(self.model, place, self._actuators)
        self._hand = hand_of(self.model, self._places[0], self.bodies)
        self._pool = rollout.Rollout(nthread=threads if threads > 1 else 0)
        self._data = [mujoco.MjData(self.model) for _ in range(threads)]
        names = [name for place in self._places for name in place.names]
        self._dim = len(names)
        if rest:
            still = check_point("rest", rest, self._dim)
        elif np.isnan(still := self._outcome(self._held_still())).any():
            raise ValueError(f"{path.name} diverges even while it holds still; is its timestep too long?")
        if low or high:
            corners = [check_point(name, corner, self._dim) for name, corner in (("low", low), ("high", high))]
        else:
            corners = self._explored(still, names, path.name, said)
        self.outcomes = Box(corners[0], corners[1], tuple(names), self._places[0].unit)
        self.rest = read_only(still if rest else self.outcomes.clip(np.round(still, 3)))
        trembles = min(TREMBLE, FINEST * float(self.outcomes.sides.max()))
        self.outcome_noise = max(trembles, self._scatter()) if outcome_noise is None else outcome_noise
        check_robot(self)
        if not posture:  # a robot of a run that goes on was looked at before
            self.remarks += self._look()
        points = [tuple(point.tolist()) for point in (self.outcomes.low, self.outcomes.high, self.rest)]
        self.found_options = dict(zip(self.FOUND_OPTIONS, (*points, self.outcome_noise, loaded.posture), strict=True))

    @property
    def start(self) -> Array:
        """``(n_commands,)``, commands that hold the start of a movement."""
        return self._held[self._actuators]

    @property
    def hand(self) -> str:
        """Name of the body or site at the end of the arm."""
        kind, body = self._hand.kind, body_of(self.model, self._hand)
        return self.model.body(body).name if kind == "geom" else self._hand.name

    @property
    def carries_outcome(self) -> bool:
        """Whether the joints of the robot alone say where the measured places are, if its base does not move."""
        bodies = {body_of(self.model, place) for place in self._places if place.axes}
        joints = {place.name for place in self._places if not place.axes}
        free = {*movable(self.model)} - held_by_servos(self.model)
        own = bool(self.joints) and joints <= {*self.joints} and bodies <= {*self.bodies}
        return own and not free & self._above

    def within_reach(self) -> Array:
        """``(n, outcome_dim)``, measured places in random postures without contacts, of the joints between base and
        places; none if anything else moves these, too."""
        model, ranges, displaced = self.model, self._ranges, self._displacement
        above, own = self._above, self._joint_ids
        starts_vary = displaced and {*self._addresses} & {int(model.jnt_qposadr[joint]) for joint in above}
        known = self.carries_outcome and above <= {*movable(model)} and not coupled(model, above)
        if not known or starts_vary:
            return np.empty((0, self._dim))
        low, high = (np.where(np.isin(own, [*above]), side, self.start) for side in (ranges.low, ranges.high))
        limits = np.where(model.jnt_limited[own], model.jnt_range[own].T, [[-np.inf], [np.inf]])
        low, high = np.clip(low, *limits), np.clip(high, *limits)
        start, outcomes, rng = displaced * self._read(self._home), list[Array](), stream(0, "postures")
        for _ in range(POSTURES):
            joints = rng.uniform(low, high)
            if self.gap(joints) >= 0:
                outcomes.append(self.outcome_at(joints) - start)
        return np.reshape(outcomes, (-1, self._dim))

    @property
    def _above(self) -> set[int]:
        """Joints between the base and the measured places."""
        return {k for place in self._places for k in joints_above(self.model, body_of(self.model, place))}

    def commanded(self, theta: Array) -> Array:
        """``(n_steps, n_commands)``, commands of a movement without noise, one for each timestep of the model."""
        return self._commands(theta, stream(0, "no noise"))[:, self._actuators]

    def touches(self, commands: Array, clearance: float, joints: Array | None = None) -> str:
        """What touches first on the simulated way of ``commands`` ``(n_steps, n_commands)``; see `first_touch`.

        The way begins at the start, or at ``joints`` (rad), where the robot lies.
        """
        sent = np.tile(self._held, (len(commands), 1))
        sent[:, self._actuators] = commands
        (states,) = self._simulate(np.zeros((1, self.contexts.dim)), [sent], joints)
        every = max(1, round(LOOKED_EVERY / self.model.opt.timestep))
        seen: Iterable[Array] = [] if states is None else states[::every]
        return first_touch(self.model, seen, self.bodies, clearance, lying=joints is not None)

    def gap(self, joints: Array, most: float = 0.0) -> float:
        """Least distance (m) of the robot to itself and to anything when its joints are at ``(n_joints,)`` rad; at most
        ``most``, below 0 if it touches."""
        self.outcome_at(joints)
        return gap(self.model, self._data[0], self.bodies, most)

    def outcome_at(self, joints: Array) -> Array:
        """``(outcome_dim,)``, measured places when the robot's joints are at ``(n_joints,)`` rad; other things rest."""
        data = self._at(self._home)
        data.qpos[self.model.jnt_qposadr[self._joint_ids]] = joints
        mujoco.mj_kinematics(self.model, data)
        return np.concatenate([place.read(data) for place in self._places])

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, uniform in C."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one movement; see `Environment`."""
        context, theta = check_movement(self, context, theta)
        outcome = self.execute_many(context[None], theta[None], [rng])[0]
        if np.isnan(outcome).any():
            raise SimulationError(f"the simulation diverged in context {context.tolist()}", theta)
        return outcome

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, outcome_dim)``, outcomes; NaN if a simulation diverged. See `BatchEnvironment`."""
        commands = [self._commands(theta, rng) for theta, rng in zip(thetas, rngs, strict=True)]
        outcomes = np.empty((len(thetas), self._dim))
        for start in range(0, len(thetas), _BLOCK):
            rows = slice(start, start + _BLOCK)
            outcomes[rows] = [self._outcome(states) for states in self._simulate(contexts[rows], commands[rows])]
        return outcomes

    def trace(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Filmed:
        """The states of a movement, and drawings of the arm, of objects and of the measured places.

        The drawings lie in the plane of the first two dimensions of an outcome.
        """
        context, theta = check_movement(self, context, theta)
        (states,) = self._simulate(context[None], [self._commands(theta, rng)])
        if states is None:
            raise SimulationError(f"the simulation diverged in context {context.tolist()}", theta)
        every = max(1, round(1 / (_FRAMES * self.model.opt.timestep)))
        frames = states[::-every][::-1]  # the last drawing shows the outcome
        drawn = [self._drawing(state, states[0]) for state in frames]
        chains = [np.stack(drawings) for drawings in zip(*drawn, strict=True)]
        path = np.stack([self._measured(state) for state in frames])
        return Filmed(self._outcome(states), every * self.model.opt.timestep, chains, frames, path)

    def start_in(self, context: Array) -> Array:
        """The full physics state in which a movement begins in a context ``(context_dim,)``."""
        start = self._home.copy()
        start[[1 + address for address in self._addresses]] = context  # time, then all positions
        return start

    def positions(self, state: Array) -> Array:
        """``(nq,)``, the positions of all joints in a full physics state."""
        return self._at(state).qpos.copy()

    def located(self, outcomes: Array, start: Array) -> Array:
        """World positions ``(n, n_places, 3)`` m of ``outcomes`` ``(n, outcome_dim)``; joints have none.

        A coordinate that is not measured is that at the start of the movement.

        Args:
            outcomes: outcomes, or goals.
            start: full physics state in which the movement begins.
        """
        located = np.tile(self._measured(start), (len(outcomes), 1, 1))
        row = column = 0
        for place in self._places:
            if place.axes:
                located[:, row, place.axes] *= self._displacement
                located[:, row, place.axes] += outcomes[:, column : column + len(place.axes)]
                row += 1
            column += len(place.names)
        return located

    def _measured(self, state: Array) -> Array:
        """``(n_places, 3)`` m, the world positions of the measured places; joints have none."""
        data = self._at(state)
        return np.reshape([place.position(data) for place in self._places if place.axes], (-1, 3))

    def _drawing(self, state: Array, start: Array) -> list[Array]:
        """Chains ``(n_points, 2)`` of one drawing, in the first two dimensions of T: arm, objects, measured places."""
        place = self._places[0]
        if not place.axes:  # T is of joints, so the drawing is, too
            joints = self._read(state) - self._displacement * self._read(start)
            return [np.append(joints, 0.0)[None, :2]]
        origin, data = self._displacement * self._measured(start)[0], self._at(state)
        arm = [*data.xpos[path_to(self.model, body_of(self.model, self._hand))], self._hand.position(data)]
        objects = [k for k in range(1, self.model.nbody) if self.model.body_jntnum[k] and k not in self.bodies]
        others = [other.position(data) for other in self._places[self._hand is place :] if other.axes]
        axes = [*place.axes, *(k for k in range(3) if k not in place.axes)][:2]
        chains = np.stack(arm), *data.xpos[objects][:, None], *np.reshape(others, (-1, 1, 3))
        return [(chain - origin)[:, axes] for chain in chains]

    def _begin(self, data: mujoco.MjData) -> tuple[Array, Array]:
        """Start configuration (a full physics state) of ``data``, and commands ``(nu,)`` that hold it."""
        mujoco.mj_forward(self.model, data)
        held = holding(self.model, data)
        for k in np.flatnonzero(self.model.actuator_actadr >= 0):  # a filtered command has no delay at the start
            data.act[self.model.actuator_actadr[k] + self.model.actuator_actnum[k] - 1] = held[k]
        data.time = 0
        home = np.empty(mujoco.mj_stateSize(self.model, _STATE))
        mujoco.mj_getState(self.model, data, home, _STATE)
        return home, held

    def _commands(self, theta: Array, rng: np.random.Generator) -> Array:
        """``(n_steps, nu)``, the commands of theta with motor noise, held after the end of the movement."""
        check_rng(rng)
        controller = self._controller
        lasts = controller.duration(theta) if isinstance(controller, GaussianPrimitive) else self._longest
        # Noise is drawn even if ``noise`` is 0, so that later draws do not depend on ``noise``.
        shift = self.noise * self._ranges.sides * rng.standard_normal(self._ranges.dim)
        commands = self._still(lasts)
        times = np.minimum(self.model.opt.timestep * np.arange(len(commands)), lasts)
        commands[:, self._actuators] = controller.at(theta, times) + shift
        return commands

    def _still(self, lasts: float) -> Array:
        """``(n_steps, nu)``, the commands that hold the start configuration for a movement of ``lasts`` s."""
        return np.tile(self._held, (self._n_steps(lasts), 1))

    def _n_steps(self, lasts: float) -> int:
        """Number of timesteps of a movement of ``lasts`` s.

        Raises:
            ValueError: there are more than ``MOST_STEPS``, which would take too long.
        """
        timestep = self.model.opt.timestep
        n = (lasts + self._settle) / timestep if timestep > 0 else np.inf
        if not n <= MOST_STEPS:
            raise ValueError(
                f"a movement of {lasts:g} s and settle {self._settle:g} s take {n:.3g} steps at the model's timestep "
                f"{timestep:g}, more than {MOST_STEPS}; durations, settle and timestep are in s, are they in ms?"
            )
        return int(np.ceil(n))

    def _simulate(self, contexts: Array, commands: Sequence[Array], joints: Array | None = None) -> list[Array | None]:
        """States of each movement, the first one before its first step; None if the simulation diverged.

        The robot's joints begin at ``joints`` (rad or m), None: at the start.
        """
        starts = np.stack([self.start_in(context) for context in contexts])
        if joints is not None:
            starts[:, 1 + self.model.jnt_qposadr[self._joint_ids]] = joints
        longest = max(map(len, commands))
        controls = np.stack([np.pad(one, ((0, longest - len(one)), (0, 0)), "edge") for one in commands])
        run, _ = self._pool.rollout(self.model, self._data, starts, controls)
        simulated = list[Array | None]()
        for start, states, n in zip(starts, run, map(len, commands), strict=True):
            # A diverging simulation stops, or begins again at the time 0; the first entry of a state is its time.
            right = abs(states[n - 1, 0] - n * self.model.opt.timestep) < self.model.opt.timestep / 2
            simulated.append(np.concatenate([start[None], states[:n]]) if right else None)
        return simulated

    def _outcome(self, states: Array | None) -> Array:
        if states is None:
            return np.full(self._dim, np.nan)
        return self._read(states[-1]) - self._read(states[0]) if self._displacement else self._read(states[-1])

    def _read(self, state: Array) -> Array:
        """``(outcome_dim,)``, the measured places in a full physics state."""
        data = self._at(state)
        return np.concatenate([place.read(data) for place in self._places])

    def _at(self, state: Array) -> mujoco.MjData:
        """MuJoCo's data in a full physics state, until the next call."""
        data = self._data[0]
        mujoco.mj_setState(self.model, data, state, _STATE)
        mujoco.mj_kinematics(self.model, data)
        return data

    def _held_still(self) -> Array | None:
        """States of a movement that holds the start, in the middle of C; None if the simulation diverged."""
        middle = (self.contexts.low + self.contexts.high) / 2
        return self._simulate(middle[None], [self._still(self._longest)])[0]

    def _look(self) -> list[str]:
        """Sentences on what a user should know before the first movement."""
        lines, still = parts(self.model, self.bodies), self._held_still()
        if still is not None:
            sunk = float(np.linalg.norm(self._read(still[-1]) - self._read(still[0])))
            mujoco.mj_forward(self.model, data := self._at(still[-1]))
            names = [" and ".join(self.model.body(k).name for k in p) for p in touching(self.model, data, self.bodies)]
            if names:
                lines.append(f"holding still, the robot touches itself: {listed(names)}; give --environment.keyframe")
            if sunk > SUNK:
                free = mujoco.mjtJoint.mjJNT_FREE in {int(self.model.jnt_type[joint]) for joint in self._above}
                endless = all(slides_on(self.model, joint_of(self.model, k)) for k in self._actuators)
                why = "its servos yield to its weight" if self.joints else "its commands are no positions"
                advice = "" if endless else f"; {why}: --environment.servos made holds it"
                floor = "; its base is free: write a floor into the model, or take the free joint away"
                advice = floor if free else advice
                lines.append(f"holding still, what is measured moves by {self.outcomes.amount(sunk, '.2g')}{advice}")
        contexts, thetas = self._drawn("look", LOOKED)
        signs = [stream(0, "signs", k).choice([-1, 1], self.policies.dim) for k in range(LOOKED)]
        sets = thetas, self.policies.clip(thetas + NEARLY * np.stack(signs))
        commands = [[self._commands(t, stream(0, "looked at", k)) for k, t in enumerate(s)] for s in sets]
        pairs = zip(commands[0], *(self._simulate(contexts, sequences) for sequences in commands), strict=True)
        right = [(sent[-1], one, other) for sent, one, other in pairs if one is not None and other is not None]
        if not right:
            return [*lines, "every random movement diverges: write a shorter timestep into the model"]
        if self.joints:
            ends = np.stack([self.positions(one[-1]) for _, one, _ in right])
            last = np.stack([sent[self._actuators] for sent, _, _ in right])
            lines += missed(self.model, self._joint_ids, ends, last)
        if isinstance(self._controller, GaussianPrimitive):
            lasts = [self._controller.duration(theta) for theta in thetas]
            if max(lasts) > self._longest:
                lines.append(f"movements last {min(lasts):.2g} to {max(lasts):.2g} s, as no joint can move faster")
        outcomes = np.array([[self._outcome(one), self._outcome(other)] for _, one, other in right])
        return lines + reached(outcomes, self.outcomes)

    def _drawn(self, name: str, n: int) -> tuple[Array, Array]:
        """Contexts and thetas of ``n`` random movements."""
        rngs = [stream(0, name, k) for k in range(n)]
        contexts = np.stack([self.contexts.sample(rng) for rng in rngs])
        return contexts, np.stack([self.policies.sample(rng) for rng in rngs])

    def _scatter(self) -> float:
        """Standard deviation of the outcomes of random movements, each executed twice."""
        if not self.noise:
            return 0.0
        one, other = (self._tried(REPEATED, execution)[1] for execution in ("one", "other"))
        return float(np.sqrt(np.nanmean(np.square(one - other)) / 2))

    def _explored(self, rest: Array, names: Sequence[str], file: str, said: Sequence[str]) -> list[Array]:
        """Corners of T, found by random movements; a refusal repeats what was ``said`` of the commands."""
        starts, ends = self._tried(EXPLORED, "T")
        lost = int(np.isnan(ends).any(axis=1).sum())
        moved = ends[(np.abs(ends - starts) > MOVED).any(axis=1)]
        what = f"{len(moved)} of {EXPLORED} random movements of {file} move {', '.join(names)}"
        held = [self.model.body(body).name for _, body in pulled(self.model)]
        nearer = f"free {held[0]} from its mocap body: --environment.servos made" if held else ""
        nearer = nearer or "put the object nearer to the robot"
        if len(moved) < FEWEST:
            carried = all(place.axes and body_of(self.model, place) in self.bodies for place in self._places)
            nearer = "does it lie on the axis that turns it? Measure a place beside it" if carried else nearer
            advice = f"give low and high, which are the corners of T, or {nearer}" if len(moved) else nearer
            advice = "write a shorter timestep into the model" if lost == EXPLORED else advice
            raise ValueError("; ".join([f"{what}, {lost} diverge", advice, *said]))
        if len(moved) < SELDOM * EXPLORED:
            self.remarks.append(f"only {what}, so little is learnt: {nearer}")
        low, high = np.quantile(moved, (0.05, 0.95), axis=0)  # an object that flies away does not set the size of T
        low, high = np.minimum(low, rest) - 0.1 * (high - low), np.maximum(high, rest) + 0.1 * (high - low)
        flat = [name for name, side in zip(names, high - low, strict=True) if side < MOVED]
        if flat:
            raise ValueError("; ".join([f"{', '.join(flat)} never changes; leave it out, as in site:tip:xy", *said]))
        # Round numbers stay equal if a replay finds T again on another processor.
        scale = 10.0 ** (1 - np.floor(np.log10((high - low).max())))
        corners = np.floor(low * scale) / scale, np.ceil(high * scale) / scale
        texts = [",".join(f"{x:g}" for x in corner) for corner in corners]
        self.remarks.append(
            f"T was found by {EXPLORED} random movements, of which {len(moved)} moved {', '.join(names)}"
            f"{f' and {lost} diverged' if lost else ''}: --environment.low {texts[0]} --environment.high {texts[1]}"
        )
        return [*corners]

    def _tried(self, n: int, execution: str) -> tuple[Array, Array]:
        """Measured places at the start, and outcomes, of ``n`` random movements; the noise depends on ``execution``."""
        contexts, thetas = self._drawn("random movements", n)
        ends = self.execute_many(contexts, thetas, [stream(0, execution, k) for k in range(n)])
        starts = (
            np.zeros_like(ends) if self._displacement else np.stack([self._read(self.start_in(c)) for c in contexts])
        )
        return starts, ends
