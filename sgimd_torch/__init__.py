"""SGIM-D: robot learning by curiosity and demonstration (Nguyen & Oudeyer, Autonomous Robots 36(3), 2014).

Where each part of the paper lives:

    2.1    contexts, policies, outcomes, episodes          spaces, environment
    3      the learner and the five algorithms             learner, algorithms, session
    3.2    goal interest mapping, deciding a goal          interest, competence (eqs. 1-4)
    4      the fishing rod                                 fishing_rod, casting, film
    4.1    motor primitives, correspondence                motor_primitives (eqs. 5, 6)
    4.2    imitate a policy                                strategies
    4.3    performance                                     competence (eq. 7)
    4.4    goal-directed policy optimisation               strategies, inverse_model (eqs. 8, 9), search
    5.2    evaluation                                      evaluation (eq. 10)
    5.3    demonstrations and teachers                     demonstrations, teachers
    -      our addition: a forward model                   ensemble, forward_model, anchored, model_inverse,
                                                           gradient_search, model_diagnostics
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from sgimd_torch.algorithms import imitation, observation, random_exploration, sagg_riac, sgim_d
from sgimd_torch.competence import absolute_performance, performance
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.environments.motor_primitives import GaussianPrimitive
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment, SimulationError
from sgimd_torch.evaluation import Benchmark, Evaluation, evaluate, load_benchmark, save_benchmark
from sgimd_torch.goals.interest_map import InterestMap, UniformGoals
from sgimd_torch.goals.progress_grid import ProgressGrid
from sgimd_torch.inverses.local import LocalInverse, NearestNeighbour
from sgimd_torch.inverses.locally_linear import LocallyLinear
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.searches.perturb import perturb
from sgimd_torch.searches.simplex import nelder_mead
from sgimd_torch.session import run
from sgimd_torch.spaces import Box, Demonstration, Episode, Estimate, Move, stream
from sgimd_torch.teachers import AskedTeacher, InitialTeacher, PeriodicTeacher

if TYPE_CHECKING:
    from sgimd_torch.environments.fishing_rod import FishingRod

__version__ = "0.1.0"
__all__ = [
    "AskedTeacher",
    "Benchmark",
    "Box",
    "Demonstration",
    "Environment",
    "Episode",
    "Estimate",
    "Evaluation",
    "FishingRod",
    "GaussianPrimitive",
    "InitialTeacher",
    "InterestMap",
    "Learner",
    "LocalInverse",
    "LocallyLinear",
    "Memory",
    "Move",
    "NearestNeighbour",
    "PeriodicTeacher",
    "PlanarArm",
    "ProgressGrid",
    "SimulationError",
    "UniformGoals",
    "absolute_performance",
    "evaluate",
    "imitation",
    "load_benchmark",
    "load_demonstrations",
    "nelder_mead",
    "observation",
    "performance",
    "perturb",
    "random_exploration",
    "run",
    "sagg_riac",
    "save_benchmark",
    "save_demonstrations",
    "sgim_d",
    "stream",
]


def __getattr__(name: str) -> object:
    if name == "FishingRod":  # MuJoCo is loaded only for those who fish
        from sgimd_torch.environments.fishing_rod import FishingRod

        return FishingRod
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
