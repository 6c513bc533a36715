"""Programs of other people, used as their own pages say, beside `practice`, and the life of one on a robot.

    life("arm-7", "explauto", 1000, counts=[50, 300])    # errors by number of movements

Each program sees the boxes of a robot, its goals, and contexts and outcomes of its own movements. After each number of
movements it answers the goals itself, and `process` answers them from the same movements. Times are by the clock.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Collection, Iterable
from contextlib import closing, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

import cma
import gymnasium
import mink
import mujoco
import numpy as np
import torch
from scipy.optimize import minimize
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

from others import COUNTS
from sgimd_torch.algorithms.practice import practice
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import contexts_of_goals
from sgimd_torch.extras.models.mujoco_robot import MujocoRobot
from sgimd_torch.extras.rivals.quality_diversity import cma_me_alone
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import ROD, load_word
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array, Box, stream
from sgimd_torch.tasks import Task, benchmark_of
from sgimd_torch.tasks.robots import arm_benchmark
from toys import soft_arm, toss

GOALS: Final = 48  # largest number of goals
EXPLAUTO: Final = Path(__file__).parents[1] / ".others" / "bin" / "python"
sys.path.append(str(EXPLAUTO.parents[1] / "newer"))  # BoTorch, which runs with the libraries here
STARTS: Final = 3  # nearest movements from which an answer is optimised
FITTED: Final = 300  # movements by which the kernel of scikit-learn's process is chosen
TOYS: Final = {"soft-arm": soft_arm, "toss": toss}


def robot_of(name: str) -> tuple[Environment, Array]:
    """A robot of the comparison, and goals within its reach."""
    if name == "rod":
        task = load_word("environment", ROD)()
    elif name in TOYS:
        task = TOYS[name]()
    elif name == "pusher-arm":
        file = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets" / "pusher.xml"
        task = Task(MujocoRobot(file, outcome="body:tips_arm:xyz"))
    else:
        arm = PlanarArm(int(name.removeprefix("arm-")), noise=0.01)
        task = Task(arm, partial(arm_benchmark, arm))
    goals = benchmark_of(task, None)[0].goals
    return task.environment, goals[:: 1 + len(goals) // GOALS]


class Rival:
    """A program; C, Pi and T are unit cubes for it. Unless it chooses its movements, they are uniform in Pi.

    Args:
        robot: robot, of which the boxes are read.
        contexts: ``(n, context_dim)`` contexts of the goals, in units of C.
        goals: ``(n, outcome_dim)`` goals, in units of T.
        seed: seed of its random numbers.
    """

    last = COUNTS[-1]  # largest number of movements that it makes in reasonable time

    def __init__(self, robot: Environment, contexts: Array, goals: Array, seed: int) -> None:
        self.robot, self.contexts, self.goals, self.seed = robot, contexts, goals, seed
        self.rng = stream(seed, "rival")
        self.tries, self.outcomes = list[Array](), list[Array]()  # a try: context and theta
        self.dim, self.fixed = robot.policies.dim, robot.contexts.dim

    def move(self, context: Array) -> Array:
        """The next movement, theta."""
        return self.rng.random(self.dim)

    def tell(self, context: Array, theta: Array, outcome: Array) -> None:
        """Learn the outcome of a movement."""
        self.tries.append(np.concatenate((context, theta)))
        self.outcomes.append(outcome)

    def close(self) -> None:
        """End what it has begun. Default: nothing."""

    def answers(self) -> Array:
        """``(n, theta_dim)``, a movement for each goal: here the movement that came nearest."""
        return self.begins(1)[:, 0]

    def begins(self, k: int) -> Array:
        """``(n, k, theta_dim)``, the movements that came nearest to each goal, in a context alike."""
        tries = np.array(self.tries)
        reached = np.concatenate((tries[:, : self.fixed], self.outcomes), axis=1)
        wanted = np.concatenate((self.contexts, self.goals), axis=1)
        distances = np.linalg.norm(reached - wanted[:, None], axis=2)
        return np.asarray(tries[np.argsort(distances, axis=1, kind="stable")[:, :k], self.fixed :])


class GaussianProcess(Rival):
    """scikit-learn's exact process of random movements; an answer minimises the distance of its mean from the goal."""

    def answers(self) -> Array:
        tries, outcomes, dim = np.array(self.tries), np.array(self.outcomes), self.dim
        begun = [  # at short and at long lengths
            ConstantKernel() * Matern(np.full(self.fixed + dim, length), (0.05, 1000), nu=2.5)
            + WhiteKernel(1e-3, (1e-8, 1))
            for length in (1.0, dim**0.5)
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)  # of a robot without noise, or a parameter of no effect
            fits = [GaussianProcessRegressor(kernel, normalize_y=True) for kernel in begun]
            fits = [fit.fit(tries[:FITTED], outcomes[:FITTED]) for fit in fits]
        chosen = max(fits, key=lambda fit: fit.log_marginal_likelihood_value_)
        process = GaussianProcessRegressor(chosen.kernel_, normalize_y=True, optimizer=None).fit(tries, outcomes)
        steps = 1e-4 * np.concatenate((np.zeros((1, dim)), np.eye(dim)))

        def miss(theta: Array, context: Array, goal: Array) -> tuple[float, Array]:
            near = np.concatenate((np.tile(context, (1 + dim, 1)), theta + steps), axis=1)
            squares = np.square(process.predict(near) - goal).sum(axis=1)
            return float(squares[0]), (squares[1:] - squares[0]) / 1e-4

        def answer(wanted: tuple[Array, Array], begins: Array) -> Array:
            search = partial(minimize, miss, args=wanted, jac=True, method="L-BFGS-B", bounds=[(0, 1)] * dim)
            ends = [search(theta, options={"maxiter": 30}) for theta in begins]
            return np.asarray(min(ends, key=lambda end: end.fun).x)

        goals = zip(self.contexts, self.goals, strict=True)
        return np.array([answer(goal, begins) for goal, begins in zip(goals, self.begins(STARTS), strict=True)])


