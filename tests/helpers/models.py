"""Helpers for tests of the forward model: problems with given exemplars, and with a trained model."""

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
    """A robot without contexts, with given Pi and noise, and with a T that contains all outcomes."""
    return Boxes(Box.cube(0.0, 1.0, 0), policies, Box.cube(-1e4, 1e4, 2), np.zeros(2), noise)


def problem_of(memory, model=None, *, environment=ARM, seed=0, inverse=LocallyLinear, trust=TRUSTED_UP_TO):
    """A problem with the exemplars of ``memory``; its parts share a copy of the trained ``model``, if one is given."""
    problem = Problem(environment, seed, memory, inverse=inverse)
    if model is not None:
        model_of(problem, trust=trust).load_state_dict(model.state_dict())
    return problem
