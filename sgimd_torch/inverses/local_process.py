"""Local Gaussian process as inverse model; the answer is the candidate with the least expected error.

Our addition, not in the paper. Each of the exemplars nearest to the goal has a process of its own, fitted to the
movements most like it; those that are much alike share one. Candidates are these exemplars, the ends of Gauss-Newton
steps from them, and the answer of a linear regression. Each candidate has an expected squared error, variance and noise
included. Where a process predicts the exemplars most like its own badly, both are inflated. The movements most like the
answer have to agree: beside a fold of the map, steps may end on the side that their process does not know.
    inverse = LocalProcess(problem); estimate = inverse(context, goal)
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.inverses.gaussian_process import choose_kernel, fit_lengths, one_thread
from sgimd_torch.inverses.locally_linear import ALIKE, corrected
from sgimd_torch.inverses.nearest import near_goal
from sgimd_torch.inverses.tuples import Kernel, Movements, Predictions, Question
from sgimd_torch.memory import Neighbours, Rows
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.memory.growing import Growing
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Box, Estimate, read_only, stream

_FIRST: Final = 16  # number of exemplars at the first fit
_GROWTH: Final = 1.5  # factor of the number of exemplars from fit to fit
_FITTED: Final = 300  # number of exemplars, drawn from all, to which lengths are fitted
_GROUPS: Final = 8  # number of groups of neighbours that determine the kernel
_GROUP: Final = 60  # number of exemplars in each group
_MOST_ALIKE: Final = 100  # number of exemplars to which a process is fitted
_NEAR: Final = 10  # number of exemplars in an estimate
_STARTS: Final = 6  # number of exemplars where steps begin
_SHARED: Final = 30  # a start among so many movements most like an earlier start shares its process
_PROOF: Final = 20  # number of movements most like an answer that have to agree with what is expected of it
_FEW_ALIKE: Final = 40  # number of exemplars that say how unsure an answer would be
_LITTLE: Final = 1e-3  # least variance of the noise when gross errors are looked for, relative to that of outcomes
_BULK: Final = 0.2, 0.8  # quantiles between which most outcomes lie
_BEYOND: Final = 3.0  # deviation, in standard deviations of the noise, that noise does not explain
_OTHERWISE: Final = 6.0  # deviation of what the movements most like an answer let expect, at which they contradict it
_FAR: Final = 1e3  # distance from 0, in standard deviations, beyond which inputs are shifted to 0 against rounding


class FittedKernel(NamedTuple):
    """Exemplars in lengths, ``(n, dim)``; origin and size of a length ``(2, dim)``; kernel."""

    inputs: Neighbours
    units: Array
    kernel: Kernel


def predictions(inputs: Neighbours, outcomes: Array, near: Rows, points: Array, kernel: Kernel) -> Predictions:
    """Result of `kernels.predictions`."""
    kernels = compiled("sgimd_torch.inverses.kernels")
    predicted: Predictions = kernels.predictions(inputs.keys.rows, outcomes, near, points, kernel)
    return predicted


class LocalProcess(Inverse):
    """Local Gaussian process; the answer has the least expected error, and may be a remembered movement.

    The answer depends on the memory alone. Lengths and kernel are refitted when the memory has 1.5 times its size at
    the last fit; other calls use neighbours only. Units do not matter. The answer is clipped to the box around all
    executed thetas.

    Args:
        problem: problem to learn.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.memory, self.noise = problem.memory, problem.outcome_noise
        self._plausible = np.array(-np.inf), np.array(np.inf)  # corners of the box in which outcomes count
        self._seen = 0  # number of exemplars that were compared with it
        self._due = float(_FIRST)  # exemplars at the next fit
        self._kernel: Kernel | None = None  # None while all outcomes are equal

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes, nearest first."""
        context, goal = (np.ascontiguousarray(point, dtype=np.float64) for point in (context, goal))
        self._catch_up()
        memory = self.memory
        near = near_goal(memory, context, goal, _NEAR)
        thetas = memory.thetas[near]
        if self._kernel is None:
            return Estimate(thetas[0], thetas, memory.outcomes_around(goal, near), context)
        known, kernels = self._known(goal), compiled("sgimd_torch.inverses.kernels")
        starts = near[:_STARTS]
        alike, process_of = self._alike(starts)
        linear, _ = corrected(memory, known.outcomes, alike[:, :ALIKE].copy(), goal)
        question = Question(*map(read_only, (context, goal, starts, alike, process_of, linear)))
        theta, expected, sd = kernels.answer(question, known, self._kernel)
        proof = self._predicted(context, theta, known.outcomes, _PROOF)
        if math.dist(proof.outcomes[0], expected) > _OTHERWISE * sd * math.sqrt(len(goal)):
            proofs = (theta, proof), (thetas[0], self._predicted(context, thetas[0], known.outcomes, _PROOF))
            theta, proof = min(proofs, key=lambda answer: _squared_error(answer[1], goal))
            expected, sd = proof.outcomes[0], math.sqrt(proof.variances[0] + proof.noises[0])
        return Estimate(theta, thetas, known.outcomes[near], context, expected, sd)

    def uncertainty(self, context: Array, goals: Array) -> Array:
        """Standard deviations ``(n,)`` of the outcomes of answers, without noise, from fewer movements than answers."""
        self._catch_up()
        if self._kernel is None:
            return np.zeros(len(goals))
        if self.memory.space and len(goals) > 1:  # each goal unwraps the outcomes around itself
            return np.concatenate([self.uncertainty(context, goals[k : k + 1]) for k in range(len(goals))])
        known, kernels = self._known(goals[0]), compiled("sgimd_torch.inverses.kernels")
        starts = self.memory.near_each(context, goals)
        alike = self._inputs.nearest(known.inputs[starts], _FEW_ALIKE)
        sds: Array = kernels.uncertainty(*map(read_only, (alike, goals, context)), known, self._kernel)
        return sds

    def _alike(self, starts: Rows) -> tuple[Rows, Rows]:
        """Rows ``(processes, k)`` of the movements most like some starts, and the process of each start. A start
        that is much like an earlier one shares its process."""
        inputs, lists, process_of = self._inputs.keys.rows, list[Rows](), list[int]()
        for row in starts:
            if not lists or (len(lists[-1]) < len(inputs) and row not in lists[-1][:_SHARED]):
                lists.append(self._inputs.nearest(inputs[row : row + 1], _MOST_ALIKE)[0])
            process_of.append(len(lists) - 1)
        return np.stack(lists), np.array(process_of)

    def _known(self, goal: Array) -> Movements:
        memory, units = self.memory, (self._units, self._spreads, read_only(self.memory.theta_range))
        return Movements(self._inputs.keys.rows, memory.thetas, memory.outcomes_around(goal), *units)

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Expected outcome ``(outcome_dim,)``, from similar movements; None while there are too few exemplars."""
        prediction = self.predict_variance(context, theta)
        return None if prediction is None else prediction[0]

    def predict_variance(self, context: Array, theta: Array) -> tuple[Array, float, float] | None:
        """The result of `predict`, and the variances of each dimension: without noise, and of the noise."""
        self._catch_up()
        if self._kernel is None:
            return (self.memory.outcomes[-1], 0.0, 0.0) if self._due > _FIRST else None
        around = self.memory.outcomes
        if self.memory.space:
            around = self.memory.outcomes_around(around[self.memory.near_policies(context, theta, 1)[0]])
        predicted = self._predicted(context, theta, around, _MOST_ALIKE)
        outcome = self.problem.outcomes.wrapped(predicted.outcomes[0])
        return outcome, float(predicted.variances[0]), float(predicted.noises[0])

    def _predicted(self, context: Array, theta: Array, outcomes: Array, k: int) -> Predictions:
        """Prediction of one movement by the process of the ``k`` most like it."""
        point = ((np.concatenate((theta, context)) - self._units[0]) / self._units[1])[None]
        assert self._kernel is not None
        return predictions(self._inputs, outcomes, self._inputs.nearest(point, k), point, self._kernel)

    def unexplained(self, context: Array, theta: Array, outcome: Array) -> float:
        """Distance of an outcome from the predicted one, if beyond three standard deviations of the noise, else 0."""
        prediction = self.predict_variance(context, theta)
        if prediction is None:
            return 0.0
        expected, _, noise = prediction
        off = float(self.problem.outcomes.distance(expected, outcome))
        return off if off > _BEYOND * math.sqrt(len(outcome) * noise) else 0.0

    def fitted(self) -> FittedKernel | None:
        """What predictions are made from; None while there are too few exemplars, or all outcomes are equal."""
        self._catch_up()
        return None if self._kernel is None else FittedKernel(self._inputs, self._units, self._kernel)

    def _catch_up(self) -> None:
        """Add new exemplars; refit when the memory has grown by half."""
        n, n_fitted = len(self.problem.memory), 0
        while self._due <= n:
            n_fitted, self._due = int(self._due), self._due * _GROWTH
        if n_fitted:
            self._plausible = plausible(self.problem.memory.outcomes[:n_fitted], self.problem.outcomes)
            self.memory, self._seen = self.problem.memory, 0
            self._leave_out(n_fitted)
            self._fit(min(n_fitted, len(self.memory)))
        if self._seen < n:
            self._leave_out(n)
        if self._kernel is not None and len(self._inputs.keys) < len(self.memory):
            self._inputs.keys.append(self._scaled(len(self._inputs.keys)))

    def _leave_out(self, n: int) -> None:
        """Leave out those of the first ``n`` exemplars whose outcome lies outside T and far from most others, such as
        error codes. ``memory`` becomes another one when the first of them comes."""
        every, (low, high) = self.problem.memory, self._plausible
        new = Exemplars.of(every, slice(self._seen, n))
        count = ((new.outcomes >= low) & (new.outcomes <= high)).all(axis=1)
        if self.memory is every and not count.all():
            self.memory = Exemplars.of(every, slice(self._seen)).memory_like(every)
        if self.memory is not every:
            self.memory.extend(*new.some(np.flatnonzero(count)))
        self._seen = n

    @one_thread
    def _fit(self, n: int) -> None:
        """Fit lengths and kernel to the first ``n`` exemplars; later exemplars do not count."""
        try:
            self._fit_to(n, _FAR)
        except np.linalg.LinAlgError:  # inputs that nearly coincide are measured from one of them
            self._fit_to(n, 0.0)

    def _fit_to(self, n: int, far: float) -> None:
        self._kernel = None
        unscaled = np.concatenate((self.memory.thetas[:n], self.memory.contexts[:n]), axis=1)
        outcomes = self.memory.on_circles[:n]
        origin = np.where(np.abs(unscaled[0]) > far * _spreads(unscaled), unscaled[0], 0.0)
        self._spreads = read_only(_spreads(unscaled - origin))
        if not np.ptp(outcomes, axis=0).any():
            return
        drawn = stream(n, "fit of a local process").permutation(n)[:_FITTED]
        standard = (unscaled - origin) / self._spreads
        for last in (False, True):  # at last without gross errors
            self._units = read_only(np.stack((origin, self._spreads * fit_lengths(standard[drawn], outcomes[drawn]))))
            self._inputs = self.memory.index(Growing(unscaled.shape[1], self._scaled(0)[:n]))
            inputs = self._inputs.keys.rows
            groups = [*self._inputs.nearest(inputs[drawn[:_GROUPS]], _GROUP)]
            gross = self._gross(outcomes, groups if last else self._covering(groups, drawn))
            groups = [rows[~np.isin(rows, gross)] for rows in groups]
            left = drawn[~np.isin(drawn, gross)]
            if last or len(left) == len(drawn) or not np.ptp(outcomes[left], axis=0).any():
                break
            drawn = left
        varied = [rows for rows in groups if np.ptp(outcomes[rows], axis=0).any()]
        if varied:
            self._kernel = choose_kernel([(inputs[rows], outcomes[rows]) for rows in varied], self.noise)

    def _covering(self, groups: list[Rows], drawn: Rows) -> list[Rows]:
        """``groups``, and more groups of neighbours until each of ``drawn`` lies in one."""
        inputs, groups = self._inputs.keys.rows, [*groups]
        while len(left := drawn[~np.isin(drawn, np.concatenate(groups))]):
            near = self._inputs.nearest(inputs[left[:1]], _GROUP)[0]
            groups.append(near if left[0] in near else left[:1])  # many equal movements may leave it out
        return groups

    def _gross(self, outcomes: Array, groups: list[Rows]) -> Rows:
        """Rows of ``groups`` that are gross errors to a smooth process; a rough one would explain them."""
        kernels, inputs, gross = compiled("sgimd_torch.inverses.kernels"), self._inputs.keys.rows, list[Rows]()
        for rows in groups:
            noise = self.noise**2 / (float(outcomes[rows].var(axis=0).mean()) or 1.0)
            kernel = Kernel(1.0, 1.0, 0.0, min(max(noise, _LITTLE), 1.0))
            gross.append(rows[kernels.gross_errors(inputs, outcomes, rows, kernel)])
        return np.concatenate(gross)

    def _scaled(self, first: int) -> Array:
        """Inputs from row ``first`` on, in lengths."""
        unscaled = np.concatenate((self.memory.thetas[first:], self.memory.contexts[first:]), axis=1)
        scaled: Array = (unscaled - self._units[0]) / self._units[1]
        return scaled


def _squared_error(predicted: Predictions, goal: Array) -> float:
    """Expected squared distance of a predicted movement from a ``goal``."""
    variance = float(predicted.variances[0] + predicted.noises[0])
    return math.dist(predicted.outcomes[0], goal) ** 2 + len(goal) * variance


def plausible(outcomes: Array, space: Box) -> tuple[Array, Array]:
    """Corners of the box in which outcomes count: T, and one width around the middle three fifths of them."""
    low, high = np.quantile(outcomes, _BULK, axis=0)
    return np.minimum(space.low, 2 * low - high), np.maximum(space.high, 2 * high - low)


def _spreads(inputs: Array) -> Array:
    """Standard deviations ``(dim,)`` of ``inputs``; 1 for constant inputs."""
    deviations = inputs.std(axis=0)
    return np.where(deviations > 0, deviations, 1.0)
