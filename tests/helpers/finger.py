"""A soft finger with hysteresis: a third of the last bend stays, unseen."""

import numpy as np
from numpy.typing import ArrayLike

from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.spaces import Array, Box

KEPT = 1 / 3  # share of the last bend that stays
LINK = 50.0  # mm, length of each of three chambers


class Finger:
    """theta: the bends of three chambers, from -1 to 1 rad. outcome: place of the tip."""

    contexts = Box.cube(0, 1, 0)
    policies = Box.cube(0, 1, 3)
    outcomes = Box([0, -100], [150, 100], names=("x", "y"), unit="mm")
    rest = np.array([150.0, 0.0])
    outcome_noise = 0.5

    def __init__(self, kept: float = KEPT) -> None:
        self.kept, self.bend = kept, np.zeros(3)

    def observe(self, rng: np.random.Generator) -> Array:
        return self.contexts.sample(rng)

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Array:
        _, theta = check_movement(self, context, theta)
        self.bend = 2 * theta - 1 + self.kept * self.bend
        middles = np.cumsum(self.bend) - self.bend / 2  # directions of the chords of three arcs
        chords = LINK * np.sinc(self.bend / 2 / np.pi)
        return np.array([chords @ np.cos(middles), chords @ np.sin(middles)]) + rng.normal(0, self.outcome_noise, 2)
