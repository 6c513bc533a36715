"""An era: exemplars of a time in which the robot stayed the same, and predictions from them.

era = Era(fitted, exemplars); outcomes, variances, slopes = era.predict(movements)
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.inverses.local_process import FittedKernel, predictions
from sgimd_torch.memory import Rows
from sgimd_torch.memory.compiled import compiled
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.memory.growing import Growing
from sgimd_torch.memory.neighbours import Flat
from sgimd_torch.spaces import Array

NEAR: Final = 60  # largest number of exemplars from which a movement is predicted
SURE: Final = 3.5  # statistic T from which on a test is passed
_LARGEST_GAIN: Final = 1.5  # bound of the log ratio of two errors


class Era:
    """Predictions from some ``exemplars`` at any theta, outside Pi, too, by lengths and kernel of ``fitted``."""

    def __init__(self, fitted: FittedKernel, exemplars: Exemplars) -> None:
        self.fitted, self.exemplars = fitted, exemplars
        inputs = self._in_lengths(exemplars)
        self._neighbours = Flat(Growing(inputs.shape[1]))
        self._neighbours.keys.append(inputs)

    def predict(self, movements: Exemplars) -> tuple[Array, Array, Array]:
        """Outcomes ``(n, outcome_dim)``, variances ``(n,)`` with noise, slopes ``(n, outcome_dim, theta_dim)``."""
        points, dim = self._in_lengths(movements), movements.thetas.shape[1]
        expected, variances, slopes = self._predict(self._neighbours.nearest(points, NEAR), points)
        return expected, variances, slopes[:, :, :dim] / self.fitted.units[1, :dim]

    def errors(self, movements: Exemplars) -> Array:
        """Squared errors ``(n,)`` of predicting these movements."""
        return squared(self.predict(movements)[0] - movements.outcomes)

    def left_out(self, rows: Rows) -> tuple[Array, Array]:
        """Squared errors ``(n,)`` of predicting each of these rows from all other rows, and their variances."""
        points = self._neighbours.keys.rows[rows]
        near = self._neighbours.nearest(points, NEAR + 1)
        itself_last = np.argsort(near == rows[:, None], axis=1, kind="stable")
        expected, variances, _ = self._predict(np.take_along_axis(near, itself_last[:, :-1], axis=1), points)
        return squared(expected - self.exemplars.outcomes[rows]), variances

    def left_out_each(self) -> Array:
        """Squared errors ``(n,)`` of predicting each of a few exemplars from all others."""
        kernels, inputs = compiled("sgimd_torch.inverses.kernels"), self._neighbours.keys.rows
        errors: Array = kernels.left_out(inputs, self.exemplars.outcomes, self.fitted.kernel)
        return errors

    def inflation(self, rows: Rows) -> float:
        """Mean squared error of predicting each of these rows from all others, divided by the expected one."""
        errors, variances = self.left_out(rows)
        return float(errors.sum() / (variances.sum() * self.exemplars.outcomes.shape[1] + 1e-300))

    def _in_lengths(self, exemplars: Exemplars) -> Array:
        raw, (origin, size) = np.concatenate((exemplars.thetas, exemplars.contexts), axis=1), self.fitted.units
        return np.asarray((raw - origin) / size)

    def _predict(self, near: Rows, points: Array) -> tuple[Array, Array, Array]:
        predicted = predictions(self._neighbours, self.exemplars.outcomes, near, points, self.fitted.kernel)
        expected, variances, noises, slopes = predicted
        return expected, variances + noises, slopes


def squared(differences: Array) -> Array:
    """Squared lengths of vectors, over the last axis."""
    return np.asarray((differences * differences).sum(axis=-1))


def gains_over(errors: Array, other_errors: Array, noise: float) -> Array:
    """By how much others predict better, ``(n,)``: log ratios of errors. Errors are given squared; the variance of the
    ``noise`` is added to them."""
    floor = noise**2 + 1e-300
    return np.clip(0.5 * np.log((errors + floor) / (other_errors + floor)), -_LARGEST_GAIN, _LARGEST_GAIN)


def better(errors: Array, other_errors: Array, noise: float) -> float:
    """T, self-normalised: how sure it is that others predict better."""
    gains = gains_over(errors, other_errors, noise)
    return float(gains.sum() / np.sqrt(squared(gains) + 1e-300))
