"""A robot arm on the table: any robot of the LeRobot package, or whatever has the calls of its class ``Robot``.

    arm = LeRobotArm("so101_follower", port="/dev/ttyACM0", model="so101.xml", outcome="site:tip", units="deg")
The model file says what theta and an outcome mean, as for `MujocoRobot`. So a run in MuJoCo can be the past of a run on
the arm: ``--begin-with``. The arm connects at its first movement. Its torque is switched off at Ctrl-C, after an error
of the arm, and when the process ends.
"""

from __future__ import annotations

import atexit
import pkgutil
import signal
import time
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.calls import with_keywords_of
from sgimd_torch.environments.protocol import NotExecutedError, SimulationError, check_movement, check_robot, tried
from sgimd_torch.extras.lerobot.watch import FIRST, LOOK, Watch
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.extras.models.untouched import Untouched, touched_by, way_to_start
from sgimd_torch.extras.recordings.led import led
from sgimd_torch.extras.recordings.units import motor_unit, scales_of
from sgimd_torch.options.catalogue import load_reference
from sgimd_torch.runs.signals import Stopping, returned
from sgimd_torch.spaces import Array, Demonstration, Failure, check_point
from sgimd_torch.texts import unknown_name_error

PATIENCE: Final = 0.06  # s in which a call whose packet is lost is tried again
PAUSE: Final = 0.01  # s between two tries
COOLER: Final = 5.0  # degrees C below ``heat`` at which movements go on
GENTLY: Final = 0.5  # share of ``speed`` on the way back to rest, and of first steps
FREE: Final = 0.1  # m, distance at which nothing is in the way of a first step
RESTED: Final = 0.5  # s after a first step when the joint is still
KEPT: Final = 0.9  # least share of the commands of ``rate`` that are sent without a warning
OF_MODEL: Final = ("joints", "low", "high", "rest", "durations", "n_knots", "servos", "keyframe", "posture")


