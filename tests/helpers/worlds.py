"""Helpers for tests of learning: problems, a planar arm, demonstrations for this arm, and the paper's learners."""

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeVar

import numpy as np
import pytest
from numpy.typing import ArrayLike

from sgimd_torch.algorithms.paper import imitation, observation, random_exploration, sagg_riac, sgim_d
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.goals.interest_map import InterestMap
from sgimd_torch.inverses.nearest import NearestNeighbour
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.options.catalogue import load_word
from sgimd_torch.parts import Inverse, Problem, Search
from sgimd_torch.spaces import Array, Box, Demonstration, Estimate, stream

NO_CONTEXT = np.zeros(0)


@dataclass
class Boxes:
    """The smallest environment: an outcome is theta itself, cut or repeated to the dimensions of T."""

    contexts: Box
    policies: Box
    outcomes: Box
    rest: Array
    outcome_noise: float = 0.0

    def observe(self, rng: np.random.Generator) -> Array:
        return self.contexts.sample(rng)

    def execute(self, context: Array, theta: Array, rng: np.random.Generator) -> Array:
        return np.resize(theta, self.outcomes.dim) + rng.normal(0, self.outcome_noise, self.outcomes.dim)


def problem(
    environment: Environment | None = None,
    *,
    contexts: Box | None = None,
    policies: Box | None = None,
    outcomes: Box | None = None,
    rest: Sequence[float] | Array | None = None,
    noise: float = 0.0,
    memory: Memory | None = None,
    inverse: Callable[[Problem], Inverse] = NearestNeighbour,
    seed: int = 0,
) -> Problem:
    """The problem of an environment; without an environment, of `Boxes` with the given boxes.

    Missing boxes are [0, 1] for C and Pi and [-1, 1] for T, with the dimensions of ``memory``, or else 0, 1 and 2. The
    default of ``rest`` is the point of T nearest to 0. The problem keeps ``memory`` itself: a test can add exemplars.
    """
    if environment is None:
        c, p, t = (0, 1, 2) if memory is None else (memory.context_dim, memory.theta_dim, memory.outcome_dim)
        outcomes = outcomes or Box.cube(-1, 1, t)
        at_rest = outcomes.clip(np.zeros(outcomes.dim)) if rest is None else np.array(rest, dtype=float)
        environment = Boxes(contexts or Box.cube(0, 1, c), policies or Box.cube(0, 1, p), outcomes, at_rest, noise)
    made = Problem(environment, seed, inverse=inverse)
    if memory is not None:
        made = made.over(memory)
        made.inverse = inverse(made)
    return made


class ArmThat(PlanarArm):
    """An arm of five joints that calls ``act`` before each movement, with the number of the call and the stream.

    What ``act`` returns, if anything, takes the place of the outcome.
    """

    execute_many = None

    def __init__(self, act: Callable[[int, np.random.Generator], object], **options: Any) -> None:
        super().__init__(5, **options)
        self.act, self.calls = act, 0

    def execute(self, context: ArrayLike, theta: ArrayLike, rng: np.random.Generator) -> Any:
        self.calls += 1
        instead = self.act(self.calls - 1, rng)
        return super().execute(context, theta, rng) if instead is None else instead


def last_posture(times: Array, trajectory: Array) -> Array:
    """The correspondence of a planar arm: theta_d is the last posture of the recording."""
    return trajectory[-1]


def demonstrate(arm: PlanarArm, goal: Sequence[float] | Array, context: Array = NO_CONTEXT) -> Demonstration:
    """A demonstration of an arm that is led from its middle posture to a posture that reaches ``goal``."""
    theta = arm.solve(context, goal)
    times = np.linspace(0, 1, 5)
    trajectory = 0.5 + np.outer(times, theta - 0.5)
    return Demonstration(context, times, trajectory, arm.execute(context, theta, stream(0, "demonstration")))


