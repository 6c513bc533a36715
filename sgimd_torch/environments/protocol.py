"""The protocol of environments: observe a context, execute a movement, return its outcome.

Section 2.1 of Nguyen & Oudeyer (2014): M(c, theta) = tau. An environment of your own needs the seven members of
`Environment`: three boxes, ``rest``, ``outcome_noise``, ``observe`` and ``execute``.
    outcome = environment.execute(environment.observe(rng), theta, rng)
"""

from __future__ import annotations

import traceback
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, Protocol, TypeGuard, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box, Failure, check_point, check_vector, first_fall, read_only

MEMBERS: Final = ("contexts", "policies", "outcomes", "rest", "outcome_noise", "observe", "execute")


class Environment(Protocol):
    """A robot and its world. No state carries over from one movement to the next."""

    @property
    def contexts(self) -> Box:
        """C; its ``dim`` is 0 if all movements start in the same way."""
        ...

    @property
    def policies(self) -> Box:
        """Pi."""
        ...

    @property
    def outcomes(self) -> Box:
        """T, the space of goals. Outcomes may lie outside T."""
        ...

    @property
    def rest(self) -> Array:
        """tau_org ``(outcome_dim,)`` in T, the outcome of not moving."""
        ...

    @property
    def outcome_noise(self) -> float:
        """Standard deviation of each outcome dimension (in the unit of T) if a typical movement is repeated, or 0."""
        ...

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, the context of the next movement."""
        ...

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one movement, tau = M(c, theta); all noise comes from ``rng``.

        Raises:
            ValueError: ``context`` is not one point of C or ``theta`` is not one point of Pi; see `check_movement`.
            TypeError: ``rng`` is not a Generator.
            SimulationError: there is no finite outcome.
        """
        ...


