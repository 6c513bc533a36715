"""What a user would pick instead: programs of other people, used as their own pages say, beside `practice`.

    scripts/others                                     Explauto, which needs old libraries, into .others
    experiments/compare.py others                      the lives of the page OTHERS
    experiments/compare.py others --only arm-7 --seeds 1000 --results development

Each program sees the boxes of a robot, its goals, and the outcomes of its own movements. After each number of movements
it answers the goals itself, and `process` answers them from the same movements. Times are by the clock.
"""

from __future__ import annotations

import json
import subprocess
import time
import warnings
from collections.abc import Callable, Collection, Iterable
from contextlib import closing
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, Final

import cma
import gymnasium
import numpy as np
import torch
from scipy.optimize import minimize
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from lives import Life
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.extras.rivals.quality_diversity import cma_me_alone
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import ROD, load_word
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, stream
from sgimd_torch.tasks import Task, benchmark_of
from sgimd_torch.tasks.robots import arm_benchmark
from toys import soft_arm

COUNTS: Final = (50, 100, 300, 1000, 3000)  # movements after which all answer
GOALS: Final = 48  # largest number of goals
SEEDS: Final = range(280, 290)
TABLE: Final = "others.csv"
EXPLAUTO: Final = Path(__file__).parents[1] / ".others" / "bin" / "python"
NO_CONTEXT: Final = np.zeros(0)
STARTS: Final = 3  # nearest movements from which an answer is optimised
FITTED: Final = 300  # movements by which the kernel of scikit-learn's process is chosen


