"""Spaces, records and random streams: the words that every other module speaks.

Section 2.1 of Nguyen & Oudeyer (2014): contexts c in C, policies theta in Pi, outcomes tau in T, and a
learning episode [context][policy][outcome]. Numpy only; nothing here knows about learning or physics.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def stream(seed: int, name: str, index: int | None = None) -> np.random.Generator:
    """A random stream of its own for every use, so that taking one part away leaves the others' draws as they were.

    Args:
        seed: of the run, >= 0.
        name: what the draws are for: ``"environment"``, ``"goals"``, ``"search"``, ``"teacher"`` ...
        index: one stream for each movement, say; None for a single stream.

    Raises:
        ValueError: the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed must be >= 0, got {seed}")
    key = tuple(name.encode()) + (() if index is None else (256, index))  # 256: no byte of a name
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))


def check_vector(name: str, value: ArrayLike, dim: int, hint: str = "") -> Array:
    """``value`` as float64 of shape ``(..., dim)``, every entry finite.

    Raises:
        ValueError: it is not numeric, has another last axis, or holds NaN or infinity.
    """
    slip = f"; {hint}" if hint else ""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} must be numeric of shape (..., {dim}), got {_short(value)}{slip}") from error
    if array.ndim == 0 or array.shape[-1] != dim:
        raise ValueError(f"{name} must have shape (..., {dim}), got {array.shape}{slip}")
    if not np.isfinite(array).all():
        raise ValueError(f"{name} must be finite, but {first_entry(array, ~np.isfinite(array))}{slip}")
    return array


def check_count(name: str, value: object, least: int) -> int:
    """``value`` as int, a whole number of at least ``least``; numpy's integers are welcome.

    Raises:
        ValueError: it is not.
    """
    if not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{name} must be a whole number >= {least}, got {_short(value)}")
    return int(value)


def first_entry(array: Array, wrong: NDArray[np.bool_]) -> str:
    """The first of the ``wrong`` entries of ``array`` and how many more there are, for an error in one line."""
    entries = np.argwhere(wrong)
    more = f" (and {len(entries) - 1} more)" if len(entries) > 1 else ""
    return f"entry {entries[0].tolist()} is {array[tuple(entries[0])]}{more}"


def _short(value: object) -> str:
    return " ".join(reprlib.repr(value).split())


@dataclass(frozen=True, eq=False)
class Box:
    """An axis-aligned box: C, Pi or T. ``dim`` may be 0, the empty context of the fishing task.

    Args:
        low: ``(dim,)`` lower corner.
        high: ``(dim,)`` upper corner, above ``low`` in every dimension.

    Raises:
        ValueError: corners of different shapes, not finite, or not in order.
    """

    low: Array
    high: Array

    def __post_init__(self) -> None:
        low, high = np.array(self.low, dtype=np.float64), np.array(self.high, dtype=np.float64)
        if low.ndim != 1 or low.shape != high.shape:
            raise ValueError(f"Box needs two corners of shape (dim,), got {low.shape} and {high.shape}")
        if not (np.isfinite(low).all() and np.isfinite(high).all() and (low < high).all()):
            raise ValueError(f"Box needs finite corners with low < high, got {low} and {high}; were they swapped?")
        for name, corner in (("low", low), ("high", high)):
            corner.flags.writeable = False
            object.__setattr__(self, name, corner)

    @classmethod
    def cube(cls, low: float, high: float, dim: int) -> Box:
        """``[low, high]^dim``."""
        return cls(np.full(dim, low), np.full(dim, high))

    @property
    def dim(self) -> int:
        """Number of dimensions, 0 for the empty context."""
        return len(self.low)

    @property
    def sides(self) -> Array:
        """``(dim,)`` lengths of the sides."""
        return self.high - self.low

    def sample(self, rng: np.random.Generator) -> Array:
        """``(dim,)`` one uniform point."""
        return rng.uniform(self.low, self.high)

    def clip(self, points: ArrayLike) -> Array:
        """``(..., dim)`` the nearest points inside."""
        return np.clip(np.asarray(points, dtype=np.float64), self.low, self.high)

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """``(...)`` whether each point of ``(..., dim)`` lies inside, the border included."""
        points = np.asarray(points, dtype=np.float64)
        return np.all((points >= self.low) & (points <= self.high), axis=-1)

    def check(self, name: str, points: ArrayLike, hint: str = "") -> Array:
        """``points`` as float64 ``(..., dim)``, all inside.

        Raises:
            ValueError: another shape, a value that is not finite, or a point outside.
        """
        array = check_vector(name, points, self.dim, hint)
        if not self.contains(array).all():
            outside = (array < self.low) | (array > self.high)
            k = np.argwhere(outside)[0, -1]
            entry = f"{first_entry(array, outside)}, outside [{self.low[k]}, {self.high[k]}]"
            raise ValueError(f"{name} must lie in its box, but {entry}; was it scaled already?")
        return array


class Move(NamedTuple):
    """What a strategy wants executed.

    ``theta`` is ``(theta_dim,)``; ``goal`` ``(outcome_dim,)`` what it was for, None when babbling; ``origin`` names the
    regime ("babble", "global", "local", "imitate") for analysis, never for control flow.
    """

    theta: Array
    goal: Array | None
    origin: str


class Estimate(NamedTuple):
    """What the inverse model infers for a goal: ``theta`` ``(theta_dim,)``, and the exemplars it rests on,
    ``thetas`` ``(k, theta_dim)`` with their ``outcomes`` ``(k, outcome_dim)``. ``context`` ``(context_dim,)`` is that
    of the goal; empty where there are none."""

    theta: Array
    thetas: Array
    outcomes: Array
    context: Array = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Demonstration:
    """(c_d, zeta_d, tau_d): ``context`` ``(context_dim,)``; ``trajectory`` ``(n_times, n_joints)`` rad at ``times``
    ``(n_times,)`` s; ``outcome`` ``(outcome_dim,)`` m, where the float landed."""

    context: Array
    times: Array
    trajectory: Array
    outcome: Array


@dataclass(frozen=True, eq=False)
class Episode:
    """[context][policy][outcome] and why it happened. ``move`` and ``outcome`` are None when the learner rested;
    ``demonstration`` is what the teacher showed just before, if anything."""

    index: int
    context: Array
    move: Move | None
    outcome: Array | None
    demonstration: Demonstration | None


Attempt = Generator[Move | None, Array, None]
"""Yields movements, is sent their outcomes; ``close()`` interrupts it. Yielding None, it stays still and so ends."""

Search = Callable[[Estimate, Array], Generator[Array, Array, None]]
"""(start, goal) -> yields thetas to execute, is sent their outcomes ``(outcome_dim,)``."""
