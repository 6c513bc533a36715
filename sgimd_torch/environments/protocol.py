"""The protocol of environments: observe a context, execute a movement, return its outcome.

Section 2.1 of Nguyen & Oudeyer (2014): M(c, theta) = tau. An environment of your own needs the seven members of
`Environment`: three boxes, ``rest``, ``outcome_noise``, ``observe`` and ``execute``.
    outcome = environment.execute(environment.observe(rng), theta, rng)
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.spaces import Array, Box, check_point, check_vector, first_entry, read_only

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
        """T, the space of goals. Outcomes may lie outside it."""
        ...

    @property
    def rest(self) -> Array:
        """tau_org ``(outcome_dim,)`` in T, the outcome of not moving."""
        ...

    @property
    def outcome_noise(self) -> float:
        """Typical standard deviation (m), per dimension, of the outcomes of one movement; 0 if it has no noise."""
        ...

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, the context of the next movement."""
        ...

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(outcome_dim,)``, the outcome of one movement, tau = M(c, theta); all noise comes from ``rng``.

        Raises:
            ValueError: ``context`` is not one point of C or ``theta`` is not one point of Pi; see `check_movement`.
            SimulationError: there is no finite outcome.
        """
        ...


@runtime_checkable
class BatchEnvironment(Environment, Protocol):
    """An environment that executes many movements faster together than one by one."""

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, outcome_dim)``, row i equal to ``execute(contexts[i], thetas[i], rngs[i])`` bit for bit.

        A movement without an outcome has a row of NaN. An exception means that no movement has an outcome.
        """
        ...


@runtime_checkable
class Limited(Protocol):
    """An environment that cannot make any number of movements at once, such as the driver of a single robot."""

    @property
    def at_once(self) -> int:
        """Largest number of movements at once."""
        ...


class Primitive:
    """How theta becomes joint angles (rad) or commands over time.

    A robot whose primitive is known has it as attribute ``primitive``, so that recordings can be compared with what the
    robot plays. The defaults mean that a value is unknown.

    Attributes:
        ranges: ``(n_joints,)`` box of the angles or commands.
        durations: shortest and longest movement (s).
    """

    ranges: Box | None = None
    durations: tuple[float, float] = (0.0, np.inf)

    def at(self, theta: Array, times: Array) -> Array | None:
        """``(n_times, n_joints)`` angles or commands at ``times`` ``(n_times,)`` s after the start."""
        return None


@runtime_checkable
class HasPrimitive(Protocol):
    """A robot that says how it plays a theta."""

    @property
    def primitive(self) -> Primitive:
        """The primitive that plays the movements of this robot."""
        ...


def primitive_of(environment: Environment) -> Primitive:
    """The primitive of an environment; a `Primitive` with the defaults if the environment has none."""
    found = environment.primitive if isinstance(environment, HasPrimitive) else None
    return found if isinstance(found, Primitive) else Primitive()


class Trace(Protocol):
    """A movement that can be filmed: a `Sketch`, or the `RodTrace` of the fishing rod."""

    @property
    def outcome(self) -> Array:
        """``(outcome_dim,)``, equal to that of ``execute`` with an equal stream."""
        ...

    @property
    def landed(self) -> float:
        """Time (s) when the outcome is reached."""
        ...


@dataclass(frozen=True, eq=False)
class Sketch:
    """A movement as a drawing for `sgimd film`: the result of ``trace(context, theta, rng)``, an optional method of an
    environment.

    Args:
        outcome: ``(outcome_dim,)``, equal to that of ``execute`` with an equal stream. The first two dimensions are
            places in the drawing; if T has only one, y is 0.
        step: time between two drawings (s).
        chains: ``(n_steps, n_points, 2)``, the robot as points joined by lines; a single point is a ball. The last
            point leaves a path.

    Raises:
        ValueError: other shapes, numbers that are not finite, or a step that is not above 0.
    """

    outcome: Array
    step: float
    chains: Array

    def __post_init__(self) -> None:
        for name, axes, wanted in (("outcome", 1, "(outcome_dim,)"), ("chains", 3, "(n_steps, n_points, 2)")):
            value = np.asarray(getattr(self, name))
            numbers = value.size > 0 and value.dtype.kind in "iuf" and np.isfinite(value).all()
            if not numbers or value.ndim != axes or (name == "chains" and value.shape[2] != 2):
                raise ValueError(f"{name} of a Sketch must be finite numbers {wanted}, got shape {value.shape}")
            object.__setattr__(self, name, read_only(value.astype(np.float64)))
        if not 0 < self.step < np.inf:
            raise ValueError(f"step of a Sketch must be above 0 s, got {self.step}")

    @property
    def landed(self) -> float:
        """Duration (s) of the movement."""
        return self.step * (len(self.chains) - 1)


