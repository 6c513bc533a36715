"""Nelder & Mead's simplex: a search that brings the outcome nearer to the goal.

Section 4.4.2 of Nguyen & Oudeyer (2014), local optimisation (Lagarias et al. 1998). A search is a generator, so it can
be paused, counted and interrupted at any movement:
    search = NelderMead(problem)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from functools import partial

import numpy as np

from sgimd_torch.parts import Problem, Search
from sgimd_torch.spaces import Array, Box, Estimate


class NelderMead(Search):
    """Nelder-Mead simplex around remembered movements, with a little noise on every movement.

    It minimises the distance to the goal, from theta_g and its neighbours.

    The first movement is theta_g, with noise. Neighbours become vertices with their remembered outcomes, which costs no
    movement (but takes outcomes in nearby contexts for outcomes in this context). A neighbour on a line, plane ...
    through better vertices is left out, because a flat simplex cannot turn.

    Args:
        problem: problem to learn.
        noise: standard deviation of the noise of every movement, as a fraction of each parameter's range in Pi; the
            vertex is the noisy movement. Deviation: the paper adds no noise. But a simplex searches the flat through
            its vertices, and neighbours from memory span the same flat again and again. Without new directions the
            learner soon repeats itself, and its inverse model cannot tell noise from the effect of theta.
        step: size of the steps that replace missing neighbours, as a fraction of the ranges in Pi (root mean square).
            Deviation: the usual first simplex steps along one coordinate at a time, but one knot of one joint often
            hardly moves the float. These steps go in random directions, and no noise is added to them.
        complete: true fills the simplex up to theta_dim + 1 vertices, the paper's 26, by one movement each; false
            fills it up to outcome_dim + 1, so neighbours often suffice. The search then stays in the flat through the
            vertices, which usually contains a solution, as theta is redundant. Deviation: False is the default, because
            25 steps would be the whole budget of a goal.
        xatol: size of the simplex, in the unit of theta, at which the search ends, if fatol holds, too. Below
            the noise of the outcomes a simplex cannot tell better from worse, so by default the search ends early.
            Deviation: the paper names no such end.
        fatol: difference of the vertices' distances from the goal, in the unit of outcomes, at which the search ends,
            if xatol holds, too.

    Raises:
        ValueError: ``step`` is not in (0, 0.5], or ``noise`` is not in [0, 0.5].
    """

    def __init__(
        self,
        problem: Problem,
        *,
        noise: float = 0.05,
        step: float = 0.1,
        complete: bool = False,
        xatol: float = 0.1,
        fatol: float = 0.05,
    ) -> None:
        super().__init__(problem)
        if not 0 < step <= 0.5:
            raise ValueError(f"step must lie in (0, 0.5], got {step}; it is a fraction of the sides of Pi")
        if not 0 <= noise <= 0.5:
            raise ValueError(f"noise must lie in [0, 0.5], got {noise}; it is a fraction of the sides of Pi")
        self.noise, self.step, self.complete, self.xatol, self.fatol = noise, step, complete, xatol, fatol

    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Movements around ``start``, theta_g first; the search ends when the simplex has shrunk."""
        policies = self.problem.policies
        theta = self._place(policies.check("theta of the estimate", start.theta))
        vertices = [theta]
        values = [math.dist(goal, (yield theta))]
        flat = _Flat(theta, self.xatol)
        distances = np.linalg.norm(start.outcomes - goal, axis=1)
        for k in distances.argsort(kind="stable"):
            if flat.widen_if_lacking(start.thetas[k]):
                vertices.append(policies.check("a theta of the estimate", start.thetas[k]))
                values.append(float(distances[k]))
        n_vertices = 1 + (policies.dim if self.complete else min(policies.dim, len(goal)))
        while len(vertices) < n_vertices:
            vertex = _step_out(policies, theta, flat, self.rng, self.step)
            flat.widen(vertex)
            vertices.append(vertex)
            values.append(math.dist(goal, (yield vertex)))
        simplex = np.array(vertices), np.array(values)
        yield from _towards(goal, simplex_descent(*simplex, place=self._place, xatol=self.xatol, fatol=self.fatol))

    def _place(self, theta: Array) -> Array:
        policies, noise = self.problem.policies, self.noise
        return policies.clip(self.rng.normal(theta, noise * policies.sides) if noise else theta)


exact = partial(NelderMead, noise=0.0)
"""Nelder-Mead simplex around remembered movements, without noise."""

complete = partial(NelderMead, noise=0.0, complete=True, xatol=1e-4, fatol=1e-4)
"""Nelder-Mead simplex without noise, with all 26 vertices as in the paper; ends with the budget."""


