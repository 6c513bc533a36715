"""The numbers that everything runs with unless somebody asks for others: those of the paper, and those of results/.

Whoever changes one changes every run that does not name it. So it stands here a second time, and what was measured
with it (results/, the README) has to be made anew.
"""

import inspect
import math

import pytest

from sgimd_torch.catalogue import load

TREE = {"window": 24, "modes": (0.7, 0.2, 0.1), "near": 0.05}  # of section 3.2
PURSUIT = {"budget": 15, "global_range": (0.05, 0.95), "give_up": -0.5}
NETWORKS = {"members": 3, "hidden": (64, 64), "lr": 0.01, "beta": 0.5}
ONLINE = {"seed": 0, "every": 50, "rate": 0.3, "focus": 0.0}
DEFAULTS = {
    "algorithms:goal_babbling": PURSUIT,
    "algorithms:imitation": {"epsilon": 0.05},
    "algorithms:imitating": {"repeats": 10, "epsilon": 0.05},
    "algorithms.asking:searched": {"repeats": 10, "epsilon": 0.05},
    "algorithms.asking:sgim_acts": {"cost": 1.0},
    "environments.fishing_rod:FishingRod": {"noise": 0.032, "max_yaw": 0.0, "max_wind": 0.0, "line": 1.0},
    "environments.motor_primitives:GaussianPrimitive": {"n_knots": 4, "sharpness": 9.0},
    "environments.planar_arm:PlanarArm": {"n_joints": 7, "length": 1.0, "noise": 0.0},
    "evaluation:evaluate": {"repeats": 3},
    "forward_model.anchored:Trust": {"noise": 0.04, "share": 0.1, "doubt": 0.06, "caution": 10.0, "error": 0.25},
    "forward_model.ensemble:Ensemble": NETWORKS,
    "forward_model.model:ForwardModel": {"members": 3, "hidden": (64, 64), **ONLINE},
    "goals.alp_gmm:AlpGmm": {"refit": 50, "memory": 250, "components": 10, "uniform": 0.2},
    "goals.interest_map:InterestMap": {**TREE, "g_max": 30, "cuts": 20, "min_side": 1 / 15, "max_aspect": 5.0},
    "goals.progress_grid:ProgressGrid": TREE,
    "goals.strategic:StrategicInterest": {"anywhere": 0.5, "greatest": 10, "temperature": 0.03},
    "inverses.local:LocalInverse": {"h_max": 10, "k_max": 10, "alpha": 0.5, "width": 0.25},
    "inverses.local:NearestNeighbour": {"k": 10},
    "inverses.locally_linear:LocallyLinear": {"ridge": 0.001},
    "rivals.quality_diversity:map_elites": {"first": 100, "sd": 0.05, "batch": 10},
    "rivals.quality_diversity:cma_me": {"emitters": 5, "sd": 0.1},
    "searches.cma_es:cma_es": {"sd": 0.05, "population": 4},
    "searches.perturb:perturb": {"sd": 0.05},
    "searches.simplex:nelder_mead": {"noise": 0.05, "step": 0.1, "xatol": 0.1, "fatol": 0.05},
    "searches.through_model:gradient_search": {"noise": 0.05},
    "strategies:GoalBabbling": {**PURSUIT, "tolerance": 0.02},
    "teachers.answering:AnsweringTeacher": {"within": math.inf, "takes": 0},
    "teachers:AskedTeacher": {"patience": 30},
    "teachers:InitialTeacher": {"every": 10},
    "teachers:PeriodicTeacher": {"every": 30},
    "teachers:least_explored": {"tiles": 10},
}


@pytest.mark.parametrize(("place", "numbers"), DEFAULTS.items(), ids=DEFAULTS)
def test_a_default_is_the_number_that_results_were_made_with(place, numbers):
    parameters = inspect.signature(load(f"sgimd_torch.{place}")).parameters.values()
    given = {each.name: each.default for each in parameters if type(each.default) in (int, float, tuple)}
    assert given == numbers