class LeRobotArm:
    """Robot arm on the table, driven by LeRobot; its model file says what movements and outcomes are.

    The robot needs ``action_features`` with the names of its motors, ``is_connected``, ``connect()`` that switches
    torque on, ``get_observation()`` of positions by motor, ``send_action(positions)`` and ``disconnect()`` that
    switches torque off. A lost packet is an OSError. A ``bus``, of the robot or of each of its arms, is asked for
    temperatures, and switches torque off first, by one packet that waits for no answer.

    Args:
        robot: LeRobot's name of the robot, such as so101_follower, or package.module:function of yours that makes one.
        port: serial port of a robot of LeRobot, such as /dev/ttyACM0.
        robot_id: name under which LeRobot keeps the calibration of this robot.
        model: path of the MJCF or URDF file of the arm.
        outcome: comma-separated places of the model at the end of a movement, such as site:tip or body:puck:xy.
        seen_by: function (observation) -> outcome, such as camera:puck, that sees where the places really are; "" for
            forward kinematics of the measured joints. If it fails, the movement has failed, but torque stays on.
        units: units of the motors: rad, deg, or a range that maps onto the range of a joint, as in deg,gripper=0:100; a
            range such as 90:-110 is that of a motor that turns the other way.
        motors: names of the robot's motors, in the order of the joints; () for JOINT.pos or JOINT. Others hold still.
        outcome_noise: standard deviation of outcomes if a movement is repeated.
        settle: time (s) between the end of a movement and its outcome, and again at rest before the next movement.
        rate: commands per second.
        speed: highest speed of a command (rad/s).
        step: largest distance (rad) between a command and the measured position.
        tolerance: distance (rad) from the range of a joint at which it cannot be; a farther reading is a failure.
        stall: distance (rad) behind its command, beyond its steady error, at which a joint that does not move stalls.
        clearance: distance (m) from what stands still in the model within which no simulated way may come.
        patience: time (s) that a movement may last beyond its plan, and that a call of the driver may take.
        heat: highest temperature (degrees C) of a motor; a hotter one cools down, without torque, before it moves on.
        clock: object with ``monotonic()`` and ``sleep(seconds)``, by default the module ``time``.

    Raises:
        ValueError: the model or an option cannot be used.
        ImportError: LeRobot is not installed.
    """

    FOUND_OPTIONS: ClassVar = ("low", "high", "rest", "posture")
    at_once = 1

    @with_keywords_of(MujocoRobot, *OF_MODEL)
    def __init__(
        self,
        robot: str = "",
        *,
        port: str = "",
        robot_id: str = "",
        model: str | Path = "",
        outcome: str = "",
        seen_by: str = "",
        units: str = "",
        motors: tuple[str, ...] = (),
        outcome_noise: float = 0.005,
        settle: float = 0.5,
        rate: float = 50.0,
        speed: float = 3.0,
        step: float = 0.3,
        tolerance: float = 0.15,
        stall: float = 0.05,
        patience: float = 5.0,
        clearance: float = 0.02,
        heat: float = 60.0,
        clock: Any = time,
        **of_model: Any,
    ) -> None:
        limits = {"rate": rate, "speed": speed, "step": step, "heat": heat}
        for name, value in {**limits, "tolerance": tolerance, "stall": stall, "patience": patience}.items():
            if not 0 < value < np.inf:
                raise ValueError(f"{name} must be finite and above 0, got {value}")
        for name, text, example in (("robot", robot, "so101_follower"), ("units", units, "deg,gripper=0:100")):
            if not text:
                raise ValueError(f"{name} is missing, such as {example}")
        self._make = load_reference("robot", robot) if ":" in robot else partial(_of_lerobot, robot, port, robot_id)
        self._see = load_reference("seen_by", seen_by) if seen_by else None
        self.robot, self._buses = self._made()
        self._twin = twin = MujocoRobot(model, outcome=outcome, outcome_noise=outcome_noise, settle=settle, **of_model)
        self.contexts, self.outcomes, self.rest = twin.contexts, twin.outcomes, twin.rest
        self.outcome_noise, self.joints, self.within_reach = outcome_noise, twin.joints, twin.within_reach
        self.correspondence, self.files, self.remarks = twin.correspondence, twin.files, twin.remarks
        self.found_options = {name: twin.found_options[name] for name in self.FOUND_OPTIONS}
        self.primitive, ranges = twin.primitive, twin.primitive.ranges
        if not self.joints or ranges is None:
            raise ValueError(f"the actuators of {model} do not take positions of joints, as the motors of an arm do")
        if not seen_by and not twin.carries_outcome:
            raise ValueError(f"the joints do not say where {outcome} is; seen_by names a function that sees it")
        known = self.robot.action_features
        self._motors = [f"{name}.pos" if f"{name}.pos" in known else name for name in motors or self.joints]
        if missing := [name for name in self._motors if name not in known]:
            raise unknown_name_error("motor", missing[0], known, "; motors names one for each joint, in their order")
        if len(self._motors) != len(self.joints):
            raise ValueError(f"motors must name one for each of {', '.join(self.joints)}, got {', '.join(motors)}")
        reads = {motor: motor_unit(self._buses, motor.removesuffix(".pos")) for motor in self._motors}
        self._scales, self._shifts = scales_of(self.joints, units, ranges, reads)
        self.settle, self.rate, self.speed, self.step, self.heat = settle, rate, speed, step, heat
        self._clock, self._is_slow, self.patience, self._ranges = clock, False, patience, ranges
        self._touches = partial(touched_by, twin, speed, GENTLY * speed, clearance)
        self._way = partial(way_to_start, twin, GENTLY * speed, clearance)
        self.policies = Untouched(twin.policies.low, twin.policies.high, touches=self._touches)
        self._watch = Watch(self.joints, ranges, tolerance, stall, speed, step)
        self._command: Array | None = None  # the last one (rad); None: not connected
        check_robot(self)

    def observe(self, rng: np.random.Generator) -> Array:
        """``(0,)``, no context."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one movement, after which the arm goes back to rest; see `Environment`.

        Raises:
            NotExecutedError: the simulated way touches something; the arm has not moved, and its torque stays on.
            SimulationError: a joint stalls or reads what cannot be, the movement takes too long, a motor is hot, a
                signal came, or the outcome was not seen.
            OSError: the arm does not answer.
        """
        _, theta = check_movement(self, context, theta)
        if touched := self._touches(theta):
            raise NotExecutedError(f"not executed: {touched} would touch, or nearly")
        with self._torque_off_after_an_error():
            if self._command is None:
                lies = self._connect()
                if np.isinf(self._watch.delays).any():
                    self._try_joints(lies)
                self._follow(self._way(lies), GENTLY * self.speed, self.settle)
            self._follow(self._twin.commanded(theta), self.speed, self.settle)
            outcome = tried("outcome", self.outcomes.dim, self._outcome)
            self._follow(self._twin.start[None], GENTLY * self.speed, self.settle)
        if isinstance(outcome, Failure):
            raise SimulationError(f"the outcome was not seen: {outcome.reason}")
        return outcome

    def lead(self) -> Demonstration:
        """A movement that somebody leads by hand, with torque off, from now until the arm has moved and is still.

        Raises:
            ValueError: the robot has no bus whose torque can be switched off.
            SimulationError, OSError: a signal came, or the arm does not answer.
        """
        if not self._buses:
            raise ValueError("the robot has no bus with disable_torque(); record with its own program instead")
        with self._torque_off_after_an_error():
            self._connect()
            for bus in self._buses:
                bus.disable_torque()
            times, postures = led(self._look, self._clock, self.rate)
            outcome = self._outcome()
        self.release()
        return Demonstration(np.zeros(0), times, postures, outcome)

    def release(self) -> None:
        """Switch torque off and disconnect; the next movement connects again."""
        atexit.unregister(self.release)
        self._command = self._watch.last = None
        for bus in self._buses:
            self._error_of(bus, "sync_write", "Torque_Enable", 0)  # reaches motors that cannot answer, too
        errors = [error for bus in self._buses if (error := self._error_of(bus, "disable_torque"))]
        left = self._error_of(self.robot, "disconnect")
        if errors or left:  # this driver may believe for good that it is connected
            self.robot, self._buses = self._made()
        if left and (errors or not self._buses):
            warnings.warn(f"torque may be on, switch off the power: {left!r}", RuntimeWarning, stacklevel=2)

    def _made(self) -> tuple[Any, list[Any]]:
        robot = self._make()
        return robot, [part.bus for part in (robot, *vars(robot).values()) if hasattr(part, "bus")]

    @contextmanager
    def _torque_off_after_an_error(self) -> Iterator[None]:
        """A block of movements; after an error torque is off. A signal is handled when it is off."""
        self._stopping = Stopping("stopping; if the driver does not return, Ctrl-C once more switches torque off")
        try:
            with self._stopping:
                try:
                    yield
                except BaseException:
                    self.release()
                    raise
        finally:
            if self._stopping.heard:
                signal.raise_signal(self._stopping.heard)

    def _check_signal(self) -> None:
        if heard := self._stopping.heard:
            raise SimulationError(f"stopped by {signal.Signals(heard).name} in mid-movement; torque is off")

    def _connect(self) -> Array:
        """``(n_joints,)`` rad, where the arm lies."""
        atexit.register(self.release)
        if not self.robot.is_connected:
            self.robot.connect()
        observation, names = self._answer(self.robot.get_observation), self.robot.action_features
        self._held = {name: 0.0 if name.endswith(".vel") else observation[name] for name in names}
        self._command = self._ranges.clip(self._measured(observation))
        return self._command

    def _try_joints(self, back: Array) -> None:
        """Before the first movement, ask each joint for a small step there and ``back``, and see that it follows."""
        middle = (self._ranges.low + self._ranges.high) / 2
        self._follow(back[None], GENTLY * self.speed, RESTED)  # a joint that reads another frame moves now
        for k, step in enumerate(np.diag(np.minimum(FIRST, self._ranges.sides / 2) * np.where(back > middle, -1, 1))):
            steps = [joints for joints in (back + step, back - step) if self._ranges.contains(joints)]
            there = max(steps, key=partial(self._twin.gap, most=FREE))
            self._follow(there[None], GENTLY * self.speed, RESTED)
            self._watch.learn(k)
            self._follow(back[None], GENTLY * self.speed, RESTED)

    def _follow(self, commands: Array, speed: float, settle: float) -> None:
        """Play commands ``(n_steps, n_joints)`` (rad), one for each timestep of the model; settle at the last."""
        assert self._command is not None
        timestep, clock, ticks = self._twin.model.opt.timestep, self._clock, 0
        moving = np.flatnonzero((commands != commands[-1]).any(axis=1)).max(initial=-1)
        begun = then = due = away_at = clock.monotonic()
        self._watch.begin(begun, self._command)
        pause = LOOK if np.isinf(self._watch.delays).any() else np.inf
        whole = np.abs(np.diff(commands, axis=0, prepend=self._command[None])).sum(axis=0).max()
        longest = len(commands) * timestep + whole / speed + settle + self.patience
        while True:
            now, measured = clock.monotonic(), self._look()
            self._watch.see(now, measured)
            row = min(int((now - begun) / timestep), len(commands) - 1)
            if now - begun > longest:
                k = int(np.abs(measured - commands[row]).argmax())
                told = f"the movement has not ended after {longest:.1f} s: {self.joints[k]} reads {measured[k]:.3g} rad"
                raise SimulationError(f"{told} on its way to {commands[row, k]:.3g}; torque is off")
            way = speed * (now - then if ticks else 1 / self.rate)
            wanted = self._command + np.clip(commands[row] - self._command, -way, way)
            self._watch.command(now, wanted, np.abs(wanted - self._command))
            near = np.clip(wanted, measured - self.step, measured + self.step)
            # It may wait for the arm, but never goes back with it.
            self._command = np.clip(near, np.minimum(self._command, wanted), np.maximum(self._command, wanted))
            values = ((self._command - self._shifts) / self._scales).tolist()
            action = {**self._held, **dict(zip(self._motors, values, strict=True))}
            self._answer(partial(self.robot.send_action, action))
            ticks, then = ticks + 1, now
            if row <= moving or not np.allclose(self._command, commands[-1], atol=1e-6):
                away_at = now
            due = max(due + 1 / self.rate, clock.monotonic())
            while (left := due - clock.monotonic()) > 0:
                clock.sleep(min(left, pause))
                if left > pause:
                    self._watch.see(clock.monotonic(), self._look())
            if now - away_at >= settle:
                break
        self._watch.errors = np.maximum(self._watch.errors, np.abs(self._command - measured))
        self._cool_down()
        sent = (ticks - 1) / max(now - begun, 1e-9)
        if ticks > 1 and sent < KEPT * self.rate and not self._is_slow:
            self._is_slow = True
            told = f"the arm takes {sent:.0f} commands a second, not {self.rate:g}; movements keep their times"
            warnings.warn(f"{told} with fewer commands: --environment.rate", RuntimeWarning, stacklevel=2)

    def _cool_down(self) -> None:
        """If a motor is hot, wait without torque until all have cooled down; the movement has failed."""
        told, limit = "", self.heat
        while (hottest := max(self._temperatures(), default=(-np.inf, "")))[0] > limit:
            if not told:
                for bus in self._buses:
                    bus.disable_torque()
                limit -= COOLER
                told = f"{hottest[1]} is at {hottest[0]:g} degrees C, above {self.heat:g}; torque is off"
                warnings.warn(f"{told} until it has cooled down to {limit:g}", RuntimeWarning, stacklevel=2)
            self._check_signal()
            self._clock.sleep(1.0)
        if told:
            raise SimulationError(told)

    def _temperatures(self) -> Iterator[tuple[float, str]]:
        """The temperature (degrees C) of each motor, and its name, as far as the buses know them."""
        for bus in self._buses:
            with suppress(AttributeError, KeyError, NotImplementedError, TypeError, ValueError):
                known = self._answer(partial(bus.sync_read, "Present_Temperature", normalize=False))
                yield from ((degrees, motor) for motor, degrees in known.items())

    def _outcome(self) -> Array:
        """``(outcome_dim,)``, where the places are now."""
        observation = self._answer(self.robot.get_observation)
        return self._twin.outcome_at(self._measured(observation)) if self._see is None else self._see(observation)

    def _look(self) -> Array:
        """``(n_joints,)`` rad, unless a signal has come."""
        self._check_signal()
        return self._measured(self._answer(self.robot.get_observation))

    def _measured(self, observation: Mapping[str, Any]) -> Array:
        """``(n_joints,)`` rad."""
        values = [float(observation[motor]) for motor in self._motors]
        return self._watch.check(check_point("joints", self._scales * values + self._shifts, len(self.joints)))

    def _answer(self, call: Callable[[], Any]) -> Any:
        """The result of a call of the robot, which is tried again if a packet is lost."""
        begun = self._clock.monotonic()
        while True:
            try:
                return returned(call, self.patience)
            except OSError:
                if self._clock.monotonic() - begun > PATIENCE:
                    raise
            self._clock.sleep(PAUSE)

    def _error_of(self, part: Any, name: str, *given: Any) -> BaseException | None:
        """What a method of a part of the arm raises; also after Ctrl-C the other switches are still to be tried."""
        try:
            returned(lambda: getattr(part, name)(*given), self.patience)
        except BaseException as error:
            return error
        return None


def _of_lerobot(name: str, port: str, robot_id: str) -> Any:
    """The robot of LeRobot with this name."""
    try:
        from lerobot import robots  # an optional dependency
    except ImportError as error:
        wanted = "pip install 'sgimd-torch[arm]', in Python 3.12 or later"
        raise ImportError(f"{name} is a robot of LeRobot: {wanted} ({error})") from error
    for module in pkgutil.iter_modules(robots.__path__):  # each registers its robots; some need drivers of their own
        with suppress(ImportError):
            import_module(f"{robots.__name__}.{module.name}")
    known = robots.RobotConfig.get_known_choices()
    if name not in known:
        raise unknown_name_error("robot", name, known, "; or package.module:function")
    try:
        return robots.make_robot_from_config(known[name](port=port, id=robot_id or None))
    except TypeError as error:
        raise ValueError(f"{name} is not made by a port alone ({error}): write a function, mymodule:make") from error