class Network(Rival):
    """A network in PyTorch from theta to outcome, fitted to random movements; answers descend from the nearest one."""

    def answers(self) -> Array:
        torch.manual_seed(self.seed)
        tries, outcomes = (torch.tensor(np.array(rows), dtype=torch.float32) for rows in (self.tries, self.outcomes))
        n_in, n_out, mean, sd = tries.shape[1], outcomes.shape[1], outcomes.mean(0), outcomes.std(0)
        network = torch.nn.Sequential(
            *(torch.nn.Linear(n_in, 128), torch.nn.Tanh(), torch.nn.Linear(128, 128), torch.nn.Tanh()),
            torch.nn.Linear(128, n_out),
        )
        optimiser = torch.optim.AdamW(network.parameters(), 2e-3, weight_decay=1e-2)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, 2000)
        for _ in range(2000):
            rows = torch.randint(len(tries), (min(128, len(tries)),))
            loss = (network(2 * tries[rows] - 1) - (outcomes[rows] - mean) / sd).square().mean()
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
        contexts, goals, begins = (
            torch.tensor(rows, dtype=torch.float32) for rows in (self.contexts, self.goals, self.begins(1)[:, 0])
        )
        found = torch.nn.Parameter(begins)
        descent = torch.optim.Adam([found], 1e-2)
        for _ in range(200):
            descent.zero_grad()
            missed = sd * network(2 * torch.cat((contexts, found), dim=1) - 1) + mean - goals
            missed.square().sum().backward()
            descent.step()
            found.data.clamp_(0, 1)
        return found.detach().double().numpy()


class Botorch(Rival):
    """BoTorch, asked for one goal after another: the movement of the largest expected improvement of its process."""

    last, first = 100, 20  # it takes some .2 s a movement; its first movements are random
    _chosen: Any = None  # parameters of its process, chosen anew every third movement

    def move(self, context: Array) -> Array:
        n = len(self.tries)
        if n < self.first:
            return super().move(context)
        return self._best(self._process(n % 3 == 0), context, n % len(self.goals))

    def answers(self) -> Array:
        process = self._process(True)
        contexts = enumerate(self.contexts)
        return np.array([self._best(process, context, row, improve=False) for row, context in contexts])

    def _process(self, choose: bool) -> Any:
        from botorch.fit import fit_gpytorch_mll
        from botorch.models import SingleTaskGP
        from gpytorch.mlls import ExactMarginalLogLikelihood

        process = SingleTaskGP(*(torch.tensor(np.array(rows)) for rows in (self.tries, self.outcomes)))
        if self._chosen:
            process.load_state_dict(self._chosen, strict=False)
        if choose or not self._chosen:
            fitted = ExactMarginalLogLikelihood(process.likelihood, process)
            fit_gpytorch_mll(fitted, optimizer_kwargs={"options": {"maxiter": 50}})
            state = process.state_dict().items()
            self._chosen = {name: value for name, value in state if "outcome_transform" not in name}
        return process.eval()

    def _best(self, process: Any, context: Array, row: int, *, improve: bool = True) -> Array:
        from botorch.acquisition import GenericMCObjective, qLogExpectedImprovement, qSimpleRegret
        from botorch.optim import optimize_acqf
        from botorch.sampling import SobolQMCNormalSampler

        goal = torch.tensor(self.goals[row])
        objective = GenericMCObjective(lambda outcomes, X: -(outcomes - goal).square().sum(-1))
        draws = {"objective": objective, "sampler": SobolQMCNormalSampler(torch.Size([32]), seed=self.seed)}
        if improve:
            misses = np.square(np.array(self.outcomes) - self.goals[row]).sum(axis=1)
            value = qLogExpectedImprovement(process, best_f=-misses.min(), **draws)
        else:
            value = qSimpleRegret(process, **draws)
        begins = np.concatenate((self.begins(1)[row], self.rng.random((2, self.dim))))
        begins = np.concatenate((np.tile(context, (3, 1)), begins), axis=1)
        found, _ = optimize_acqf(
            value,
            torch.tensor([[0.0], [1.0]]).double().expand(2, begins.shape[1]),
            q=1,
            num_restarts=3,
            batch_initial_conditions=torch.tensor(begins)[:, None],
            fixed_features=dict(enumerate(context.tolist())),
            options={"maxiter": 30},
        )
        return np.asarray(found[0, self.fixed :])


