"""What compiled functions get and give, in tuples with names, which numba takes; arrays of arguments are read-only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sgimd_torch.spaces import Array


class Kernel(NamedTuple):
    """Kernel of variance 1. ``scale`` multiplies all inputs. The rough part has the ``share`` of the variance, and a
    length scale that is ``finer`` times shorter. ``noise`` is a variance, relative to the kernel's."""

    scale: float
    finer: float
    share: float
    noise: float


class Movements(NamedTuple):
    """All movements in memory, and their units.

    Attributes:
        inputs: ``(n, dim)``, theta and context of each movement, in lengths: less the origin, divided by the length.
        thetas, outcomes: ``(n, theta_dim)`` and ``(n, outcome_dim)``.
        units: ``(2, dim)``, origin and length scale of each input.
        spreads: ``(dim,)``, standard deviation of each input.
        box: ``(2, theta_dim)``, corners of the box around all thetas.
    """

    inputs: Array
    thetas: Array
    outcomes: Array
    units: Array
    spreads: Array
    box: Array


class Question(NamedTuple):
    """A question to an inverse model.

    Attributes:
        context: ``(context_dim,)``.
        goal: ``(outcome_dim,)``.
        starts: ``(starts,)``, rows of the movements at which steps begin.
        alike: ``(processes, k)``, rows of the movements of each process, the one most like a start first.
        process_of: ``(starts,)``, process of each start, in the order of the starts.
        linear: ``(theta_dim,)``, answer by linear regression.
    """

    context: Array
    goal: Array
    starts: np.ndarray
    alike: np.ndarray
    process_of: np.ndarray
    linear: Array


class GaussianProcess(NamedTuple):
    """Gaussian process, given some movements.

    Attributes:
        inputs: ``(dim, n)``, theta and context of each movement, in lengths.
        kernel: kernel.
        factor: ``(n, n)`` Cholesky factor of the covariance of the movements.
        noises: ``(n,)``, variance of the noise of each movement, relative to the kernel's.
        weights: ``(outcome_dim, n)``, inverse covariance times outcomes.
        mean: ``(outcome_dim,)``, mean outcome.
        variance: most likely variance, by which the kernel is multiplied.
    """

    inputs: Array
    kernel: Kernel
    factor: Array
    noises: Array
    weights: Array
    mean: Array
    variance: float


class Predictions(NamedTuple):
    """Predicted movements.

    Attributes:
        outcomes: ``(n, outcome_dim)``, expected outcomes.
        variances: ``(n,)``, without noise.
        noises: ``(n,)``, variances of the noise.
        slopes: ``(n, outcome_dim, dim)``, slopes of the outcomes by the inputs.
    """

    outcomes: Array
    variances: Array
    noises: Array
    slopes: Array