def simplex_descent(
    vertices: Array,
    values: Array,
    *,
    place: Callable[[Array], Array] | None = None,
    xatol: float = 1e-4,
    fatol: float = 1e-4,
) -> Generator[Array, float, None]:
    """Nelder & Mead's method from a simplex with known values: yields points; the caller sends their values.

    It visits the points that ``scipy.optimize.minimize(method="Nelder-Mead")`` visits after its first simplex, bit for
    bit. (Of equal values the newest ranks last, as Lagarias et al. demand; in scipy an unstable sort decides.)

    Args:
        vertices: ``(n + 1, dim)``. With n < dim the search stays in the n-dimensional flat through the vertices,
            unless ``place`` leads out of it.
        values: ``(n + 1,)``.
        place: function that moves a point to an allowed one, for example into a box; None: no change. (If ``place``
            only clips, a simplex with all vertices on one face of the box cannot leave this face.)
        xatol: distance between vertices in every coordinate at which the descent ends, if ``fatol`` holds, too.
        fatol: difference of the values at which the descent ends, if ``xatol`` holds, too.

    Raises:
        ValueError: there are fewer than two vertices, or vertices and values differ in number.
    """
    if len(vertices) < 2 or len(values) != len(vertices):
        raise ValueError(
            f"a simplex needs two vertices or more and a value for each, got {len(vertices)} and {len(values)}"
        )
    order = values.argsort(kind="stable")
    vertices, values = vertices[order], values[order]
    n = len(vertices) - 1

    def beyond(centre: Array, distance: float) -> Array:
        """The point at ``distance`` on the line from the worst vertex (-1) through the ``centre`` of the others (0)."""
        point = (1 + distance) * centre - distance * vertices[-1]
        return point if place is None else place(point)

    while np.abs(vertices[1:] - vertices[0]).max() > xatol or np.abs(values[0] - values[1:]).max() > fatol:
        centre = np.add.reduce(vertices[:-1], axis=0) / n
        reflected = beyond(centre, 1)
        value = yield reflected
        better: tuple[Array, float] | None = None
        if value < values[0]:
            expanded = beyond(centre, 2.0)
            value_expanded = yield expanded
            better = (expanded, value_expanded) if value_expanded < value else (reflected, value)
        elif value < values[-2]:
            better = reflected, value
        else:
            outside = value < values[-1]
            contracted = beyond(centre, 0.5 if outside else -0.5)
            value_contracted = yield contracted
            if value_contracted <= value if outside else value_contracted < values[-1]:
                better = contracted, value_contracted
        if better is not None:
            vertices[-1], values[-1] = better
        else:
            for j in range(1, n + 1):
                shrunk = vertices[0] + 0.5 * (vertices[j] - vertices[0])
                vertices[j] = shrunk if place is None else place(shrunk)
                values[j] = yield vertices[j]
        order = values.argsort(kind="stable")
        vertices, values = vertices[order], values[order]


class _Flat:
    """The flat (affine hull) through the vertices of an unfinished simplex; it tells which points lie outside."""

    _SINE = 0.1  # sine of 6 degrees; with a vertex at a smaller angle to the flat, a simplex hardly turns

    def __init__(self, origin: Array, shortest: float) -> None:
        self._origin = origin
        self._shortest = shortest
        self._room = np.empty((len(origin), len(origin)))
        self._basis = self._room[:0]  # orthonormal rows

    def lacks(self, point: Array) -> bool:
        """Whether ``point`` is far enough outside to become a vertex."""
        edge = point - self._origin
        return self._is_outside(edge, _length(self._across(edge)))

    def widen(self, point: Array) -> None:
        """Add ``point`` as a vertex."""
        across = self._across(point - self._origin)
        self._add(across, _length(across))

    def widen_if_lacking(self, point: Array) -> bool:
        """Add ``point`` as a vertex if it is far enough outside, and return whether it was added."""
        edge = point - self._origin
        across = self._across(edge)
        outside = _length(across)
        if lacking := self._is_outside(edge, outside):
            self._add(across, outside)
        return lacking

    def direction_out(self, rng: np.random.Generator) -> Array:
        """A random unit vector at right angles to the flat."""
        across = self._across(rng.standard_normal(len(self._origin)))
        return across / np.linalg.norm(across)

    def _is_outside(self, edge: Array, outside: float) -> bool:
        return outside > self._shortest and outside > self._SINE * _length(edge)

    def _add(self, across: Array, length: float) -> None:
        n = len(self._basis)
        self._room[n] = across / length
        self._basis = self._room[: n + 1]

    def _across(self, edges: Array) -> Array:
        return edges - edges @ self._basis.T @ self._basis


def _length(vector: Array) -> float:
    return math.sqrt(vector.dot(vector))  # value of np.linalg.norm, bit for bit, in less time


def _step_out(policies: Box, theta: Array, flat: _Flat, rng: np.random.Generator, step: float) -> Array:
    """A random step from ``theta`` that leads out of the flat and stays in the box.

    A coordinate that would leave the box steps the other way, because clipping would flatten the simplex. In a corner
    of a box of few dimensions this step may flatten the simplex, too; then random directions are tried.
    """
    direction = flat.direction_out(rng)
    for _ in range(100):  # a step no longer than xatol never suffices
        change = step * np.sqrt(policies.dim) * policies.sides * direction
        forth, back = theta + change, theta - change
        vertex = policies.clip(np.where((forth < policies.low) | (forth > policies.high), back, forth))
        if flat.lacks(vertex):
            break
        direction = rng.standard_normal(policies.dim)
        direction /= np.linalg.norm(direction)
    return vertex


def _towards(goal: Array, descent: Generator[Array, float, None]) -> Generator[Array, Array, None]:
    """Turn ``descent``, which expects distances to ``goal``, into a search, which expects outcomes."""
    try:
        theta = next(descent)
        while True:
            theta = descent.send(math.dist(goal, (yield theta)))
    except StopIteration:
        return
