"""Nelder & Mead's simplex: a search that brings the outcome nearer to the goal.

Section 4.4.2 of Nguyen & Oudeyer (2014), local optimisation (Lagarias et al. 1998). A search is a generator, so it can
be paused, counted and interrupted at any movement:
    search = NelderMead(problem)(estimate, goal); theta = next(search); theta = search.send(outcome) ...
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator

import numpy as np

from sgimd_torch.parts import Problem, Search
from sgimd_torch.spaces import Array, Box, Estimate


class NelderMead(Search):
    """Nelder-Mead simplex around remembered movements, with a little noise on every movement.

    The search minimises the distance to the goal. The first vertex is theta_g, with noise. The other vertices are
    exemplars of the estimate with their remembered outcomes, so they need no movement; outcomes in nearby contexts
    count as outcomes in this context. An exemplar in the affine hull (the flat) of better vertices is left out, because
    the simplex cannot leave the flat of its vertices. If exemplars are missing, random steps from theta_g are executed.

    Args:
        problem: problem to learn.
        noise: standard deviation of the noise of every movement, as a fraction of each parameter's range in Pi; the
            vertex is the noisy movement. Deviation: the paper adds no noise. But a simplex stays in the flat of its
            vertices, and remembered exemplars often span the same flat. Without new directions the learner soon repeats
            its movements, and the inverse model cannot tell noise from the effect of theta.
        step: size of the random steps, as a fraction of the ranges in Pi (root mean square). Deviation: the steps of a
            first simplex usually change one coordinate each, but one knot of one joint often hardly moves the float. No
            noise is added to these steps.
        complete: true: the simplex has theta_dim + 1 vertices, the paper's 26; false: outcome_dim + 1 vertices, for
            which exemplars often suffice. The flat of so few vertices usually contains a solution, as theta is
            redundant. Deviation: false is the default, because 25 random steps would exceed the budget of a goal.
        xatol: size of the simplex, in the unit of theta, below which the search ends if the condition of ``fatol``
            holds, too. A simplex whose outcomes differ by less than the noise cannot tell better from worse, so the
            default is large. Deviation: the paper gives no such size.
        fatol: difference of the vertices' distances from the goal, in the unit of outcomes, below which the search ends
            if the condition of ``xatol`` holds, too.

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
        theta = self._noisy(policies.check("theta of the estimate", start.theta))
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
        yield from _towards(goal, simplex_descent(*simplex, allow=self._noisy, xatol=self.xatol, fatol=self.fatol))

    def _noisy(self, theta: Array) -> Array:
        policies, noise = self.problem.policies, self.noise
        return policies.clip(self.rng.normal(theta, noise * policies.sides) if noise else theta)


def simplex_descent(
    vertices: Array,
    values: Array,
    *,
    allow: Callable[[Array], Array] | None = None,
    xatol: float = 1e-4,
    fatol: float = 1e-4,
) -> Generator[Array, float, None]:
    """Nelder & Mead's method from a simplex with known values: yields points; the caller sends their values.

    It visits the points that ``scipy.optimize.minimize(method="Nelder-Mead")`` visits after its first simplex, bit for
    bit. (The newest of equal values ranks last, as Lagarias et al. demand; in scipy the order of equal values is open.)

    Args:
        vertices: ``(n + 1, dim)``. With n < dim the search stays in the n-dimensional flat through the vertices,
            unless ``allow`` leads out of it.
        values: ``(n + 1,)``.
        allow: function that moves a point to an allowed one, for example into a box; None: no change. (If ``allow``
            only clips, a simplex with all vertices on one face of the box cannot leave this face.)
        xatol: largest difference of the vertices from the best vertex, in any coordinate, at which the descent ends if
            the condition of ``fatol`` holds, too.
        fatol: largest difference of the values from the best value at which the descent ends if the condition of
            ``xatol`` holds, too.

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
        """The point at ``distance`` on the line through the worst vertex (at -1) and the others' ``centre`` (at 0)."""
        point = (1 + distance) * centre - distance * vertices[-1]
        return point if allow is None else allow(point)

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
                vertices[j] = shrunk if allow is None else allow(shrunk)
                values[j] = yield vertices[j]
        order = values.argsort(kind="stable")
        vertices, values = vertices[order], values[order]


class _Flat:
    """The flat (affine hull) of the vertices of an unfinished simplex, to find points outside the flat."""

    _SINE = 0.1  # sine of 6 degrees, the least angle between the flat and the edge to a new vertex

    def __init__(self, origin: Array, shortest: float) -> None:
        self._origin = origin
        self._shortest = shortest
        self._room = np.empty((len(origin), len(origin)))
        self._basis = self._room[:0]  # orthonormal rows

    def lacks(self, point: Array) -> bool:
        """Whether ``point`` is far enough outside the flat to become a vertex."""
        edge = point - self._origin
        return self._is_outside(edge, _length(self._across(edge)))

    def widen(self, point: Array) -> None:
        """Add ``point`` as a vertex."""
        across = self._across(point - self._origin)
        self._add(across, _length(across))

    def widen_if_lacking(self, point: Array) -> bool:
        """Add ``point`` as a vertex if it is far enough outside the flat, and return whether it was added."""
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
    return math.sqrt(vector.dot(vector))  # equals np.linalg.norm bit for bit, in less time


def _step_out(policies: Box, theta: Array, flat: _Flat, rng: np.random.Generator, step: float) -> Array:
    """A random step from ``theta`` that leads out of the flat and stays in the box.

    A coordinate that would leave the box steps the other way, because a clipped step may lie in the flat. In a corner
    of a box of few dimensions this step may lie in the flat, too; then random directions are tried.
    """
    direction = flat.direction_out(rng)
    for _ in range(100):  # with steps no longer than xatol, no direction suffices
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
