"""A planar arm whose reachable set and inverse are exactly known, for tests, quick ablations and first steps.

arm = PlanarArm(); outcome = arm.execute(arm.observe(rng), theta, rng)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sgimd_torch.environments.protocol import check_movement, check_recording
from sgimd_torch.environments.sketch import Sketch
from sgimd_torch.spaces import Array, Box, check_count, check_rng, check_vector, first_entry

_STEP = 0.04  # time (s) between two drawings of a movement
_STEPS = 26  # number of drawings of a movement


class PlanarArm:
    """An arm of equal links in the plane, 1 m long; the outcome is the position of its end.

    ``theta`` in [0, 1]^n_joints is scaled to joint angles; .5 gives the angle 0. The first joint turns by pi rad at
    most, each other joint by 2 pi / n_joints rad. So the reachable set is exactly the disc of radius 1 m.

    Args:
        n_joints: number of joints, at least 2.
        noise: standard deviation of the noise on every joint angle (rad).
        context: true: the context is an angle (rad) in [-pi/4, pi/4], by which the whole arm is turned; false: the
            context is empty.
        outcomes: T; None for the square around the disc.

    Raises:
        ValueError: a number is out of its range, or ``outcomes`` does not contain ``rest``.
    """

    def __init__(
        self,
        n_joints: int = 7,
        *,
        noise: float = 0.0,
        context: bool = False,
        outcomes: Box | None = None,
    ) -> None:
        n_joints = check_count("n_joints", n_joints, 2)
        if not 0 <= noise < np.inf:
            raise ValueError(f"noise must be finite and >= 0, got {noise}")
        self.contexts = Box.cube(-np.pi / 4, np.pi / 4, int(context), names=("turn",) * context, unit="rad")
        self.policies = Box.cube(0.0, 1.0, n_joints)
        self.outcomes = Box.cube(-1, 1, 2, names=("x", "y"), unit="m") if outcomes is None else outcomes
        self.rest = self.outcomes.check("rest, where the straight arm ends,", [1.0, 0.0], "T has 2 dimensions")
        self.rest.flags.writeable = False
        self.noise = noise
        self._limits = np.array([np.pi] + [2 * np.pi / n_joints] * (n_joints - 1))  # rad; just enough to form a circle
        self.outcome_noise = self._mean_outcome_noise()

    def observe(self, rng: np.random.Generator) -> Array:
        """``(context_dim,)``, uniform in C."""
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        """``(2,)`` m, position of the end after one movement; see `Environment`."""
        context, theta = check_movement(self, context, theta)
        return self._end(context, self._moved(theta, rng))

    def execute_many(self, contexts: Array, thetas: Array, rngs: Sequence[np.random.Generator]) -> Array:
        """``(n, 2)`` m, outcomes of movements side by side; row i equals ``execute`` for row i bit for bit."""
        return self._end(contexts, np.stack([self._moved(*movement) for movement in zip(thetas, rngs, strict=True)]))

    def trace(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Sketch:
        """Drawings of a movement: in 1 s all joints turn smoothly from the straight arm to their angles."""
        context, theta = check_movement(self, context, theta)
        angles, times = self._moved(theta, rng), np.linspace(0, 1, _STEPS)[:, None]
        directions = np.cumsum(times**2 * (3 - 2 * times) * angles, axis=1) + context.sum()
        links = 1 / len(theta) * np.stack([np.cos(directions), np.sin(directions)], axis=2)
        joints = np.concatenate([np.zeros((_STEPS, 1, 2)), np.cumsum(links, axis=1)], axis=1)
        return Sketch(self._end(context, angles), _STEP, [joints])

    def angles(self, theta: ArrayLike) -> Array:
        """``(..., n_joints)`` rad, the joint angles of ``theta`` ``(..., n_joints)`` without noise.

        Raises:
            ValueError: ``theta`` is not in Pi.
        """
        return (2 * self.policies.check("theta", theta, "was a goal passed instead?") - 1) * self._limits

    def correspondence(self, times: ArrayLike, trajectory: ArrayLike) -> Array:
        """theta_d, the policy that ends in the last posture of a demonstrated trajectory; see `Translating`.

        The outcome depends only on the last posture, and theta_d reproduces this posture; so theta_d solves eq. (6).
        """
        _, trajectory = check_recording(times, trajectory, self.policies.dim, samples=1)
        turned = trajectory[-1] / self._limits
        beyond = np.abs(turned) > 1 + 1e-12  # the tolerance allows for rounding
        if beyond.any():
            limits = f"+-{self._limits[0]:.3f} rad, each other joint within +-{self._limits[1]:.3f} rad"
            entry = first_entry(trajectory[-1], beyond)
            raise ValueError(f"the first joint turns within {limits}, but in the last posture {entry}; is it in deg?")
        return self.policies.clip((turned + 1) / 2)

    def reachable(self, points: ArrayLike) -> NDArray[np.bool_]:
        """``(...)``, whether each of ``points`` ``(..., 2)`` is the outcome of some theta without noise."""
        is_reachable: NDArray[np.bool_] = np.linalg.norm(check_vector("points", points, 2), axis=-1) <= 1 + 1e-12
        return is_reachable

    def solve(self, context: ArrayLike, goal: ArrayLike) -> Array:
        """``(n_joints,)``, the theta that reaches ``goal`` without noise and bends all joints but the first equally.

        Raises:
            ValueError: ``goal`` is not one reachable point ``(2,)``, or ``context`` is not one point of C.
        """
        from scipy.optimize import root_scalar  # only here, because this import takes longer than all of sgimd_torch

        context, _ = check_movement(self, context, np.full(self.policies.dim, 0.5))
        goal = check_vector("goal", goal, 2, "was theta passed instead?")
        if goal.ndim != 1 or not self.reachable(goal):
            raise ValueError(f"goal must be one point at most 1 m away, got {goal}")
        n, circle = self.policies.dim, self._limits[1]
        radius = np.clip(np.linalg.norm(goal), self._radius(circle), self._radius(0.0))
        bend = root_scalar(lambda bend: self._radius(bend) - radius, bracket=(0.0, circle), xtol=1e-15).root
        # The end lies in the mean direction of the links.
        first = np.arctan2(goal[1], goal[0]) - context.sum() - (n - 1) / 2 * bend
        angles = np.array([np.angle(np.exp(1j * first))] + [bend] * (n - 1))
        return self.policies.clip((angles / self._limits + 1) / 2)

    def _moved(self, theta: Array, rng: np.random.Generator) -> Array:
        """``(n_joints,)`` rad, the angles with noise."""
        check_rng(rng)
        # Noise is drawn even if ``noise`` is 0, so that later draws do not depend on ``noise``.
        return self.angles(theta) + self.noise * rng.standard_normal(len(theta))

    def _end(self, context: Array, angles: Array) -> Array:
        """``(..., 2)`` m, the end of the arm with these ``angles`` ``(..., n_joints)``."""
        directions = np.cumsum(angles, axis=-1) + context.sum(axis=-1, keepdims=True)  # an empty context sums to 0
        return 1 / self.policies.dim * np.stack([np.cos(directions).sum(-1), np.sin(directions).sum(-1)], axis=-1)

    def _radius(self, bend: float) -> float:
        """Distance (m) of the end from the base if all joints but the first are at ``bend`` (rad)."""
        n = self.policies.dim
        return float(1 / n * np.cos((np.arange(n) - (n - 1) / 2) * bend).sum())

    def _mean_outcome_noise(self) -> float:
        """Root mean square deviation of outcomes per dimension, over uniform thetas, to first order in ``noise``."""
        n, straightness = self.policies.dim, np.sinc(self._limits[1] / np.pi)  # the mean cosine of a bend
        apart = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
        alignment = straightness**apart  # (n, n) the mean cosine between two links
        # A small turn of a joint moves the end by the angle times the lever, the distance from the joint to the end.
        levers = [alignment[joint:, joint:].sum() for joint in range(n)]
        return float(self.noise / n * np.sqrt(np.sum(levers) / 2))