@runtime_checkable
class BatchEnvironment(Environment, Protocol):
    """An environment that executes many movements faster together than one by one; see `moves_in_batches`."""

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, outcome_dim)``, row i equal to ``execute(contexts[i], thetas[i], rngs[i])`` bit for bit.

        A movement without an outcome has a row of NaN. An exception means that no movement has an outcome.
        """
        ...


@runtime_checkable
class Translating(Protocol):
    """An environment that can translate demonstrations."""

    def correspondence(self, times: Array, trajectory: Array) -> Array:
        """theta_d ``(theta_dim,)``, the policy that reproduces a demonstrated trajectory most closely, eq. (6).

        Args:
            times: ``(n_times,)`` s, increasing.
            trajectory: ``(n_times, n_joints)``, angles (rad) or commands.

        Raises:
            ValueError: this is no recording, see `check_recording`, or the robot cannot make such a movement.
        """
        ...


@runtime_checkable
class Replaying(Protocol):
    """An environment that can follow a recording sample by sample."""

    def replay(self, times: Array, trajectory: Array) -> Array:
        """``(outcome_dim,)``, without noise; ``times`` ``(n_times,)`` s from 0, ``trajectory`` ``(n_times, n_joints)``.

        Raises:
            ValueError: this is no recording, see `check_recording`.
            SimulationError: there is no finite outcome.
        """
        ...


class Primitive:
    """Translation of theta to joint angles (rad) or commands over time.

    The attribute ``primitive`` of an environment holds its primitive, so that recordings can be compared with the
    movements of the robot. A default value means that the value is unknown.

    Attributes:
        ranges: ``(n_joints,)`` box of the angles or commands.
        durations: durations (s) of the shortest and of the longest movement.
    """

    ranges: Box | None = None
    durations: tuple[float, float] = (0.0, np.inf)

    def at(self, theta: Array, times: Array) -> Array | None:
        """``(n_times, n_joints)`` angles or commands at ``times`` ``(n_times,)`` s after the start."""
        return None


@runtime_checkable
class FromFiles(Protocol):
    """An environment that is read from files.

    Attributes:
        files: files whose checksums a run keeps.
        remarks: sentences for the user.
        found_options: values of the options that the environment finds by movements if they are not given. A run keeps
            them in its settings, so they are found once. ``FOUND_OPTIONS`` of the class has their names.
    """

    files: Sequence[Path]
    remarks: Sequence[str]
    found_options: Mapping[str, Any]

    def within_reach(self) -> Array:
        """``(n, outcome_dim)``, outcomes all over what is within reach, always the same; none if that is not known."""
        ...


def primitive_of(environment: Environment) -> Primitive:
    """The primitive of an environment; a `Primitive` with the defaults if the environment has none."""
    primitive = getattr(environment, "primitive", None)
    return primitive if isinstance(primitive, Primitive) else Primitive()


FAILURES: Final = 10  # number of successive failed movements after which a run ends


class SimulationError(RuntimeError):
    """A movement failed and has no usable outcome; if ``theta`` ``(theta_dim,)`` is given, the message names it."""

    def __init__(self, reason: str, theta: Array | None = None) -> None:
        super().__init__(reason, theta)  # pickle needs both arguments to send the exception to another process
        self.reason, self.theta = reason, theta

    def __str__(self) -> str:
        return self.reason if self.theta is None else f"{self.reason}; theta={np.asarray(self.theta).tolist()}"


class NotExecutedError(SimulationError):
    """A movement was not executed, as it would do harm; the robot is well. It does not count towards ``FAILURES``."""


def beside_execute(environment: object, name: str) -> bool:
    """Whether the method ``name`` counts: it is defined beside ``execute`` or below it, so it is of the same robot.

    Else a subclass or a wrapper has its own ``execute``, and the method would give the outcomes of its parent.
    """
    layers = [getattr(environment, "__dict__", {}), *map(vars, type(environment).__mro__)]
    nearest = next((layer for layer in layers if name in layer or "execute" in layer), {name: None})
    return getattr(environment, name, None) is not None and name in nearest


def moves_in_batches(environment: object) -> TypeGuard[BatchEnvironment]:
    """Whether ``execute_many`` of the environment counts, see `beside_execute`."""
    return isinstance(environment, BatchEnvironment) and beside_execute(environment, "execute_many")


def observed(environment: Environment, rng: np.random.Generator) -> Array:
    """The context ``(context_dim,)`` that the environment observes; one outside C by rounding is clipped, and told.

    Raises:
        ValueError: it is not one point of C.
    """
    box = environment.contexts
    context = check_point("context", environment.observe(rng), box.dim)
    if box.contains(context):
        return context
    clipped = box.clip(context)
    if not box.same(context, clipped):
        box.check("context", context)
    warnings.warn("a context outside C by rounding was clipped; so are later ones", RuntimeWarning, stacklevel=2)
    return clipped


def tried(name: str, dim: int, robot: Callable[..., ArrayLike], *given: Any) -> Array | Failure:
    """Result of a call of the robot, as ``(dim,)`` finite numbers, read-only, or why there is none."""
    try:
        return read_only(check_point(name, robot(*given), dim))
    except (Exception, SystemExit) as error:  # no failure of a robot may end a run or an evaluation
        return Failure(reason_of(error), error)


def reason_of(error: BaseException) -> str:
    """Reason why a robot failed, in one line of at most 300 printable characters."""
    simulated = isinstance(error, SimulationError)
    said = str(error) if simulated else "".join(traceback.format_exception_only(error))
    return "".join(sign if sign.isprintable() else " " for sign in said)[:300].strip()


def execute_many(
    environment: Environment,
    contexts: Sequence[Array] | Array,
    thetas: Sequence[Array] | Array,
    rngs: Sequence[np.random.Generator],
) -> list[Array | Failure]:
    """The outcome ``(outcome_dim,)`` of each movement, or why it has none; the environment gets copies.

    A `BatchEnvironment` executes the movements together; if it raises, all of them have failed.

    Args:
        environment: environment of the movements.
        contexts: contexts in C.
        thetas: thetas in Pi.
        rngs: a stream for each movement, so that no outcome depends on other movements.
    """
    n, dim = len(thetas), environment.outcomes.dim
    if n > 1 and moves_in_batches(environment):
        try:
            outcomes: Any = environment.execute_many(np.array(contexts), np.array(thetas), rngs)
            if (shape := np.shape(outcomes)) != (n, dim):
                raise ValueError(f"execute_many() must give {n} outcomes in rows, ({n}, {dim}), got {shape}")
        except (Exception, SystemExit) as error:
            return [Failure(reason_of(error), error)] * n
        return [tried("outcome", dim, np.asanyarray, outcome) for outcome in outcomes]
    moves = zip(contexts, thetas, rngs, strict=True)
    return [tried("outcome", dim, environment.execute, c.copy(), theta.copy(), rng) for c, theta, rng in moves]


def check_movement(environment: Environment, context: ArrayLike, theta: ArrayLike) -> tuple[Array, Array]:
    """Check a movement at the start of ``execute``; the result is ``context`` and ``theta`` as float64.

    Raises:
        ValueError: a point has another shape, is not finite, or lies outside its box.
    """
    context = environment.contexts.check("context", context, "was theta passed first?")
    theta = environment.policies.check("theta", theta, "was a goal passed instead?")
    if not context.ndim == theta.ndim == 1:
        raise ValueError(f"execute() takes one movement, got {context.shape} and {theta.shape}; see execute_many()")
    return context, theta


def execute_one(environment: Environment, context: Array, theta: Array, rng: np.random.Generator) -> Array:
    """Outcome of one movement, checked as in a run.

    Raises:
        SimulationError: the movement has failed.
    """
    (outcome,) = execute_many(environment, [context], [theta], [rng])
    if isinstance(outcome, Failure):
        raise SimulationError(outcome.reason)
    return outcome


def check_recording(
    times: ArrayLike, trajectory: ArrayLike, columns: int, *, samples: int = 2, longest: float = np.inf
) -> tuple[Array, Array]:
    """Check a recording; the result is ``times`` ``(n_times,)`` and ``trajectory`` ``(n_times, columns)`` as float64.

    Raises:
        ValueError: shapes do not fit, there are fewer than ``samples`` rows, values are not finite, times do not
            increase, or the recording lasts longer than ``longest`` s.
    """
    trajectory = check_vector("trajectory", trajectory, columns, "one column for each joint or command")
    if trajectory.ndim != 2 or len(trajectory) < samples:
        raise ValueError(f"trajectory needs {samples} samples or more in rows, got shape {trajectory.shape}")
    times = check_point(
        "times", check_vector("times", times, len(trajectory), "one in s for each row"), len(trajectory)
    )
    if fall := first_fall(times):
        raise ValueError(f"times must increase, but sample {fall[0]} {fall[1]}")
    lasts = times[-1] - times[0]
    if lasts > longest * (1 + 1e-9):
        raise ValueError(
            f"a movement lasts {longest:g} s at most, the recording {lasts:g} s; is it in milliseconds? --speed of "
            "sgimd demonstrations plays a slow recording faster"
        )
    return times, trajectory


def check_instance(environment: object) -> None:
    """Refuse an object that is no environment, for example a class instead of an instance.

    Raises:
        ValueError: ``environment`` is a class, or lacks a member.
    """
    if isinstance(environment, type):
        name = environment.__name__
        raise ValueError(f"an environment is wanted, got the class {name} itself; write {name}()")
    name, missing = type(environment).__name__, [member for member in MEMBERS if not hasattr(environment, member)]
    if len(missing) == len(MEMBERS):
        raise ValueError(f"an environment is wanted, got a {name}; is the order of arguments right?")
    if missing:
        raise ValueError(f"{name} has no {', '.join(missing)}; an environment has {', '.join(MEMBERS)}")


def check_robot(environment: Environment) -> None:
    """Refuse an environment with a missing member, an invalid ``rest`` or an invalid ``outcome_noise``.

    Raises:
        ValueError: ``environment`` is a class or lacks a member, ``rest`` is not one point of T, or ``outcome_noise``
            is negative or not finite.
    """
    check_instance(environment)
    if environment.outcomes.check("rest of the environment", environment.rest, "is it a theta?").ndim != 1:
        raise ValueError(f"rest of the environment must be one outcome, got shape {np.shape(environment.rest)}")
    noise: Any = environment.outcome_noise
    if not isinstance(noise, int | float | np.number) or not 0 <= noise < np.inf:
        wanted = "a standard deviation, finite and >= 0"
        raise ValueError(f"outcome_noise of the environment must be {wanted}, got {noise!r}")
