"""Motor primitives and the correspondence problem: from theta to joint trajectories, and back.

Section 4.1 of Nguyen & Oudeyer (2014). Each joint has four knots: its positions at 0, delta/3, 2 delta/3 and delta,
where delta is the duration. The trajectory is a Gaussian distance weighting of the knots (eq. 5). A demonstrated
trajectory is translated to the theta that reproduces it most closely (eq. 6).
    times, trajectory = primitive.trajectory(theta); theta_d = primitive.correspondence(times_d, trajectory_d)
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import Primitive, check_recording
from sgimd_torch.spaces import Array, Box, check_count


class Controller(Protocol):
    """An open-loop controller: the commands of a movement depend on its theta alone."""

    @property
    def policies(self) -> Box:
        """Pi."""
        ...

    def at(self, theta: Array, times: Array) -> Array:
        """Commands ``(n_times, n_commands)`` at ``times`` ``(n_times,)`` s after the start."""
        ...


class GaussianPrimitive(Primitive):
    """Joint trajectories by Gaussian distance weighting of knots, eq. (5).

    theta in [0, 1]^(n_knots n_joints + 1) holds the knots joint by joint, scaled to the ranges of the joints, then the
    duration.

    Args:
        joints: ``(n_joints,)`` box of joint ranges (rad).
        durations: shortest and longest duration delta (s), above 0.
        sharpness: factor s in sigma = s / delta^2 of four knots; of more knots sigma is larger, so that neighbours
            overlap alike. A factor below 5 makes the fit of eq. (6) ill-conditioned, a factor above 12 makes movements
            jerky.
        n_knots: number of knots of each joint, from 2 to 100.
        start: ``(n_joints,)`` posture in which every movement begins, a knot before those of theta; None: movements
            begin near their first knot.
        speeds, accelerations: ``(n_joints,)`` limits (rad/s and rad/s^2), inf for none; a movement that would exceed
            them lasts longer.

    Raises:
        ValueError: the durations do not satisfy 0 < shortest < longest, the sharpness is not above 0, there are
            too few or too many knots, or the start lies outside the ranges.
    """

    def __init__(
        self,
        joints: Box,
        durations: tuple[float, float],
        *,
        sharpness: float = 9.0,
        n_knots: int = 4,
        start: ArrayLike | None = None,
        speeds: ArrayLike = np.inf,
        accelerations: ArrayLike = np.inf,
    ) -> None:
        if not 0 < durations[0] < durations[1]:
            raise ValueError(f"durations must be 0 < shortest < longest in seconds, got {durations}")
        if not sharpness > 0:
            raise ValueError(f"sharpness must be above 0, got {sharpness}")
        self.joints = self.ranges = joints
        self.durations = durations
        self.n_knots = check_count("n_knots", n_knots, 2, 100)
        self.policies = Box.cube(0.0, 1.0, joints.dim * n_knots + 1)
        self.start = None if start is None else joints.check("start", start, "is it in the ranges?")
        self.speeds, self.accelerations = (np.broadcast_to(limits, joints.dim) for limits in (speeds, accelerations))
        n = n_knots + (start is not None)
        self.sharpness = sharpness * ((n - 1) / 3) ** 2
        self._centres = np.arange(n) / (n - 1)  # times of the knots, as shares of the duration
        self._blend = np.eye(n)
        if start is not None:
            # Deviation: the first weight is scaled to be 1 at the start, and the others lose what they weigh then, so
            # the trajectory begins in the start posture. Weights stay above 0 and sum to 1.
            first = self._gaussians(np.zeros(1))[0]
            self._blend[0] = [1 / first[0], *(-first[1:] / first[0])]
        self._first, self._second = self._derivatives(np.linspace(0.0, 1.0, 101))

    def duration(self, theta: Array) -> float:
        """delta (s) of one ``(theta_dim,)`` theta."""
        shortest, longest = self.durations
        wanted = shortest + float(theta[-1]) * (longest - shortest)
        if not np.isfinite([self.speeds, self.accelerations]).any():
            return wanted
        knots = self._knots(theta).T
        first, second = (np.abs(derivative @ knots).max(axis=0) for derivative in (self._first, self._second))
        return float(max(wanted, (first / self.speeds).max(), np.sqrt(second / self.accelerations).max()))

    def at(self, theta: Array, times: Array) -> Array:
        """``(n_times, n_joints)`` joint angles (rad) at ``times`` (s); after delta the last posture is held."""
        phases = np.minimum(times / self.duration(theta), 1.0)
        return self._weights(phases) @ self._knots(theta).T

    def trajectory(self, theta: ArrayLike, rate: float = 50.0) -> tuple[Array, Array]:
        """Times ``(n_times,)`` (s) from 0 to delta, and joint angles ``(n_times, n_joints)`` (rad) at these times.

        Args:
            theta: ``(theta_dim,)`` in [0, 1].
            rate: least number of samples per second; the last sample is at delta.

        Raises:
            ValueError: theta has another shape or leaves the box.
        """
        theta = self.policies.check("theta", theta, "was a goal passed instead?")
        duration = self.duration(theta)
        times = np.linspace(0.0, duration, max(2, int(np.ceil(duration * rate)) + 1))
        return times, self.at(theta, times)

    def fastest(self) -> tuple[Array, Array]:
        """``(n_joints,)`` rad/s and rad/s^2: the largest speeds and accelerations that any theta commands.

        They occur at the shortest duration, with each knot at the end of its range that increases them.
        """
        first, second = self._derivatives(np.linspace(0.0, 1.0, 1001))
        # The weights sum to 1, so their derivatives sum to 0: the positive ones sum to half of all absolute values.
        speed, acceleration = (np.abs(derivative).sum(axis=1).max() / 2 for derivative in (first, second))
        speeds, accelerations = (self.joints.sides * most for most in (speed, acceleration))
        return (
            np.minimum(speeds / self.durations[0], self.speeds),
            np.minimum(accelerations / self.durations[0] ** 2, self.accelerations),
        )

    def correspondence(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """theta_d, the policy that reproduces a demonstrated trajectory most closely; see `Translating`.

        delta is the duration of the demonstration. If this is below the shortest duration, the demonstration is slowed
        down; if it is above the longest duration, the demonstration is refused, as a faster movement would be another
        movement. For a fixed delta eq. (5) is linear in the knots, so each joint is one bounded linear least squares
        problem, which is solved by the paper's algorithm (trust-region reflective). There must be ``n_knots`` samples.
        """
        from scipy.optimize import lsq_linear  # only here, because this import takes longer than all of sgimd_torch

        times, trajectory = check_recording(
            times, trajectory, self.joints.dim, samples=self.n_knots, longest=self.durations[1]
        )
        span = times[-1] - times[0]
        weights = self._weights((times - times[0]) / span)
        low, sides = self.joints.low, self.joints.sides
        scaled = (trajectory - low) / sides
        if self.start is not None:  # a known knot
            scaled, weights = scaled - weights[:, :1] * (self.start - low) / sides, weights[:, 1:]
        # If the knots of a joint lie in [0, 1], least squares without bounds is exact to rounding; lsq_linear is not.
        knots = np.linalg.lstsq(weights, scaled, rcond=None)[0]
        for joint in np.flatnonzero((np.abs(knots - 0.5) > 0.5 + 1e-9).any(axis=0)):
            knots[:, joint] = lsq_linear(weights, scaled[:, joint], bounds=(0.0, 1.0), method="trf", tol=1e-12).x
        shortest, longest = self.durations
        pace = (np.clip(span, shortest, longest) - shortest) / (longest - shortest)
        return self.policies.clip(np.append(knots.T.ravel(), pace))

    def _knots(self, theta: Array) -> Array:
        """``(n_joints, n)`` rad, the knots, the start posture before those of theta."""
        knots = theta[:-1].reshape(self.joints.dim, self.n_knots)
        knots = self.joints.low[:, None] + knots * self.joints.sides[:, None]
        return knots if self.start is None else np.column_stack([self.start, knots])

    def _weights(self, phases: Array) -> Array:
        """``(n_phases, n)``, the weight of each knot."""
        weights = self._gaussians(phases)
        return weights if self.start is None else weights @ self._blend

    def _gaussians(self, phases: Array) -> Array:
        # Deviation: the paper prints exp(+sigma |.|^2) and five terms; the sign and i = 0..3 are ours. With
        # sigma = s / delta^2 the weights depend only on the phase t / delta.
        weights = np.exp(-self.sharpness * (phases[:, None] - self._centres) ** 2)  # eq. (5)
        return weights / weights.sum(axis=1, keepdims=True)

    def _derivatives(self, phases: Array) -> tuple[Array, Array]:
        """``(n_phases, n)``, first and second derivatives of the weights by the phase."""
        weights = self._gaussians(phases)
        slopes = -2 * self.sharpness * (phases[:, None] - self._centres)  # slopes of the logarithms of the weights
        apart = slopes - (weights * slopes).sum(axis=1, keepdims=True)
        first = weights * apart
        second = weights * (apart**2 - (first * slopes).sum(axis=1, keepdims=True))
        return first @ self._blend, second @ self._blend
