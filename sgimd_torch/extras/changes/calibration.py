"""Calibration: which movement of an earlier era does what a movement does now, and how outcomes have shifted.

A movement theta of now is h(theta) = middle + a (theta - middle) + b of before, for each parameter, and its outcome y
is seen as g(y) = y + G (1, y). So an offset, a gain or a parameter that is stuck are learnt from a few movements.
    calibration = Calibration(era, policies); calibration.fit(current); outcomes = calibration.predict(movements)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.extras.changes.eras import Era, squared
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.spaces import Array, Box

_PRIOR_A: Final = 0.2  # prior standard deviation of a
_PRIOR_B: Final = 0.1  # prior standard deviation of b, in sides of Pi
_PRIOR_G: Final = 0.1  # prior standard deviation of G, in spreads of the outcomes
_STEPS: Final = 10  # largest number of Gauss-Newton steps
_REWEIGHTED: Final = 3  # number of least squares fits of a linear calibration
_TRIES: Final = 5  # largest number of dampings that are tried for a step
_DAMPING: Final = 1e-2  # damping of the first step, relative to the curvature
_FACTOR: Final = 5.0  # factor by which the damping grows after a step that fails, and falls after one that helps
_CONVERGED: Final = 1e-4  # largest change of a parameter at which the fit ends
_STUCK: Final = 0.3  # least gain |a| by which a theta of before can be translated
_SAME: Final = 0.003  # largest distance, in sides of Pi, at which a translated movement counts as that of before
_REPREDICTED: Final = 1000  # largest number of exemplars whose outcome is predicted elsewhere


class Calibration:
    """The most likely h and g, by damped Gauss-Newton steps through the predictions of an earlier era.

    Movements that do not fit count less (Cauchy's weights), so a part of Pi may have changed in another way.
    """

    def __init__(self, era: Era, policies: Box) -> None:
        self.era, self.policies, self.middle = era, policies, (policies.low + policies.high) / 2
        outcomes = era.exemplars.outcomes
        self.dim, self.outcome_dim = policies.dim, outcomes.shape[1]
        self.mean, self.spread = outcomes.mean(axis=0), max(float(outcomes.std(axis=0).mean()), 1e-300)
        sizes = self.dim, self.dim, self.outcome_dim * (1 + self.outcome_dim)
        self.precision = np.repeat((_PRIOR_A, _PRIOR_B, _PRIOR_G), sizes) ** -2.0
        self.p = np.zeros(len(self.precision))  # parameters: a - 1, b and G

    def predict(self, movements: Exemplars) -> Array:
        """Outcomes ``(n, outcome_dim)`` that movements of now should have."""
        return self._slopes(movements, self.p)[0]

    def fit(self, current: Exemplars) -> Calibration:
        """Fit to movements of now."""
        p, damping, prediction = self.p, _DAMPING, self._slopes(current, self.p)
        for _ in range(_STEPS):
            predicted, variances, slopes = prediction
            errors = squared(current.outcomes - predicted)
            weights = 1 / _doubts(errors, variances)
            curvature = np.einsum("nik,n,nil->kl", slopes, weights, slopes) + np.diag(self.precision)
            descent = np.einsum("nik,n,ni->k", slopes, weights, current.outcomes - predicted) - p * self.precision
            loss = errors @ weights + p * p @ self.precision
            for _ in range(_TRIES):
                tried = p + np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), descent)
                tried_prediction = self._slopes(current, tried)
                if squared(current.outcomes - tried_prediction[0]) @ weights + tried * tried @ self.precision < loss:
                    break
                damping *= _FACTOR
            else:
                break
            change = np.abs(tried - p).max()
            p, prediction, damping = tried, tried_prediction, damping / _FACTOR
            if change < _CONVERGED:
                break
        self.p = p
        return self

    def translated(self, largest_variance: float) -> Exemplars:
        """Exemplars of before as they would be now; those whose variance is above ``largest_variance`` are left out.

        Where h^-1 leaves Pi, or a parameter is stuck, the nearest movement in Pi takes the place of the exemplar, with
        the outcome that is predicted for it.
        """
        before = self.era.exemplars
        thetas, outcomes = before.thetas, before.outcomes
        a, b = 1 + self.p[: self.dim], self.p[self.dim : 2 * self.dim] * self.policies.sides
        free = np.abs(a) >= _STUCK
        thetas_now = self.middle + (thetas - self.middle - b) / np.where(free, a, 1)
        as_now = before._replace(thetas=self.policies.clip(np.where(free, thetas_now, thetas)))
        before_thetas, outcomes_now, certain = (
            self._h(as_now.thetas, self.p),
            self._g(outcomes, self.p),
            np.ones(len(thetas), dtype=bool),
        )
        elsewhere = np.flatnonzero((np.abs(before_thetas - thetas) > _SAME * self.policies.sides).any(axis=1))
        sampled = elsewhere[:: 1 + len(elsewhere) // _REPREDICTED]
        certain[elsewhere] = False
        if len(sampled):
            outcomes_now[sampled], variances, _ = self._slopes(as_now.some(sampled), self.p)
            certain[sampled] = variances * self.outcome_dim <= largest_variance
        return as_now._replace(outcomes=outcomes_now).some(certain)

    def _h(self, thetas: Array, p: Array) -> Array:
        a, b = 1 + p[: self.dim], p[self.dim : 2 * self.dim] * self.policies.sides
        return np.asarray(self.middle + a * (thetas - self.middle) + b)

    def _g(self, outcomes: Array, p: Array) -> Array:
        shift, turn = np.split(p[2 * self.dim :], [self.outcome_dim])
        outcomes_now = outcomes + self.spread * shift + (outcomes - self.mean) @ turn.reshape(self.outcome_dim, -1)
        return np.asarray(outcomes_now)

    def linear_by_halves(self, current: Exemplars, prediction: tuple[Array, Array, Array]) -> Array:
        """Result of `by_halves` to first order: calibrations are linear in their parameters around those of now, and
        come from the era's one ``prediction`` of these movements."""
        predicted, variances, slopes = self._with_slopes(current, self.p, prediction)
        differences, errors = current.outcomes - predicted, np.empty(len(predicted))
        for half in (0, 1):
            fitted, tested = slice(1 - half, None, 2), slice(half, None, 2)
            by_row, left = slopes[fitted], differences[fitted]
            for _ in range(_REWEIGHTED):
                weighted = by_row / _doubts(squared(left), variances[fitted])[:, None, None]
                flat = weighted.reshape(-1, len(self.p))
                curvature = by_row.reshape(-1, len(self.p)).T @ flat + np.diag(self.precision)
                p = np.linalg.solve(curvature, differences[fitted].reshape(-1) @ flat)
                left = differences[fitted] - by_row @ p
            errors[tested] = squared(differences[tested] - slopes[tested] @ p)
        return errors

    def _slopes(self, current: Exemplars, p: Array) -> tuple[Array, Array, Array]:
        """Predictions, their variances, and their slopes by the parameters ``(n, outcome_dim, len(p))``."""
        return self._with_slopes(current, p, self.era.predict(current._replace(thetas=self._h(current.thetas, p))))

    def _with_slopes(
        self, current: Exemplars, p: Array, prediction: tuple[Array, Array, Array]
    ) -> tuple[Array, Array, Array]:
        """Result of `_slopes`, from the era's ``prediction`` of the translated movements."""
        expected, variances, jacobians = prediction
        turn = np.eye(self.outcome_dim) + p[2 * self.dim + self.outcome_dim :].reshape(
            self.outcome_dim, self.outcome_dim
        )
        turned = np.einsum("ji,njk->nik", turn, jacobians)
        slopes = np.zeros((len(expected), self.outcome_dim, len(p)))
        slopes[:, :, : self.dim] = turned * (current.thetas - self.middle)[:, None]
        slopes[:, :, self.dim : 2 * self.dim] = turned * self.policies.sides
        for k in range(self.outcome_dim):
            slopes[:, k, 2 * self.dim + k] = self.spread
            slopes[:, k, 2 * self.dim + self.outcome_dim + k :: self.outcome_dim] = expected - self.mean
        return self._g(expected, p), variances, slopes


def _doubts(errors: Array, variances: Array) -> Array:
    """Inverse weights ``(n,)`` of movements with these squared errors, by Cauchy: what fits worse counts less."""
    usual = np.median(errors) + np.maximum(variances, 1e-300)
    doubts: Array = usual * (1 + errors / (4 * usual))
    return doubts


def by_halves(era: Era, policies: Box, current: Exemplars) -> Array:
    """Squared errors ``(n,)`` of predicting movements by an era that is calibrated by the other half of them."""
    errors, is_even = np.empty(len(current.thetas)), np.arange(len(current.thetas)) % 2 == 0
    for half_tested in (is_even, ~is_even):
        calibration, tested = Calibration(era, policies).fit(current.some(~half_tested)), current.some(half_tested)
        errors[half_tested] = squared(calibration.predict(tested) - tested.outcomes)
    return errors


def shifted_by_halves(differences: Array) -> Array:
    """Squared errors ``(n,)`` of predictions that are shifted by the median difference of the other half.

    Two halves tell a shift of all outcomes where they are too few, or too noisy, for a calibration.
    """
    shifts = np.array([np.median(differences[k::2], axis=0) for k in (1, 0)])
    return squared(differences - shifts[np.arange(len(differences)) % 2])
