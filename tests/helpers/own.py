"""A module with environments of a user: outcomes of 1 to 3 dimensions, a context, and pictures with faults."""

MODULE = '''
import numpy as np
from sgimd_torch import Box
from sgimd_torch.environments.protocol import check_movement
from sgimd_torch.environments.sketch import Sketch

class Slider:
    """A slider: theta in [0, 1] is its place in each dimension, which a context, if there is one, shifts."""
    dim, context_dim = 1, 0
    outcome_noise = 0.01

    def __init__(self):
        self.contexts = Box.cube(-0.1, 0.1, self.context_dim)
        self.policies, self.outcomes = Box.cube(0, 1, self.dim), Box.cube(-1, 3, self.dim)
        self.rest = np.zeros(self.dim)

    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        context, theta = check_movement(self, context, theta)
        return theta + context.sum() + rng.normal(0, self.outcome_noise, self.dim)

    def trace(self, context, theta, rng):
        outcome = self.execute(context, theta, rng)
        x, y = np.linspace(0, 1, 11), np.sin(np.pi * np.linspace(0, 1, 11))
        return Sketch(outcome, 0.1, [np.stack([outcome[0] * x, y], axis=1)[:, None]])

class Slider2(Slider):
    dim = 2

class Slider3(Slider):
    dim = 3

class Shifted(Slider2):
    context_dim = 2

class NoPicture(Slider):
    trace = None

class OtherMovement(Slider):
    """A subclass whose picture would be that of its parent."""
    def execute(self, context, theta, rng):
        return 2 * super().execute(context, theta, rng)

class WrongPicture(Slider):
    def trace(self, context, theta, rng):
        return [0.0, 1.0]

class StillPicture(Slider):
    def trace(self, context, theta, rng):
        return Sketch(np.zeros(1), 0.1, [np.zeros((5, 1, 2))])

class OtherPicture(Slider):
    def trace(self, context, theta, rng):
        return Sketch(np.zeros(2), 0.1, [np.zeros((5, 1, 2))])

class OftenLost(Slider):
    """It fails three times in four."""
    def execute(self, context, theta, rng):
        if theta[0] > 0.25:
            raise KeyError("elbow")
        return super().execute(context, theta, rng)

class LostPicture(Slider):
    def trace(self, context, theta, rng):
        return {}["where"]
'''
