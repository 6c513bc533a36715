"""What the tests of the forward model share: problems over given exemplars, and a model that was taught before."""

from dataclasses import dataclass, field

import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.model import TRUSTED_UP_TO
from sgimd_torch.forward_model.shared import model_of
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box

ARM = PlanarArm(7)


@dataclass
class Boxes:
    """A robot of which only its boxes and its noise matter."""

    policies: Box
    outcome_noise: float = 0.0
    contexts: Box = field(default_factory=lambda: Box.cube(0.0, 1.0, 0))
    outcomes: Box = field(default_factory=lambda: Box.cube(-1e4, 1e4, 2))
    rest: Array = field(default_factory=lambda: np.zeros(2))


def problem_of(memory, model=None, *, environment=ARM, seed=0, inverse=LocallyLinear, trust=TRUSTED_UP_TO):
    """A problem with these exemplars; if there is a ``model``, its parts share one that has learnt the same."""
    problem = Problem(environment, seed, memory, inverse=inverse)
    if model is not None:
        model_of(problem, trust=trust).load_state_dict(model.state_dict())
    return problem
