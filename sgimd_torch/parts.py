"""Parts of a learner: one base class for each kind of part, with the methods that a part must have and may have.

A part derives from the class of its kind and is built from one `Problem`. Its keywords with a default are its options,
also of ``sgimd run``. A part must define the abstract methods; all other methods have a default.
    class Mine(Goals): ...
    learner = sagg_riac(environment, seed, goals=partial(Mine, candidates=5))
    # sgimd run --goals mine:Mine --goals.candidates 5, where mine.py is in the working directory
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from copy import copy
from typing import Any, ClassVar, TypeVar

import numpy as np

from sgimd_torch.calls import Built
from sgimd_torch.environments.protocol import Environment, check_robot
from sgimd_torch.memory import MakeMemory, Memory, memory_for
from sgimd_torch.spaces import Array, AskingAttempt, Attempt, Demonstration, Estimate, stream

Made = TypeVar("Made")


class Problem:
    """Problem to learn: spaces, noise, memory and random streams, from which every part is built.

    Args:
        environment: robot and world; boxes, rest and noise are read, and nothing is executed.
        seed: number from which all random streams of the learner come, at least 0.
        memory: constructor of the memory, or a memory of exemplars to start from, which is copied.
        inverse: constructor of the inverse model.

    Attributes:
        contexts, policies, outcomes: boxes C, Pi and T.
        rest, outcome_noise: outcome of not moving, and standard deviation of outcomes; see `Environment`.
        tolerance: distance in the unit of T at which a goal counts as reached: the outcome noise, but at least .02.
        memory, inverse: exemplars and inverse model of the learner; the inverse model is the first part made.
        remarks: sentences for the user, for example that exploration does not look for effects.
        autonomous: autonomous strategy, which is made before the social one.

    Raises:
        ValueError: `check_robot` refuses the environment, or `memory_for` the ``memory``.
    """

    autonomous: Strategy

    def __init__(
        self,
        environment: Environment,
        seed: int,
        memory: Memory | MakeMemory = Memory,
        *,
        inverse: Callable[[Problem], Inverse],
    ) -> None:
        check_robot(environment)
        self.contexts, self.policies, self.outcomes = environment.contexts, environment.policies, environment.outcomes
        self.rest, self.outcome_noise, self.seed = environment.rest, environment.outcome_noise, seed
        self.tolerance = max(environment.outcome_noise, 0.02)
        self._shared: dict[object, Any] = {}
        self.memory = memory_for(memory, self.dims, self.outcomes)
        self.policies.check("thetas of a memory to start from", self.memory.thetas, "is it another robot's?")
        self.remarks: list[str] = []
        self.inverse = Inverse.of(inverse, self)

    @property
    def dims(self) -> tuple[int, int, int]:
        """Dimensions of C, Pi and T."""
        return self.contexts.dim, self.policies.dim, self.outcomes.dim

    def stream(self, name: str) -> np.random.Generator:
        """The random stream of this ``name``; each call returns the same object."""
        return self.shared(name, lambda: stream(self.seed, name))

    def shared(self, key: object, make: Callable[[], Made]) -> Made:
        """Object that all parts share under this ``key``; the first call makes it."""
        if key not in self._shared:
            self._shared[key] = make()
        return self._shared[key]

    def over(self, memory: Memory) -> Problem:
        """This problem with another ``memory``, for a part that uses only some exemplars."""
        other = copy(self)
        other.memory = memory
        return other

    @property
    def trained(self) -> list[Trained]:
        """Shared objects that need training."""
        return [part for part in self._shared.values() if isinstance(part, Trained)]


class Part(Built):
    """A part of a learner. Its random numbers come from ``rng``, the stream of the problem with name ``draws_from``."""

    draws_from: str = ""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    @property
    def rng(self) -> np.random.Generator:
        """Random stream of this part."""
        return self.problem.stream(self.draws_from)


class Trained(ABC):
    """Object that parts share and that is trained while the learner moves, such as a forward model."""

    device: str = ""  # device that trains, for the record; "" if there is no choice

    @abstractmethod
    def refresh(self, memory: Memory) -> object:
        """Learn from the newest exemplars in ``memory``."""


class Goals(Part):
    """Goal model: chooses goals by the results of earlier goals (section 3.2). `goals.uniform` has argument checks."""

    draws_from = "goals"
    by_competence: ClassVar[bool] = True  # whether `add` uses competence and gain; if not, it may get 0 for both

    @abstractmethod
    def sample(self, context: Array) -> Array:
        """A goal ``(outcome_dim,)`` in T for this ``context`` ``(context_dim,)``."""

    @abstractmethod
    def add(
        self, context: Array, goal: Array, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Learn that an attempt at a goal has ended.

        Args:
            context: ``(context_dim,)`` in C.
            goal: ``(outcome_dim,)`` in T.
            competence: competence at this goal when the attempt ends, in [-1, 0].
            strategy: name of the strategy that chose the goal.
            gain: rise of the competence at this goal during the attempt; if there is none, the competence of the
                attempt alone minus the competence before the attempt.
        """

    @property
    def regions(self) -> Sequence[Any]:
        """Leaves of the map of C x T, each a `goals.regions.Region`. Default: none."""
        return ()