def demonstrations(arm: PlanarArm, n: int = 20, seed: int = 0) -> list[Demonstration]:
    """``n`` demonstrations at random places within reach, in all directions."""
    rng = stream(seed, "demonstrations")
    radii = np.sqrt(rng.uniform(0.1, 0.9, n))
    turns = rng.uniform(-np.pi, np.pi, n)
    goals = radii[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return [demonstrate(arm, goal) for goal in goals]


def part(kind: str, word: str) -> Callable[..., Any]:
    """Constructor of a part by its name in the catalogue; if an extra is missing, the test is skipped."""
    try:
        return load_word(kind, word)
    except ValueError as error:
        missing = error.__cause__
        if not isinstance(missing, ImportError) or (missing.name or "").startswith("sgimd_torch"):
            raise
        pytest.skip(str(error))


Sent = TypeVar("Sent")


def drive(search: Generator[Array, Sent, None], execute: Callable[[Array], Sent], n: int = 10_000) -> list[Array]:
    """The thetas that a search proposes, at most ``n``."""
    thetas: list[Array] = []
    try:
        theta = next(search)
        while len(thetas) < n:
            thetas.append(theta.copy())
            theta = search.send(execute(theta))
    except StopIteration:
        pass
    return thetas


class World:
    """A linear world: theta in the unit cube, and a start estimate with ``k`` exemplars at most ``spread`` from it."""

    def __init__(self, dim: int, k: int, *, spread: float = 0.1, centre: Array | None = None, seed: int = 0) -> None:
        rng = stream(seed, "world")
        self.policies = Box.cube(0, 1, dim)
        self.jacobian = rng.normal(size=(dim, 2))
        self.theta = np.full(dim, 0.5) if centre is None else centre
        self.thetas = self.policies.clip(self.theta + rng.uniform(-spread, spread, (k, dim)))
        self.goal = self.execute(self.theta) + np.array([0.12, -0.07])

    def execute(self, theta: Array) -> Array:
        return theta @ self.jacobian

    def distance(self, theta: Array) -> float:
        return float(np.linalg.norm(self.execute(theta) - self.goal))

    def problem(self, seed: int = 0) -> Problem:
        return problem(policies=self.policies, seed=seed)

    @property
    def start(self) -> Estimate:
        return Estimate(self.theta, self.thetas, self.execute(self.thetas))

    def run(self, search: Search, n: int = 10_000) -> list[Array]:
        return drive(search(self.start, self.goal), self.execute, n)


def remember(thetas: Array, outcomes: Array, contexts: Array | None = None) -> Memory:
    """A memory with these exemplars, one in each row."""
    contexts = np.zeros((len(thetas), 0)) if contexts is None else contexts
    memory = Memory(contexts.shape[1], thetas.shape[1], outcomes.shape[1])
    for exemplar in zip(contexts, thetas, outcomes, strict=True):
        memory.add(*exemplar)
    return memory


def executed(arm: PlanarArm, thetas: Array) -> Memory:
    """A memory of the arm's movements ``thetas``, each executed in an observed context."""
    rng, memory = stream(0, "exemplars"), Memory(arm.contexts.dim, arm.policies.dim, arm.outcomes.dim)
    for theta in thetas:
        context = arm.observe(rng)
        memory.add(context, theta, arm.execute(context, theta, rng))
    return memory


ALGORITHMS: dict[str, Callable[..., Learner]] = {
    "random": random_exploration,
    "sagg-riac": sagg_riac,
    "observation": partial(observation, correspondence=last_posture),
    "imitation": partial(imitation, correspondence=last_posture),
    "sgim-d": partial(sgim_d, correspondence=last_posture),
}
TAUGHT = {"observation", "imitation", "sgim-d"}


def make(name: str, arm: PlanarArm, seed: int = 0) -> Learner:
    """One of the paper's five learners."""
    return ALGORITHMS[name](arm, seed)


class Perfect(Inverse):
    """The exact inverse of an arm, and the contexts that it was asked about."""

    def __init__(self, arm: PlanarArm) -> None:
        super().__init__(problem(arm))
        self.arm = arm
        self.asked: list[list[float]] = []

    def __call__(self, context: Array, goal: Array) -> Estimate:
        self.asked.append(context.tolist())
        theta = self.arm.solve(context, goal)
        return Estimate(theta, theta[None], goal[None])


class Sure(Perfect):
    """It expects outcomes .3 beside the goal, with a standard deviation of .4 / sqrt(pi / 2)."""

    def __call__(self, context: Array, goal: Array) -> Estimate:
        return super().__call__(context, goal)._replace(expected=np.add(goal, [0.3, 0.0]), sd=0.4 / np.sqrt(np.pi / 2))


PLANE = Box.cube(-1.0, 1.0, 2, names=("x", "y"), unit="m")


def interest_map(n=400, space=PLANE, context=(), worst=-1.0):
    """An interest map whose goals were missed by more where x is above 0."""
    goals = InterestMap(problem(contexts=Box.cube(-1, 1, len(context)), outcomes=space))
    rng = stream(0, "competence")
    for _ in range(n):
        goal = goals.sample(context)
        goals.add(context, goal, worst * rng.random() if goal[0] > 0 else -0.1)
    return goals