class Mink(Rival):
    """mink's inverse kinematics of a planar arm: it knows the arm, and needs no movement; begun at the nearest one."""

    last = COUNTS[0]

    def answers(self) -> Array:
        arm: Any = self.robot
        limits, spec = arm.angles(np.ones(self.dim)), mujoco.MjSpec()
        spec.compiler.degree = False
        body, end = spec.worldbody, [0.0, 0.0, 0.0]
        for limit in limits:
            body, end = body.add_body(pos=end), [1 / self.dim, 0.0, 0.0]
            body.add_geom(size=[0.01, 0, 0])
            body.add_joint(axis=[0, 0, 1], range=[-limit, limit], limited=True)
        body.add_site(name="end", pos=end)
        posture = mink.Configuration(spec.compile())
        task = mink.FrameTask("end", "site", position_cost=1.0, orientation_cost=0.0, lm_damping=1e-3)
        within = [mink.ConfigurationLimit(posture.model)]

        def answer(goal: Array, begin: Array) -> Array:
            posture.update(arm.angles(begin))
            place = arm.outcomes.low + goal * arm.outcomes.sides
            task.set_target(mink.SE3.from_translation(np.array([*place, 0.0])))
            with suppress(mink.NoSolutionFound):  # the posture so far answers
                for _ in range(200):
                    posture.integrate_inplace(mink.solve_ik(posture, [task], 0.5, "daqp", limits=within), 0.5)
            return np.asarray(arm.correspondence([0.0], [np.clip(posture.q, -limits, limits)]))

        return np.array([answer(*wanted) for wanted in zip(self.goals, self.begins(1)[:, 0], strict=True)])


class CmaEs(Rival):
    """CMA-ES for one goal after another, a generation at a time, from the movement that came nearest, which answers."""

    sd = 0.4  # of the first generation, relative to the sides of Pi

    def __init__(self, *of: Any) -> None:
        super().__init__(*of)
        self._searches = dict[int, Any]()
        self._goal, self._asked, self._misses = -1, list[Array](), list[float]()

    def move(self, context: Array) -> Array:
        if len(self._misses) == len(self._asked):
            self._goal = (self._goal + 1) % len(self.goals)
            if self._goal not in self._searches:
                begin = self.answers()[self._goal] if self.tries else np.full(self.dim, 0.5)
                options = {"bounds": [0, 1], "verbose": -9, "seed": 1 + self.seed * len(self.goals) + self._goal}
                self._searches[self._goal] = cma.CMAEvolutionStrategy(begin, self.sd, options)
            self._asked, self._misses = self._searches[self._goal].ask(), []
        return np.asarray(self._asked[len(self._misses)])

    def tell(self, context: Array, theta: Array, outcome: Array) -> None:
        super().tell(context, theta, outcome)
        self._misses.append(float(np.linalg.norm(outcome - self.goals[self._goal])))
        if len(self._misses) == len(self._asked):
            self._searches[self._goal].tell(self._asked, self._misses)