def robot_of(name: str) -> tuple[Environment, Array]:
    """A robot of the comparison, and goals within its reach."""
    if name == "rod":
        task = load_word("environment", ROD)()
    elif name == "soft-arm":
        task = soft_arm()
    elif name == "pusher-arm":
        file = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "pusher.xml"
        task = Task(MujocoRobot(file, outcome="body:tips_arm:xyz"))
    else:
        arm = PlanarArm(int(name.removeprefix("arm-")), noise=0.01)
        task = Task(arm, partial(arm_benchmark, arm))
    goals = benchmark_of(task, None)[0].goals
    return task.environment, goals[:: 1 + len(goals) // GOALS]


ROBOTS: Final = ("arm-5", "arm-7", "arm-50", "soft-arm", "rod", "pusher-arm")


class Rival:
    """A program; Pi and T are unit cubes for it. Unless it chooses its movements, they are uniform in Pi.

    Args:
        robot: robot, of which the boxes are read.
        goals: ``(n, outcome_dim)`` goals, in units of T.
        seed: seed of its random numbers.
    """

    def __init__(self, robot: Environment, goals: Array, seed: int) -> None:
        self.robot, self.goals, self.rng, self.seed = robot, goals, stream(seed, "rival"), seed
        self.thetas, self.outcomes = list[Array](), list[Array]()

    def move(self) -> Array:
        """The next movement."""
        return self.rng.random(self.robot.policies.dim)

    def tell(self, theta: Array, outcome: Array) -> None:
        """Learn the outcome of a movement."""
        self.thetas.append(theta)
        self.outcomes.append(outcome)

    def close(self) -> None:
        """End what it has begun. Default: nothing."""

    def answers(self) -> Array:
        """``(n, theta_dim)``, a movement for each goal: here the movement that came nearest."""
        return np.array([self.thetas[row] for row in self.nearest(1)[:, 0]])

    def nearest(self, k: int) -> Any:
        """Rows ``(n, k)`` of the movements that came nearest to each goal."""
        distances = np.linalg.norm(np.array(self.outcomes) - self.goals[:, None], axis=2)
        return np.argsort(distances, axis=1, kind="stable")[:, :k]


class GaussianProcess(Rival):
    """scikit-learn's exact process of random movements; an answer minimises the distance of its mean from the goal."""

    def answers(self) -> Array:
        thetas, outcomes, dim = np.array(self.thetas), np.array(self.outcomes), self.robot.policies.dim
        kernel = ConstantKernel() * Matern(np.ones(dim), (0.05, 100), nu=2.5) + WhiteKernel(1e-3, (1e-8, 1))
        some = self.rng.permutation(len(thetas))[:FITTED]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # of a robot without noise, or a parameter of no effect
            chosen = GaussianProcessRegressor(kernel, normalize_y=True, random_state=self.seed)
            chosen.fit(thetas[some], outcomes[some])
        process = GaussianProcessRegressor(chosen.kernel_, normalize_y=True, optimizer=None).fit(thetas, outcomes)
        steps = 1e-4 * np.concatenate((np.zeros((1, dim)), np.eye(dim)))

        def miss(theta: Array, goal: Array) -> tuple[float, Array]:
            squares = np.square(process.predict(theta + steps) - goal).sum(axis=1)
            return float(squares[0]), (squares[1:] - squares[0]) / 1e-4

        def answer(goal: Array, rows: Any) -> Array:
            search = partial(minimize, miss, args=(goal,), jac=True, method="L-BFGS-B", bounds=[(0, 1)] * dim)
            ends = [search(thetas[row], options={"maxiter": 30}) for row in rows]
            return np.asarray(min(ends, key=lambda end: end.fun).x)

        return np.array([answer(goal, rows) for goal, rows in zip(self.goals, self.nearest(STARTS), strict=True)])


class Network(Rival):
    """A network in PyTorch from theta to outcome, fitted to random movements; answers descend from the nearest one."""

    def answers(self) -> Array:
        torch.manual_seed(self.seed)
        thetas, outcomes = (torch.tensor(np.array(rows), dtype=torch.float32) for rows in (self.thetas, self.outcomes))
        n_in, n_out = thetas.shape[1], outcomes.shape[1]
        network = torch.nn.Sequential(
            *(torch.nn.Linear(n_in, 128), torch.nn.Tanh(), torch.nn.Linear(128, 128), torch.nn.Tanh()),
            torch.nn.Linear(128, n_out),
        )
        optimiser = torch.optim.AdamW(network.parameters(), 2e-3, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, 2000)
        for _ in range(2000):
            rows = torch.randint(len(thetas), (min(128, len(thetas)),))
            loss = (network(2 * thetas[rows] - 1) - outcomes[rows]).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        goals = torch.tensor(self.goals, dtype=torch.float32)
        found = torch.nn.Parameter(thetas[self.nearest(1)[:, 0]].clone())
        descent = torch.optim.Adam([found], 1e-2)
        for _ in range(200):
            descent.zero_grad()
            (network(2 * found - 1) - goals).square().sum().backward()
            descent.step()
            found.data.clamp_(0, 1)
        return found.detach().double().numpy()


class EachGoal(Rival):
    """CMA-ES for one goal after another, a generation at a time, from the movement that came nearest, which answers."""

    sd = 0.4  # of the first generation, relative to the sides of Pi

    def __init__(self, robot: Environment, goals: Array, seed: int) -> None:
        super().__init__(robot, goals, seed)
        self._searches = dict[int, Any]()
        self._goal, self._asked, self._misses = -1, list[Array](), list[float]()

    def move(self) -> Array:
        if len(self._misses) == len(self._asked):
            self._goal = (self._goal + 1) % len(self.goals)
            if self._goal not in self._searches:
                begin = self.answers()[self._goal] if self.thetas else np.full(self.robot.policies.dim, 0.5)
                options = {"bounds": [0, 1], "verbose": -9, "seed": self.seed + 1}
                self._searches[self._goal] = cma.CMAEvolutionStrategy(begin, self.sd, options)
            self._asked, self._misses = self._searches[self._goal].ask(), []
        return np.asarray(self._asked[len(self._misses)])

    def tell(self, theta: Array, outcome: Array) -> None:
        super().tell(theta, outcome)
        self._misses.append(float(np.linalg.norm(outcome - self.goals[self._goal])))
        if len(self._misses) == len(self._asked):
            self._searches[self._goal].tell(self._asked, self._misses)


class OfThisLibrary(Rival):
    """A learner of this library, with its own answers: ``make`` (robot, seed) -> learner."""

    def __init__(
        self, robot: Environment, goals: Array, seed: int, *, make: Callable[[Environment, int], Learner]
    ) -> None:
        super().__init__(robot, goals, seed)
        self._learner = make(robot, seed)

    def move(self) -> Array:
        move = self._learner.ask(NO_CONTEXT)
        assert move is not None  # it never rests
        return np.asarray((move.theta - self.robot.policies.low) / self.robot.policies.sides)

    def tell(self, theta: Array, outcome: Array) -> None:
        super().tell(theta, outcome)
        self._learner.tell(self.robot.outcomes.low + outcome * self.robot.outcomes.sides)

    def answers(self) -> Array:
        policies, outcomes = self.robot.policies, self.robot.outcomes
        goals = outcomes.low + self.goals * outcomes.sides
        return np.array([(self._learner.inverse(NO_CONTEXT, g).theta - policies.low) / policies.sides for g in goals])


class Explauto(Rival):
    """Explauto, in a process of its own libraries; see explauto_rival.py."""

    def __init__(self, robot: Environment, goals: Array, seed: int) -> None:
        super().__init__(robot, goals, seed)
        if not EXPLAUTO.exists():
            raise FileNotFoundError(f"Explauto is not installed in {EXPLAUTO.parents[1]}; run scripts/others")
        program = str(Path(__file__).with_name("explauto_rival.py"))
        self._child = subprocess.Popen(
            [EXPLAUTO, program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self._said([robot.policies.dim, robot.outcomes.dim, seed])

    def _said(self, words: Any) -> Any:
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(json.dumps(words) + "\n")
        self._child.stdin.flush()
        return json.loads(self._child.stdout.readline())

    def move(self) -> Array:
        return np.array(self._said(["move"]))

    def tell(self, theta: Array, outcome: Array) -> None:
        super().tell(theta, outcome)
        self._said(["tell", theta.tolist(), outcome.tolist()])

    def answers(self) -> Array:
        return np.array(self._said(["answers", self.goals.tolist()]))

    def close(self) -> None:
        self._child.communicate()


RIVALS: Final[dict[str, Callable[[Environment, Array, int], Rival]]] = {
    "practice": partial(OfThisLibrary, make=practice),
    "explauto": Explauto,
    "pyribs-cma-me": partial(OfThisLibrary, make=partial(cma_me_alone, sd=0.2, inverse=NearestNeighbour)),
    "scikit-learn-process": GaussianProcess,
    "torch-network": Network,
    "cma-es-each-goal": EachGoal,
}


def life(robot: str, name: str, seed: int, *, counts: Collection[int] = COUNTS) -> dict[int, tuple[float, ...]]:
    """By number of movements: error by its own answers and by ours (unit of T), ms a movement, ms an answer."""
    world, goals = robot_of(robot)
    policies, outcomes = world.policies, world.outcomes
    rival = RIVALS[name](world, (goals - outcomes.low) / outcomes.sides, seed)
    rng, memory = stream(seed, "others"), Memory(0, policies.dim, outcomes.dim)
    learning, found = 0.0, dict[int, tuple[float, ...]]()
    with closing(rival):
        for n in range(1, max(counts) + 1):
            begun = time.perf_counter()
            share = np.clip(rival.move(), 0, 1)
            learning += time.perf_counter() - begun
            theta = policies.low + share * policies.sides
            outcome = world.execute(NO_CONTEXT, theta, rng)
            memory.add(NO_CONTEXT, theta, outcome)
            begun = time.perf_counter()
            rival.tell(share, (outcome - outcomes.low) / outcomes.sides)
            learning += time.perf_counter() - begun
            if n in counts:
                begun = time.perf_counter()
                own = policies.low + np.clip(rival.answers(), 0, 1) * policies.sides
                answering = time.perf_counter() - begun
                process = Problem(world, seed, memory, inverse=LocalProcess).inverse
                ours = np.array([process(NO_CONTEXT, goal).theta for goal in goals])
                errors = [_error(world, thetas, goals, stream(seed, "answers", n)) for thetas in (own, ours)]
                found[n] = *errors, 1000 * learning / n, 1000 * answering / len(goals)
    return found


def _error(world: Environment, thetas: Array, goals: Array, rng: np.random.Generator) -> float:
    outcomes = np.array([world.execute(NO_CONTEXT, theta, rng) for theta in thetas])
    return float(np.linalg.norm(outcomes - goals, axis=1).mean())


def lives(seeds: Iterable[int] | None, only: Collection[str], out: Path) -> list[Life]:
    """The lives on these robots with these seeds, None for those of the page."""
    keys = product(SEEDS if seeds is None else seeds, only, RIVALS)
    return [Life(TABLE, (robot, name, seed), COUNTS[-1], out) for seed, robot, name in keys]
