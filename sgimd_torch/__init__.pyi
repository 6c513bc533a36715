import typing

from .algorithms.paper import imitation as imitation
from .algorithms.paper import observation as observation
from .algorithms.paper import random_exploration as random_exploration
from .algorithms.paper import sagg_riac as sagg_riac
from .algorithms.paper import sagg_riac_letter as sagg_riac_letter
from .algorithms.paper import sgim_d as sgim_d
from .algorithms.paper import sgim_d_letter as sgim_d_letter
from .algorithms.practice import practice as practice
from .algorithms.practice import practice_taught as practice_taught
from .competence import performance as performance
from .demonstrations import load_demonstrations as load_demonstrations
from .demonstrations import save_demonstrations as save_demonstrations
from .environments.fishing_rod import FishingRod as FishingRod
from .environments.motor_primitives import GaussianPrimitive as GaussianPrimitive
from .environments.planar_arm import PlanarArm as PlanarArm
from .environments.protocol import Environment as Environment
from .environments.protocol import SimulationError as SimulationError
from .environments.sketch import Sketch as Sketch
from .evaluation import Benchmark as Benchmark
from .evaluation import Evaluation as Evaluation
from .evaluation import evaluate as evaluate
from .evaluation import load_benchmark as load_benchmark
from .evaluation import save_benchmark as save_benchmark
from .goals.interest_map import InterestMap as InterestMap
from .goals.uniform import UniformGoals as UniformGoals
from .inverses.local import LocalInverse as LocalInverse
from .inverses.locally_linear import LocallyLinear as LocallyLinear
from .inverses.nearest import NearestNeighbour as NearestNeighbour
from .learner import Learner as Learner
from .memory import Memory as Memory
from .parts import Explore as Explore
from .parts import Goals as Goals
from .parts import Inverse as Inverse
from .parts import Judge as Judge
from .parts import Problem as Problem
from .parts import Search as Search
from .parts import Social as Social
from .parts import Strategy as Strategy
from .parts import Teacher as Teacher
from .record.replay import load_life as load_life
from .record.replay import save_life as save_life
from .runs.load import load_learner as load_learner
from .searches.perturb import Perturb as Perturb
from .searches.simplex import NelderMead as NelderMead
from .session import run as run
from .spaces import Box as Box
from .spaces import Demonstration as Demonstration
from .spaces import Episode as Episode
from .spaces import Estimate as Estimate
from .spaces import Failure as Failure
from .spaces import Move as Move
from .spaces import stream as stream
from .teachers import AskedTeacher as AskedTeacher
from .teachers import InitialTeacher as InitialTeacher
from .teachers import PeriodicTeacher as PeriodicTeacher

__version__: str

def __getattr__(name: str) -> typing.Any: ...  # names of rooms