class OfThisLibrary(Rival):
    """A learner of this library, with its own answers: ``make`` (robot, seed) -> learner."""

    def __init__(self, *of: Any, make: Callable[[Environment, int], Learner]) -> None:
        super().__init__(*of)
        self._learner = make(self.robot, self.seed)

    def move(self, context: Array) -> Array:
        move = self._learner.ask(_out_of(self.robot.contexts, context))
        assert move is not None  # it never rests
        return _into(self.robot.policies, move.theta)

    def tell(self, context: Array, theta: Array, outcome: Array) -> None:
        super().tell(context, theta, outcome)
        self._learner.tell(_out_of(self.robot.outcomes, outcome))

    def answers(self) -> Array:
        contexts, goals = _out_of(self.robot.contexts, self.contexts), _out_of(self.robot.outcomes, self.goals)
        answers = [self._learner.inverse(*wanted).theta for wanted in zip(contexts, goals, strict=True)]
        return _into(self.robot.policies, np.array(answers))


class Explauto(Rival):
    """Explauto, in a process of its own libraries; see explauto_rival.py."""

    def __init__(self, *of: Any) -> None:
        super().__init__(*of)
        if not EXPLAUTO.exists():
            raise FileNotFoundError(f"Explauto is not installed in {EXPLAUTO.parents[1]}; run scripts/others")
        program = str(Path(__file__).with_name("explauto_rival.py"))
        self._child = subprocess.Popen(
            [EXPLAUTO, program], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        )
        self._said([self.dim, self.robot.outcomes.dim, self.seed])

    def _said(self, words: Any) -> Any:
        assert self._child.stdin is not None
        assert self._child.stdout is not None
        self._child.stdin.write(json.dumps(words) + "\n")
        self._child.stdin.flush()
        return json.loads(self._child.stdout.readline())

    def move(self, context: Array) -> Array:
        return np.array(self._said(["move"]))

    def tell(self, context: Array, theta: Array, outcome: Array) -> None:
        super().tell(context, theta, outcome)
        self._said(["tell", theta.tolist(), outcome.tolist()])

    def answers(self) -> Array:
        return np.array(self._said(["answers", self.goals.tolist()]))

    def close(self) -> None:
        self._child.communicate()


RIVALS: Final[dict[str, Callable[..., Rival]]] = {
    "practice": partial(OfThisLibrary, make=practice),
    "explauto": Explauto,
    "pyribs-cma-me": partial(OfThisLibrary, make=partial(cma_me_alone, sd=0.2, inverse=NearestNeighbour)),
    "scikit-learn-process": GaussianProcess,
    "torch-network": Network,
    "cma-es-each-goal": CmaEs,
    "botorch-each-goal": Botorch,
    "mink": Mink,
}


def life(robot: str, name: str, seed: int, *, counts: Collection[int] = COUNTS) -> dict[int, tuple[float, ...]]:
    """By number of movements: error by its own answers and by ours (unit of T), ms a movement, ms an answer."""
    world, goals = robot_of(robot)
    contexts, policies, outcomes = world.contexts, world.policies, world.outcomes
    of_goals = contexts_of_goals(world, len(goals))
    rival = RIVALS[name](world, _into(contexts, of_goals), _into(outcomes, goals), seed)
    rng, memory = stream(seed, "others"), Memory(contexts.dim, policies.dim, outcomes.dim)
    learning, found = 0.0, dict[int, tuple[float, ...]]()
    with closing(rival):
        for n in range(1, min(max(counts), rival.last) + 1):
            context = world.observe(rng)
            begun = time.perf_counter()
            share = np.clip(rival.move(_into(contexts, context)), 0, 1)
            learning += time.perf_counter() - begun
            theta = _out_of(policies, share)
            outcome = world.execute(context, theta, rng)
            memory.add(context, theta, outcome)
            begun = time.perf_counter()
            rival.tell(_into(contexts, context), share, _into(outcomes, outcome))
            learning += time.perf_counter() - begun
            if n in counts:
                begun = time.perf_counter()
                own = _out_of(policies, np.clip(rival.answers(), 0, 1))
                answering = time.perf_counter() - begun
                process = Problem(world, seed, memory, inverse=LocalProcess).inverse
                ours = [process(*wanted).theta for wanted in zip(of_goals, goals, strict=True)]
                errors = [_error(world, of_goals, thetas, goals, seed, n) for thetas in (own, ours)]
                found[n] = *errors, 1000 * learning / n, 1000 * answering / len(goals)
    return found


def _error(world: Environment, contexts: Array, thetas: Iterable[Array], goals: Array, seed: int, n: int) -> float:
    rng = stream(seed, "answers", n)
    outcomes = [world.execute(*movement, rng) for movement in zip(contexts, thetas, strict=True)]
    return float(np.linalg.norm(np.array(outcomes) - goals, axis=1).mean())


def _into(box: Box, points: Array) -> Array:
    """Points as shares of the sides of their box."""
    return np.asarray((points - box.low) / box.sides)


def _out_of(box: Box, shares: Array) -> Array:
    return np.asarray(box.low + shares * box.sides)