Tracer = Callable[[Array, Array, np.random.Generator], Trace]
"""(context, theta, rng) -> the movement, to be filmed."""

FAILURES: Final = 10
"""Number of failed movements in a row that end a run."""


class SimulationError(RuntimeError):
    """A movement without usable outcome: ``SimulationError("diverged")``, or with its ``theta`` ``(theta_dim,)``."""

    def __init__(self, reason: str, theta: Array | None = None) -> None:
        super().__init__(reason, theta)  # args rebuild the error in another process
        self.reason, self.theta = reason, theta

    def __str__(self) -> str:
        return self.reason if self.theta is None else f"{self.reason}; theta={np.asarray(self.theta).tolist()}"


def execute_many(
    environment: Environment, contexts: ArrayLike, thetas: ArrayLike, rngs: Sequence[np.random.Generator]
) -> Array:
    """Execute many movements: together if the environment can, else one by one, with equal outcomes.

    Args:
        environment: environment of the movements; a `BatchEnvironment` is called once for all movements.
        contexts: ``(n, context_dim)`` in C.
        thetas: ``(n, theta_dim)`` in Pi.
        rngs: n streams, one for each movement, so that no outcome depends on other movements of the batch.

    Returns:
        ``(n, outcome_dim)``, row i equal to ``environment.execute(contexts[i], thetas[i], rngs[i])`` bit for bit.

    Raises:
        ValueError: the numbers of rows differ, a row lies outside C or Pi, or the environment does not return numbers
            of this shape.
        SimulationError: a movement has no finite outcome.
    """
    # Copies, so that an environment may write into them.
    contexts = environment.contexts.check("contexts", contexts).copy()
    thetas = environment.policies.check("thetas", thetas, "were goals passed instead?").copy()
    if not contexts.ndim == thetas.ndim == 2 or not len(contexts) == len(thetas) == len(rngs):
        raise ValueError(f"needs n contexts, thetas, rngs, got {contexts.shape}, {thetas.shape} and {len(rngs)} rngs")
    if len(thetas) == 0:
        return np.empty((0, environment.outcomes.dim))
    dim = environment.outcomes.dim
    if isinstance(environment, BatchEnvironment):
        outcomes = _numbers("execute_many()", environment.execute_many(contexts, thetas, rngs), len(thetas), dim)
    else:
        moved = [environment.execute(*movement) for movement in zip(contexts, thetas, rngs, strict=True)]
        outcomes = np.stack([_numbers(f"execute() of movement {k}", each, dim) for k, each in enumerate(moved)])
    lost = np.flatnonzero(~np.isfinite(outcomes).all(axis=1))
    if len(lost):
        raise SimulationError("the outcome is not finite", thetas[lost[0]])
    return outcomes


def _numbers(what: str, value: Any, *shape: int) -> Array:
    array = np.asarray(value)
    if array.shape != shape or array.dtype.kind not in "fiu":
        got = type(value).__name__ if array.ndim == 0 else f"{array.dtype} {array.shape}"
        raise ValueError(f"{what} must give numbers of shape {shape}, got {got}; is there a return?")
    return array.astype(np.float64)


