"""Local Gaussian process as inverse model; the answer is the nearest exemplar, unless the process is clearly better.

Our addition, not in the paper. The process is fitted to movements near the goal and to movements like them. Candidates
are the ends of Gauss-Newton steps from the nearest exemplars, and the answer of `LocallyLinear`. Each candidate has an
expected squared error, variance included. Where the process predicted exemplars near the goal badly, its variance is
inflated. If no candidate is clearly better, the answer is the nearest exemplar.
    inverse = LocalProcess(problem); estimate = inverse(context, goal)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.inverses.gaussian_process import Kernel, Process, choose_kernel, fit_lengths, one_thread
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.memory.neighbours import PolicyNeighbours, Rows, Table
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate, stream

_FIRST, _GROWTH = 16, 1.5  # number of exemplars at the first fit, and its growth factor from fit to fit
_FITTED: Final = 300  # number of exemplars, drawn from all, to which lengths are fitted
_GROUPS, _GROUP = 8, 60  # number of groups of neighbours that determine the kernel, and of exemplars in each
_NEAR: Final = 20  # exemplars with outcomes nearest to the goal, on which the surprise of the process is measured
_LEARNT: Final = 100  # exemplars to which the process is fitted, the `_NEAR` ones among them
_STARTS, _STEPS = 3, 4  # number of exemplars where steps begin, and of steps from each
_DAMPINGS: Final = np.array([1e-3, 0.1, 1.0, 10.0])
_FAR: Final = 1e3  # inputs more spreads from 0 are shifted to 0 first: rounding would hide their differences
_CLEARLY: Final = 0.8  # error, relative to that of the nearest exemplar, below which a candidate is clearly better


class LocalProcess(Inverse):
    """Local Gaussian process; the nearest exemplar, unless the process is clearly better.

    The answer depends on the memory alone. Lengths and kernel are refitted when the memory has 1.5 times its size at
    the last fit; other calls use neighbours only. Units do not matter. The answer is clipped to the box around all
    executed thetas.

    Args:
        problem: problem to learn.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.memory, self.noise = problem.memory, problem.outcome_noise
        self._nearest, self._linear = NearestNeighbour(problem, k=_NEAR), LocallyLinear(problem)
        self._fitted = 0  # exemplars at the last fit
        self._kernel: Kernel | None = None  # None while all outcomes are equal

    @one_thread
    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes, nearest first."""
        estimate, learnt = self._nearest(context, goal), self._learn_near(context, goal)
        if learnt is None:
            return estimate
        process, near, doubt = learnt
        if self.memory.context_dim:
            expected, variances = process.predict(self._in_lengths(context, self.memory.thetas[near]))
        else:
            expected, variances = process.without_noise(np.arange(len(near)))
        exemplars = ((expected - goal) ** 2).sum(axis=1) + doubt * variances
        best = int(exemplars.argmin())
        linear = self._linear(context, goal).theta[None]
        linear_error = self._expected_errors(process, context, goal, doubt, linear)
        errors, found = self._descend(process, context, goal, doubt, estimate.thetas[:_STARTS])
        errors = np.concatenate((exemplars[[best]], linear_error, errors))
        candidates = np.concatenate((estimate.thetas[[best]], linear, found))
        chosen_one = int(errors.argmin())
        clearly = errors[chosen_one] < _CLEARLY * exemplars[0]
        return estimate._replace(theta=candidates[chosen_one]) if clearly else estimate

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Expected outcome ``(outcome_dim,)`` of ``theta``, from similar movements. While all outcomes are equal, the
        prediction is that outcome. While there are too few exemplars, it is None."""
        found = self.predict_variance(context, theta)
        return None if found is None else found[0]

    @one_thread
    def predict_variance(self, context: Array, theta: Array) -> tuple[Array, float] | None:
        """The result of `predict`, and the variance of each dimension, without noise."""
        self._catch_up()
        if self._kernel is None:
            return (self.memory.outcomes[-1], 0.0) if self._fitted else None
        here = self._in_lengths(context, theta[None])
        rows = self._inputs.nearest(here, min(_LEARNT, len(self.memory)))[0]
        process = Process(self._inputs.keys.rows[rows], self.memory.outcomes[rows], self._kernel)
        (expected,), (variance,) = process.predict(here)
        return expected, float(variance)

    def _learn_near(self, context: Array, goal: Array) -> tuple[Process, Rows, float] | None:
        """The process of the movements near the goal, the rows of the nearest outcomes (its first rows), and the
        factor that inflates the variance; None before the first fit."""
        self._catch_up()
        if self._kernel is None:
            return None
        near = self.memory.near_outcomes(context, goal, _NEAR)
        rows = self._neighbours(near)
        process = Process(self._inputs.keys.rows[rows], self.memory.outcomes[rows], self._kernel)
        # Two corrections inflate the variance: one for surprising exemplars here, and one because a process with many
        # lengths, fitted to few movements, errs most at the candidates that look best.
        dim, n = len(self._lengths), len(self.memory)
        return process, near, len(goal) * max(1.0, process.surprise(np.arange(len(near)))) * (1 + dim**2 / n)

    def _descend(
        self, process: Process, context: Array, goal: Array, doubt: float, starts: Array
    ) -> tuple[Array, Array]:
        """Least expected squared errors ``(m,)``, and their thetas, after damped Gauss-Newton steps from each of
        ``starts`` ``(m, theta_dim)``; steps end when they do not help. Each step is as short as possible, so
        unimportant parameters hardly change."""
        least, found = np.full(len(starts), np.inf), starts.copy()
        going = np.arange(len(starts))
        dim, spreads, lengths = starts.shape[1], self._spreads[: starts.shape[1]], self._lengths[: starts.shape[1]]
        for _ in range(_STEPS):
            here = self._in_lengths(context, found[going])
            ahead = goal - process.expect(here)
            jacobians = process.jacobians(here)[:, :, :dim] / lengths  # (m, outcome_dim, theta_dim)
            transposed = jacobians.transpose(0, 2, 1)
            squares = jacobians @ transposed
            sizes = np.trace(squares, axis1=1, axis2=2) / len(goal) + 1e-300
            damped = squares[:, None] + (sizes[:, None] * _DAMPINGS)[..., None, None] * np.eye(len(goal))
            steps = (transposed[:, None] @ np.linalg.solve(damped, ahead[:, None, :, None]))[..., 0]
            tried = np.clip(found[going, None] + spreads * steps, *self.memory.theta_range)
            errors = self._expected_errors(process, context, goal, doubt, tried.reshape(-1, dim))
            errors = errors.reshape(tried.shape[:2])
            best = errors.argmin(axis=1), errors.min(axis=1)
            better = np.flatnonzero(best[1] < least[going])
            going = going[better]
            if not len(going):
                break
            least[going], found[going] = best[1][better], tried[better, best[0][better]]
        return least, found

    def _expected_errors(self, process: Process, context: Array, goal: Array, doubt: float, thetas: Array) -> Array:
        """Expected squared errors ``(m,)`` of ``thetas`` ``(m, theta_dim)``, without noise."""
        expected, variances = process.predict(self._in_lengths(context, thetas))
        errors: Array = ((expected - goal) ** 2).sum(axis=1) + doubt * variances
        return errors

    def _neighbours(self, near: Rows) -> Rows:
        """Rows to fit the process to: first the rows ``near`` the goal, then rows most similar to the first of them."""
        keys = self._inputs.keys.rows[near[:_STARTS]]
        alike = self._inputs.nearest(keys, min(_LEARNT, len(self.memory)))
        rows = np.concatenate((near, np.stack(alike, axis=1).ravel()))
        _, first = np.unique(rows, return_index=True)
        found: Rows = rows[np.sort(first)[:_LEARNT]]
        return found

    def _catch_up(self) -> None:
        """Add new exemplars; refit when the memory has grown by half."""
        n, wanted = len(self.memory), 0
        size = float(_FIRST)
        while size <= n:
            wanted, size = int(size), size * _GROWTH
        if wanted > self._fitted:
            self._fit(wanted)
        if self._kernel is not None and len(self._inputs.keys) < n:
            self._inputs.keys.append(self._scaled(len(self._inputs.keys)))

    def _fit(self, n: int) -> None:
        """Fit lengths and kernel to the first ``n`` exemplars; later exemplars do not count."""
        try:
            self._fit_to(n, _FAR)
        except np.linalg.LinAlgError:  # inputs that nearly coincide are measured from one of them
            self._fit_to(n, 0.0)

    def _fit_to(self, n: int, far: float) -> None:
        self._fitted, self._kernel = n, None
        raw = np.concatenate((self.memory.thetas[:n], self.memory.contexts[:n]), axis=1)
        outcomes = self.memory.outcomes[:n]
        self._origin = np.where(np.abs(raw[0]) > far * _spreads(raw), raw[0], 0.0)
        raw = raw - self._origin
        self._spreads = _spreads(raw)
        if not np.ptp(outcomes, axis=0).any():
            return
        order = stream(n, "fit of a local process").permutation(n)
        self._lengths = fit_lengths(raw[order[:_FITTED]] / self._spreads, outcomes[order[:_FITTED]])
        self._inputs = PolicyNeighbours(Table(raw.shape[1]))
        self._inputs.keys.append(self._scaled(0)[:n])
        centres = self._inputs.keys.rows[order[:_GROUPS]]
        groups = self._inputs.nearest(centres, min(_GROUP, n))
        varied = [rows for rows in groups if np.ptp(outcomes[rows], axis=0).any()]
        if varied:
            inputs = self._inputs.keys.rows
            self._kernel = choose_kernel([(inputs[rows], outcomes[rows]) for rows in varied], self.noise)

    def _scaled(self, first: int) -> Array:
        """Inputs from row ``first`` on, in lengths."""
        raw = np.concatenate((self.memory.thetas[first:], self.memory.contexts[first:]), axis=1)
        return (raw - self._origin) / self._spreads / self._lengths

    def _in_lengths(self, context: Array, thetas: Array) -> Array:
        inputs = np.concatenate((thetas, np.tile(context, (len(thetas), 1))), axis=1)
        scaled: Array = (inputs - self._origin) / self._spreads / self._lengths
        return scaled


def _spreads(inputs: Array) -> Array:
    """Standard deviations ``(dim,)`` of ``inputs``; 1 for constant inputs."""
    found = inputs.std(axis=0)
    return np.where(found > 0, found, 1.0)
