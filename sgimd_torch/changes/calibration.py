"""Calibration: which movement of an earlier era does what a movement does now, and how outcomes have shifted.

A movement theta of now is h(theta) = middle + a (theta - middle) + b of before, for each parameter, and its outcome y
is seen as g(y) = y + G (1, y). So an offset, a gain or a parameter that is stuck are learnt from a few movements.
    calibration = Calibration(era, policies); calibration.fit(told); errors = calibration.errors(others)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.changes.eras import Era, Exemplars, squared
from sgimd_torch.spaces import Array, Box

_PRIOR: Final = (0.2, 0.1, 0.1)  # standard deviations of a, of b in sides of Pi, of G in spreads of the outcomes
_STEPS: Final = 10  # largest number of Gauss-Newton steps
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
        self.dim, self.out = policies.dim, outcomes.shape[1]
        self.mean, self.spread = outcomes.mean(axis=0), max(float(outcomes.std(axis=0).mean()), 1e-300)
        self.precision = np.repeat(_PRIOR, (self.dim, self.dim, self.out * (1 + self.out))) ** -2.0
        self.p = np.zeros(len(self.precision))

    def predict(self, asked: Exemplars) -> Array:
        """Outcomes ``(n, outcome_dim)`` that movements of now should have."""
        return self._slopes(asked, self.p)[0]

    def fit(self, told: Exemplars) -> Calibration:
        """Fit to movements of now."""
        p, damping, now = self.p, _DAMPING, self._slopes(told, self.p)
        for _ in range(_STEPS):
            predicted, variances, slopes = now
            errors = squared(told.outcomes - predicted)
            usual = np.median(errors) + np.maximum(variances, 1e-300)
            weights = 1 / (usual * (1 + errors / (4 * usual)))
            curvature = np.einsum("nik,n,nil->kl", slopes, weights, slopes) + np.diag(self.precision)
            down = np.einsum("nik,n,ni->k", slopes, weights, told.outcomes - predicted) - p * self.precision
            loss = errors @ weights + p * p @ self.precision
            for _ in range(_TRIES):
                tried = p + np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), down)
                then = self._slopes(told, tried)
                if squared(told.outcomes - then[0]) @ weights + tried * tried @ self.precision < loss:
                    break
                damping *= _FACTOR
            else:
                break
            change = np.abs(tried - p).max()
            p, now, damping = tried, then, damping / _FACTOR
            if change < _CONVERGED:
                break
        self.p = p
        return self

    def translated(self, most: float) -> Exemplars:
        """Exemplars of before as they would be now; those whose variance is above ``most`` are left out.

        Where h^-1 leaves Pi, or a parameter is stuck, the nearest movement in Pi takes the place of the exemplar, with
        the outcome that is predicted for it.
        """
        before = self.era.exemplars
        thetas, outcomes = before.thetas, before.outcomes
        a, b = 1 + self.p[: self.dim], self.p[self.dim : 2 * self.dim] * self.policies.sides
        free = np.abs(a) >= _STUCK
        inverse = self.middle + (thetas - self.middle - b) / np.where(free, a, 1)
        now = before._replace(thetas=self.policies.clip(np.where(free, inverse, thetas)))
        before_thetas, outcomes_now, certain = (
            self._h(now.thetas, self.p),
            self._g(outcomes, self.p),
            np.ones(len(thetas), dtype=bool),
        )
        elsewhere = np.flatnonzero((np.abs(before_thetas - thetas) > _SAME * self.policies.sides).any(axis=1))
        some = elsewhere[:: 1 + len(elsewhere) // _REPREDICTED]
        certain[elsewhere] = False
        if len(some):
            outcomes_now[some], variances, _ = self._slopes(now.some(some), self.p)
            certain[some] = variances * self.out <= most
        return now._replace(outcomes=outcomes_now).some(certain)

    def _h(self, thetas: Array, p: Array) -> Array:
        a, b = 1 + p[: self.dim], p[self.dim : 2 * self.dim] * self.policies.sides
        return np.asarray(self.middle + a * (thetas - self.middle) + b)

    def _g(self, outcomes: Array, p: Array) -> Array:
        shift, turn = np.split(p[2 * self.dim :], [self.out])
        outcomes_now = outcomes + self.spread * shift + (outcomes - self.mean) @ turn.reshape(self.out, self.out)
        return np.asarray(outcomes_now)

    def _slopes(self, told: Exemplars, p: Array) -> tuple[Array, Array, Array]:
        """Predictions, their variances, and their slopes by the parameters ``(n, outcome_dim, len(p))``."""
        expected, variances, jacobians = self.era.predict(told._replace(thetas=self._h(told.thetas, p)))
        turn = np.eye(self.out) + p[2 * self.dim + self.out :].reshape(self.out, self.out)
        turned = np.einsum("ji,njk->nik", turn, jacobians)
        slopes = np.zeros((len(expected), self.out, len(p)))
        slopes[:, :, : self.dim] = turned * (told.thetas - self.middle)[:, None]
        slopes[:, :, self.dim : 2 * self.dim] = turned * self.policies.sides
        for k in range(self.out):
            slopes[:, k, 2 * self.dim + k] = self.spread
            slopes[:, k, 2 * self.dim + self.out + k :: self.out] = expected - self.mean
        return self._g(expected, p), variances, slopes


def by_halves(era: Era, policies: Box, told: Exemplars) -> Array:
    """Squared errors ``(n,)`` of predicting movements by a era that is calibrated by the other half of them."""
    errors, half = np.empty(len(told.thetas)), np.arange(len(told.thetas)) % 2 == 0
    for test in (half, ~half):
        calibration, tested = Calibration(era, policies).fit(told.some(~test)), told.some(test)
        errors[test] = squared(calibration.predict(tested) - tested.outcomes)
    return errors