class Inverse(Part):
    """Inverse model: infers a movement for a goal (section 4.4.2). It reads the memory and draws nothing."""

    says_how_sure: ClassVar[bool] = True  # whether estimates may have ``expected`` and ``sd``

    @abstractmethod
    def __call__(self, context: Array, goal: Array) -> Estimate:
        """Estimate for a ``goal`` ``(outcome_dim,)`` in a ``context`` ``(context_dim,)``: a theta in Pi and one or more
        exemplars, nearest first, at which a search may begin.

        Raises:
            RuntimeError: the memory is empty.
        """

    def answer_many(self, contexts: Array, goals: Array) -> list[Estimate]:
        """Estimates for ``goals`` ``(n, outcome_dim)`` in ``contexts`` ``(n, context_dim)``. Default: one by one."""
        return [self(context, goal) for context, goal in zip(contexts, goals, strict=True)]

    def uncertainty(self, context: Array, goals: Array) -> Array:
        """How unsure answers to ``goals`` ``(n, outcome_dim)`` are, ``(n,)``, in the unit of T; by default ``sd``."""
        return np.array([self(context, goal).sd or 0.0 for goal in goals])

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Expected outcome ``(outcome_dim,)`` of ``theta`` ``(theta_dim,)``. Default: None, which means unknown."""
        return None

    def unexplained(self, context: Array, theta: Array, outcome: Array) -> float:
        """Distance of the ``outcome`` of a remembered movement from the one that similar movements let expect, if noise
        does not explain it, else 0. Default: 0."""
        return 0.0

    def effects(self) -> Memory | None:
        """Exemplars with an effect, if most movements have none. Default: None, which means that all have one."""
        return None


class Search(Part):
    """Search: movements from an estimate towards a goal, one by one (section 4.4.2)."""

    draws_from = "search"

    @abstractmethod
    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Yield thetas ``(theta_dim,)`` in Pi to execute; the caller sends the outcome ``(outcome_dim,)`` of each."""


class Explore(Part):
    """Global exploration: movements that do not depend on the goal (section 4.4.1)."""

    draws_from = "look"

    @abstractmethod
    def __call__(self, context: Array) -> Array:
        """The next movement, ``(theta_dim,)`` in Pi."""

    def share(self) -> float | None:
        """Probability of a global movement. Default: None, which means that competence at the goal decides."""
        return None

    def instead(self, estimate: Estimate, goal: Array) -> bool:
        """Whether a global movement replaces the local one from this ``estimate``. Default: no."""
        return False

    def add(self, theta: Array) -> None:
        """Learn that a global movement ``theta`` has an outcome, the last one in memory. Default: nothing."""


class Judge(Part):
    """Judge: measures the competence of an attempt for the goal model, when the attempt ends (eq. 2)."""

    @abstractmethod
    def __call__(self, context: Array, goal: Array, outcomes: Array) -> float:
        """Competence in [-1, 0] at ``goal``, from the ``outcomes`` ``(n, outcome_dim)`` of the attempt."""


class Strategy(Part):
    """Autonomous strategy: what a learner does without a demonstration."""

    @abstractmethod
    def attempt(self, context: Array) -> AskingAttempt:
        """Yield the movements of an attempt in one context: at least one movement or rest, even without a reply."""

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of the goal model. Default: none."""
        return ()

    def maker(self, origin: str) -> Part:
        """The part that proposes movements of this ``origin``, for messages. Default: this strategy."""
        return self


class Social(Part):
    """Social strategy: what a learner does after a demonstration (sections 3.2.3 and 4.2)."""

    remembers: ClassVar[bool] = False  # whether demonstrations enter the memory

    @abstractmethod
    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """Yield movements, or none, after a ``demonstration`` whose policy is ``theta_d`` ``(theta_dim,)``, eq. (6)."""


class Teacher(Built):
    """Teacher who chooses demonstrations and their times, without requests (section 2.3: What, How and When).

    The constructor gets ``(demonstrations, rng)`` and options.

    Attributes:
        who: name of the person who gave the last demonstration, for the record.
        needs_demonstrations: whether its class needs prepared demonstrations.
    """

    needs_demonstrations: ClassVar[bool] = True
    who: str = "teacher"

    @abstractmethod
    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """The demonstration before movement ``index`` (0, 1, ...) of the learner with this ``memory``, or None."""


class Demonstrator(Built):
    """Teacher who is asked for a demonstration of a goal. Built from ``(demonstrations, rng)`` and options.

    Attributes:
        takes: duration of a reply, in movements, for which the learner rests.
    """

    takes: int = 0

    @abstractmethod
    def demonstrate(self, context: Array, goal: Array, memory: Memory) -> Demonstration | None:
        """A demonstration of ``goal`` ``(outcome_dim,)`` in ``context`` ``(context_dim,)``, or None. A replayed
        run repeats the request and needs an equal reply, so random draws must depend only on seed and arguments."""
