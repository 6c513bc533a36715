"""Spaces, episodes and random streams: the types that all other modules share.

Section 2.1 of Nguyen & Oudeyer (2014): contexts c in C, policies theta in Pi, outcomes tau in T, and the
learning episode (context, policy, outcome). This module imports only numpy.
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Generator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_LARGEST: Final = 1e100  # largest absolute value accepted; squared distances between such values do not overflow


def stream(seed: int, name: str, index: int | None = None) -> np.random.Generator:
    """A separate random stream for each use, so that removing one part does not change the draws of other parts.

    Args:
        seed: seed of the run, >= 0.
        name: use of the draws, such as ``"environment"``, ``"goals"``, ``"search"`` or ``"teacher"``.
        index: number of the stream if several streams have this name, such as the number of a movement; None for a
            single stream.

    Raises:
        ValueError: the seed or the index is not a whole number >= 0.
    """
    words = _words_of_name(check_count("seed", seed, 0), name)
    if index is not None:
        # 256 separates the index from the name, because no byte of the name is as large.
        end = np.array([256, *_words(check_count("index", index, 0))], dtype=np.uint32)
        words = np.concatenate((words, end))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


@lru_cache
def _words_of_name(seed: int, name: str) -> NDArray[np.uint32]:
    """The 32-bit words that ``SeedSequence(seed, spawn_key=name.encode())`` mixes; it mixes an array of them faster."""
    words = _words(seed)
    return np.array([*words, *[0] * (4 - len(words)), *name.encode()], dtype=np.uint32)


def _words(number: int) -> list[int]:
    """The 32-bit words of a number, the lowest first."""
    if number < 2**32:
        return [number]
    return [number >> shift & 0xFFFFFFFF for shift in range(0, number.bit_length(), 32)]


def check_vector(name: str, value: ArrayLike, dim: int, hint: str = "") -> Array:
    """``value`` as float64 of shape ``(..., dim)``, every entry finite and at most 1e100 in size.

    Raises:
        ValueError: ``value`` is not an array of real numbers (complex numbers, text, True and False, dates and masked
            arrays are refused), has another last axis, or an entry that is not finite or beyond 1e100.
    """
    # Nearly all calls end here. If a number is above 1e100 or not finite, the sum of squares is above 1e199 or NaN.
    if type(value) is np.ndarray and value.dtype == np.float64 and value.shape[-1:] == (dim,):
        with_itself = np.vdot(value, value)
        if with_itself < 1e199:
            return value
    hint = f"; {hint}" if hint else ""
    wanted = f"{name} must be real numbers of shape (..., {dim})"
    parts = value if isinstance(value, list | tuple) else (value,)
    if any(isinstance(part, np.ma.MaskedArray) for part in parts):  # numpy would take what it hides
        raise ValueError(f"{wanted}, got a masked array {_in_short(value)}{hint}")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{wanted}, got {_in_short(value)}{hint}") from error
    if array.dtype.kind not in "fiu":
        raise ValueError(f"{wanted}, got {array.dtype} {_in_short(value)}{hint}")
    if array.ndim == 0 or array.shape[-1] != dim:
        raise ValueError(f"{name} must have shape (..., {dim}), got {array.shape}{hint}")
    array = array.astype(np.float64, copy=False)
    usable = np.abs(array) <= _LARGEST  # False for NaN
    if not usable.all():
        raise ValueError(f"{name} must be finite and within +-{_LARGEST:g}, but {first_entry(array, ~usable)}{hint}")
    return array


def check_point(name: str, value: ArrayLike, dim: int, hint: str = "") -> Array:
    """``value`` as float64 of shape ``(dim,)``: one context, theta, goal or outcome.

    Raises:
        ValueError: ``value`` holds several points, or `check_vector` refuses it.
    """
    array = check_vector(name, value, dim, hint)
    if array.ndim != 1:
        raise ValueError(f"{name} must have shape ({dim},), got {array.shape}; only one at a time")
    return array


def check_count(name: str, value: object, least: int, most: float = np.inf) -> int:
    """``value``, a whole number of Python or numpy from ``least`` to ``most``, as int.

    Raises:
        ValueError: any other value, True and False included.
    """
    if not isinstance(value, int | np.integer) or isinstance(value, bool) or not least <= value <= most:
        wanted = f">= {least}" if most == np.inf else f"from {least} to {most}"
        raise ValueError(f"{name} must be a whole number {wanted}, got {_in_short(value)}")
    return int(value)


def check_rng(rng: object) -> None:
    """Refuse anything but a random stream, before the first draw.

    Raises:
        TypeError: ``rng`` is not a Generator.
    """
    if not isinstance(rng, np.random.Generator):
        hint = "was the seed passed instead of a Generator, such as stream(seed, name)?"
        raise TypeError(f"rng must be a numpy.random.Generator, got {type(rng).__name__}; {hint}")


def first_entry(array: Array, wrong: NDArray[np.bool_]) -> str:
    """Text for a message: the first ``wrong`` entry of ``array``, and the number of other wrong entries."""
    entries = np.argwhere(wrong)
    more = f" (and {len(entries) - 1} more)" if len(entries) > 1 else ""
    return f"entry {entries[0].tolist()} is {array[tuple(entries[0])]}{more}"


def first_fall(times: Array) -> tuple[int, str] | None:
    """Number of the first of ``times`` ``(n_times,)`` (s) that is not above the one before, and why; None: all are."""
    falls = np.flatnonzero(np.diff(times) <= 0)
    if not len(falls):
        return None
    k = int(falls[0]) + 1
    if times[k] < times[k - 1]:
        return k, f"is at {times[k]:.12g} s, after {times[k - 1]:.12g} s; were rows shuffled?"
    same = f"is at {times[k]:.12g} s, as the one before"
    if len(falls) <= max(1, len(times) / 4):
        return k, f"{same}; was it written twice?"
    return k, f"{same}, and so are {len(falls) - 1} more; are times epochs in float32, or whole seconds?"


def _in_short(value: object) -> str:
    return " ".join(reprlib.repr(value).split())


_TURNS: Final = {"rad": 2 * math.pi, "deg": 360.0, "degrees": 360.0, "°": 360.0, "turns": 1.0}  # one turn in each unit
ROUNDING: Final = 1e-6
"""Largest difference of two points that counts as rounding, relative to the sides of their box."""


@dataclass(frozen=True, eq=False)
class Box:
    """An axis-aligned box: C, Pi or T. The number of dimensions may be 0, as for C of the fishing task.

    Args:
        low: ``(dim,)`` lower corner.
        high: ``(dim,)`` upper corner, above ``low`` in every dimension.
        names: names of the dimensions, for axes, columns and messages; () for none.
        unit: unit of all dimensions, such as "m"; "" for none.
        periodic: whether each dimension wraps, such as a heading, whose side is then a whole turn; () for none. Only
            outcomes may wrap: contexts and parameters are given as cosine and sine.

    Raises:
        ValueError: the corners differ in shape, are not finite or not in order, the number of names is wrong, or a
            periodic side is no whole turn in its unit.
    """

    low: Array
    high: Array
    names: tuple[str, ...] = ()
    unit: str = ""
    periodic: tuple[bool, ...] = ()

    def __post_init__(self) -> None:
        low, high = np.array(self.low, dtype=np.float64), np.array(self.high, dtype=np.float64)
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"Box needs two corners of shape (dim,), got {low.shape} and {high.shape}")
        endless = np.flatnonzero(~np.isfinite(low) | ~np.isfinite(high))
        if len(endless):
            k = endless[0]
            more = f" (and {len(endless) - 1} more)" if len(endless) > 1 else ""
            raise ValueError(
                f"Box needs finite corners, but dimension {k} is [{low[k]}, {high[k]}]{more}; is it a space without "
                "bounds, for example of actions? Choose bounds for it"
            )
        if not (low < high).all():
            still = np.flatnonzero(low == high)
            hint = f"dimension {still[0]} cannot vary, so leave it out" if len(still) else "were they swapped?"
            raise ValueError(f"Box needs corners with low < high, got {low} and {high}; {hint}")
        given: Any = self.names
        names = tuple(given)
        texts = all(isinstance(text, str) and text.isprintable() for text in (*names, self.unit))
        if isinstance(given, str) or len(names) not in (0, len(low)) or not texts:
            wanted = "all texts without control characters"
            raise ValueError(f"Box needs {len(low)} names and a unit, {wanted}, got {given!r} and {self.unit!r}")
        object.__setattr__(self, "names", names)
        wraps = tuple(map(bool, self.periodic))
        if len(wraps) not in (0, len(low)):
            raise ValueError(f"Box needs {len(low)} values of periodic, got {self.periodic}")
        turn = _TURNS.get(self.unit)
        for k in np.flatnonzero(wraps):
            if turn is not None and not math.isclose(high[k] - low[k], turn, rel_tol=1e-6):
                raise ValueError(
                    f"dimension {k} wraps, so its side must be a whole turn, {turn:.9g} {self.unit}, got "
                    f"[{low[k]}, {high[k]}]; is it in another unit, or not periodic?"
                )
        object.__setattr__(self, "periodic", wraps if any(wraps) else ())
        for name, corner in (("low", low), ("high", high)):
            corner.flags.writeable = False
            object.__setattr__(self, name, corner)

    @classmethod
    def cube(cls, low: float, high: float, dim: int, *, names: tuple[str, ...] = (), unit: str = "") -> Box:
        """``[low, high]^dim``."""
        return cls(np.full(dim, low), np.full(dim, high), names, unit)

    @property
    def dim(self) -> int:
        """Number of dimensions."""
        return len(self.low)

    @property
    def sides(self) -> Array:
        """``(dim,)``, lengths of the sides."""
        return self.high - self.low

    def axis(self, k: int, kind: str = "outcome") -> str:
        """The name of dimension ``k``: "x (m)", or "outcome 0" if there are no names."""
        return self.in_unit(self.names[k] if self.names else f"{kind} {k}")

    def in_unit(self, quantity: str) -> str:
        """The quantity with its unit: "error (m)", or "error" if there is no unit."""
        return f"{quantity} ({self.unit})" if self.unit else quantity

    def amount(self, value: float, form: str = ".3g") -> str:
        """The value with its unit: "0.12 m", or "0.12" if there is no unit."""
        return f"{value:{form}} {self.unit}".rstrip()

    def wrapped(self, points: Array) -> Array:
        """``(..., dim)``, the same points, periodic dimensions within the box."""
        if not self.periodic:
            return points
        outside = (points < self.low) | (points > self.high)
        return np.where(outside & self.periodic, self.low + (points - self.low) % self.sides, points)

    def unwrapped(self, points: Array, around: Array) -> Array:
        """``(..., dim)``, the same points, periodic dimensions at most half a turn from ``around`` ``(..., dim)``."""
        if not self.periodic:
            return points
        return np.where(self.periodic, points - np.round((points - around) / self.sides) * self.sides, points)

    def distance(self, points: Array, point: Array) -> Any:
        """``(...)``, distances of ``points`` ``(..., dim)`` to a ``point``, across the seam if that is shorter."""
        return np.linalg.norm(self.unwrapped(points, point) - point, axis=-1)

    def on_circles(self, points: Array) -> Array:
        """``(..., dim + number of periodic dimensions)``: each periodic dimension as cosine and sine, on a circle as
        long as a turn. So distances of near points stay the same, also across the seam."""
        if not self.periodic:
            return points
        radii = self.sides[[*self.periodic]] / (2 * np.pi)
        angles = points[..., [*self.periodic]] / radii
        straight = points[..., [not wraps for wraps in self.periodic]]
        return np.concatenate((straight, radii * np.cos(angles), radii * np.sin(angles)), axis=-1)

    def allows(self, point: Array) -> bool:
        """Whether a robot would execute the movement ``point`` ``(dim,)`` of this Pi, as far as is known before."""
        return True

    def sample(self, rng: np.random.Generator) -> Array:
        """``(dim,)``, a uniform point."""
        return self.low + self.sides * rng.random(self.dim)  # several times faster than rng.uniform, with equal draws

    def clip(self, points: ArrayLike) -> Array:
        """``(..., dim)``, the nearest points inside."""
        return np.minimum(np.maximum(points, self.low), self.high)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """``(...)``, whether each of the points ``(..., dim)`` lies inside, the border included."""
        points = np.asarray(points, dtype=np.float64)
        return np.logical_and.reduce((points >= self.low) & (points <= self.high), axis=-1)

    def same(self, points: ArrayLike, point: ArrayLike) -> NDArray[np.bool_]:
        """``(...)``, whether each of ``points`` ``(..., dim)`` equals ``point`` ``(dim,)`` but for rounding.

        Rounding is at most a millionth of each side: other processors and versions compute answers alike to this bound.
        """
        return np.asarray((np.abs(np.subtract(points, point)) <= ROUNDING * self.sides).all(axis=-1))

    def check(self, name: str, points: ArrayLike, hint: str = "") -> Array:
        """``points`` as float64 ``(..., dim)``, all inside; periodic dimensions are wrapped.

        Raises:
            ValueError: another shape, a value that is not finite, or a point outside.
        """
        array = self.wrapped(check_vector(name, points, self.dim, hint))
        if not ((array >= self.low) & (array <= self.high)).all():
            outside = (array < self.low) | (array > self.high)
            k = np.argwhere(outside)[0, -1]
            entry = f"{first_entry(array, outside)}, outside [{self.low[k]}, {self.high[k]}]"
            raise ValueError(f"{name} must lie in its box, but {entry}; was it scaled already?")
        return array


@dataclass(frozen=True, eq=False)
class Move:
    """A proposed movement ``theta`` ``(theta_dim,)`` for a ``goal`` ``(outcome_dim,)``, which is None when babbling.

    ``origin`` names the regime ("babble", "global", "local", "imitate"), for analysis only. Arrays are read-only
    copies.
    """

    theta: Array
    goal: Array | None
    origin: str

    def __post_init__(self) -> None:
        _own(self, "theta", "goal")


class Failure(NamedTuple):
    """A movement without an outcome, the ``reason`` why it has none, and the exception behind the reason."""

    reason: str
    cause: BaseException | None = None


class Estimate(NamedTuple):
    """The answer of an inverse model to a goal in a ``context`` ``(context_dim,)``: ``theta`` ``(theta_dim,)``, and
    exemplars at which a search may begin, ``thetas`` ``(k, theta_dim)`` with ``outcomes`` ``(k, outcome_dim)``.

    ``expected`` ``(outcome_dim,)`` is the outcome that the inverse model expects of theta, and ``sd`` the standard
    deviation from it, one for all dimensions, noise included, in the unit of T; None: the inverse model does not know.
        estimate = learner.inverse(context, goal); estimate.expected, estimate.expected_error(goal)
    """

    theta: Array
    thetas: Array
    outcomes: Array
    context: Array = np.zeros(0)
    expected: Array | None = None
    sd: float | None = None

    @property
    def expected_deviation(self) -> float:
        """Mean distance of the outcome of theta from ``expected``, in the unit of T; NaN: unknown."""
        dim = self.outcomes.shape[1]
        chi = math.sqrt(2) * math.exp(math.lgamma((dim + 1) / 2) - math.lgamma(dim / 2))  # its mean
        return math.nan if self.sd is None else chi * self.sd

    def expected_error(self, goal: Array) -> float:
        """Expected distance of the outcome of theta from ``goal`` ``(outcome_dim,)``, in the unit of T; NaN: unknown.

        It is exact if the outcome is expected at the goal, or is certain; else it is too large by at most a tenth.
        """
        return (
            math.nan if self.expected is None else math.hypot(math.dist(self.expected, goal), self.expected_deviation)
        )


@dataclass(frozen=True, eq=False)
class Demonstration:
    """A demonstration (c_d, zeta_d, tau_d), as read-only copies.

    Args:
        context: ``(context_dim,)``.
        times: ``(n_times,)`` s, increasing.
        trajectory: ``(n_times, n_joints)``, joint angles (rad) or commands at ``times``.
        outcome: ``(outcome_dim,)``, demonstrated outcome.

    Raises:
        ValueError: an array has another shape or is not finite, or times do not increase.
    """

    context: Array
    times: Array
    trajectory: Array
    outcome: Array

    def __post_init__(self) -> None:
        shape = np.shape(self.trajectory)
        if len(shape) != 2 or np.shape(self.times) != shape[:1]:
            raise ValueError(
                "a demonstration needs times (n_times,) and a trajectory (n_times, n_joints), got shapes "
                f"{np.shape(self.times)} and {shape}; is a row missing, or the trajectory transposed?"
            )
        for name in ("context", "times", "trajectory", "outcome"):
            value = np.atleast_1d(getattr(self, name))
            check_vector(f"{name} of a demonstration", value, value.shape[-1], "did the recording drop samples?")
        if fall := first_fall(self.times):
            raise ValueError(f"times of a demonstration must increase, but sample {fall[0]} {fall[1]}")
        _own(self, "context", "times", "trajectory", "outcome")


@dataclass(frozen=True, eq=False)
class Request:
    """A learner's request to the teacher with the name ``teacher`` for a demonstration of ``goal`` ``(outcome_dim,)``.
    ``strategy`` is the name of the strategy that would use the demonstration, for analysis only."""

    teacher: str
    goal: Array
    strategy: str = ""

    def __post_init__(self) -> None:
        _own(self, "goal")


class Lesson(NamedTuple):
    """The reply to a `Request`: a demonstration, and its translation ``theta_d`` ``(theta_dim,)``, eq. (6)."""

    theta_d: Array
    demonstration: Demonstration


@dataclass(frozen=True, eq=False)
class Episode:
    """A learning episode (context, policy, outcome) and its causes; arrays are read-only copies.

    Args:
        index: number of the movement, from 0.
        context: ``(context_dim,)``.
        move: movement of the learner; None if it rested.
        outcome: ``(outcome_dim,)``; None if the learner rested or the movement failed.
        demonstration: demonstration just before the movement; None if there was none.
        request: request just before the movement; None if there was none.
        reply: reply to the request: "shown", "nothing", "again" (shown before), "failed" or "timed out".
        failed: reason why the movement failed; "" if it did not.
    """

    index: int
    context: Array
    move: Move | None
    outcome: Array | None
    demonstration: Demonstration | None
    request: Request | None = None
    reply: str = ""
    failed: str = ""

    def __post_init__(self) -> None:
        _own(self, "context", "outcome")


def _own(new: Move | Demonstration | Request | Episode, *names: str) -> None:
    """Replace arrays of a new object by read-only copies, so that changes of the original arrays do not matter."""
    for name in names:
        value = getattr(new, name)
        if value is not None:
            object.__setattr__(new, name, read_only(value))


def rounded(length: float) -> float:
    """The least 1, 2 or 5 times a power of ten that is not below ``length``."""
    power = 10.0 ** np.floor(np.log10(length))
    return float(power * next(k for k in (1, 2, 5, 10) if power * k >= length))


def read_only(value: ArrayLike) -> Array:
    """A copy that cannot be written into."""
    array = np.array(value)
    array.flags.writeable = False
    return array


Attempt = Generator[Move | None, Array, None]
"""Generator of movements, which is sent their outcomes. It yields None to rest for one movement; ``close()`` interrupts
the attempt."""

AskingAttempt = Generator[Move | Request | None, Any, None]
"""Attempt that may also yield a `Request`; it is then sent a `Lesson`, or None if there is no demonstration."""
