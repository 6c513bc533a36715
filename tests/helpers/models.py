"""What the tests of the forward model share: problems over given exemplars, and a model that was taught before."""

import numpy as np

from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.forward_model.model import TRUSTED_UP_TO
from sgimd_torch.forward_model.shared import model_of
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Box
from worlds import Boxes

ARM = PlanarArm(7)


def boxes(policies: Box, noise: float = 0.0) -> Boxes:
    """A robot of which only Pi and the noise matter; its T is wide."""
    return Boxes(Box.cube(0.0, 1.0, 0), policies, Box.cube(-1e4, 1e4, 2), np.zeros(2), noise)


def problem_of(memory, model=None, *, environment=ARM, seed=0, inverse=LocallyLinear, trust=TRUSTED_UP_TO):
    """A problem with these exemplars; if there is a ``model``, its parts share one that has learnt the same."""
    problem = Problem(environment, seed, memory, inverse=inverse)
    if model is not None:
        model_of(problem, trust=trust).load_state_dict(model.state_dict())
    return problem