def traced(environment: Environment, trace: Tracer, context: Array, theta: Array, rng: np.random.Generator) -> Trace:
    """The result of ``trace``, the optional method of ``environment``, checked.

    Raises:
        ValueError: ``trace`` fails, or its result cannot be drawn.
    """
    name, dim = type(environment).__name__, environment.outcomes.dim
    try:
        found = trace(context, theta, rng)
    except Exception as error:  # code of the user may raise anything
        raise ValueError(f"trace() of {name} failed: {type(error).__name__}: {error}") from error
    if hasattr(found, "states"):  # the RodTrace of the fishing rod
        return found
    if not isinstance(found, Sketch) or len(found.outcome) != dim:
        what = f"one of {len(found.outcome)}" if isinstance(found, Sketch) else type(found).__name__
        wanted = f"a Sketch with an outcome of {dim} dimension{'s' * (dim != 1)}"
        raise ValueError(f"trace() of {name} must give {wanted}, got {what}")
    return found


def check_movement(environment: Environment, context: ArrayLike, theta: ArrayLike) -> tuple[Array, Array]:
    """One point of C and one point of Pi, as float64; ``execute`` of an environment calls this function first.

    Raises:
        ValueError: another shape, NaN or infinity, or a point outside its box.
    """
    context = environment.contexts.check("context", context, "was theta passed first?")
    theta = environment.policies.check("theta", theta, "was a goal passed instead?")
    if not context.ndim == theta.ndim == 1:
        raise ValueError(f"execute() takes one movement, got {context.shape} and {theta.shape}; see execute_many()")
    return context, theta


def check_recording(
    times: ArrayLike, trajectory: ArrayLike, columns: int, *, samples: int = 2, longest: float = np.inf
) -> tuple[Array, Array]:
    """A recording as float64: ``(n_times,)`` s, and ``(n_times, columns)`` angles or commands.

    Raises:
        ValueError: shapes that do not fit, fewer than ``samples`` rows, values that are not finite, times that do not
            increase, or a recording that lasts longer than ``longest`` s.
    """
    trajectory = check_vector("trajectory", trajectory, columns, "one column for each joint or command")
    if trajectory.ndim != 2 or len(trajectory) < samples:
        raise ValueError(f"trajectory needs {samples} samples or more in rows, got shape {trajectory.shape}")
    times = check_point(
        "times", check_vector("times", times, len(trajectory), "one in s for each row"), len(trajectory)
    )
    falls = np.diff(times, prepend=-np.inf) <= 0
    if falls.any():
        raise ValueError(
            f"times must increase from sample to sample, but {first_entry(times, falls)}; were rows shuffled?"
        )
    lasts = times[-1] - times[0]
    if lasts > longest * (1 + 1e-9):
        raise ValueError(
            f"a movement lasts {longest:g} s at most, the recording {lasts:g} s; is it in milliseconds? To "
            "play a slow recording faster, scale its times down"
        )
    return times, trajectory


def check_instance(environment: object) -> None:
    """Refuse a class, or another object, in place of an environment.

    Raises:
        ValueError: ``environment`` is a class, or lacks a member.
    """
    if isinstance(environment, type):
        name = environment.__name__
        raise ValueError(f"an environment is wanted, got the class {name} itself; write {name}()")
    name, missing = type(environment).__name__, [each for each in MEMBERS if not hasattr(environment, each)]
    if len(missing) == len(MEMBERS):
        raise ValueError(f"an environment is wanted, got a {name}; is the order of arguments right?")
    if missing:
        raise ValueError(f"{name} has no {', '.join(missing)}; an environment has {', '.join(MEMBERS)}")


def check_robot(environment: Environment) -> None:
    """Refuse an environment that lacks a member or whose rest or noise makes no sense, before a learner is built.

    Raises:
        ValueError: a class, a missing member, a rest that is not one point of T, or a noise that is negative or not
            finite.
    """
    check_instance(environment)
    if environment.outcomes.check("rest of the environment", environment.rest, "is it a theta?").ndim != 1:
        raise ValueError(f"rest of the environment must be one outcome, got shape {np.shape(environment.rest)}")
    noise: Any = environment.outcome_noise
    if not isinstance(noise, int | float | np.number) or not 0 <= noise < np.inf:
        wanted = "a standard deviation, finite and >= 0"
        raise ValueError(f"outcome_noise of the environment must be {wanted}, got {noise!r}")
