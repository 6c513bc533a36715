"""Parts of a learner: what each kind is given, must do and may do.

A part derives from the class of its kind and is built from one `Problem`. Its options are keywords with a default;
``sgimd run`` takes them, too. Abstract methods must be there, all others have a default.
    class Mine(Goals): ...
    learner = sagg_riac(environment, seed, goals=Mine)       # sgimd run --goals mine:Mine --goals.candidates 5
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Generator, Sequence
from copy import copy
from typing import Any, ClassVar, TypeVar

import numpy as np

from sgimd_torch.catalogue.built import Built
from sgimd_torch.environments.protocol import Environment, check_robot
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, AskingAttempt, Attempt, Demonstration, Estimate, stream

Made = TypeVar("Made")


class Problem:
    """What has to be learnt, and what was made for it before: every part is given it.

    Args:
        environment: robot and world; its boxes, rest and noise are read, it is not executed.
        seed: number from which all random streams of the learner come, at least 0.
        memory: exemplars to start from, which are copied; None for none.
        inverse: constructor of the inverse model.

    Attributes:
        contexts, policies, outcomes: boxes C, Pi and T.
        rest: ``(outcome_dim,)`` tau_org, the outcome of not moving.
        outcome_noise: standard deviation of each outcome dimension, in the unit of T.
        tolerance: distance in the unit of T at which a goal counts as reached: the noise, but at least .02.
        memory: exemplars of the learner.
        inverse: inverse model, the first part that is made.
        remarks: sentences that a run should be told, as on a part that another one switches off.
        autonomous: strategy of the learner's own, made before the answer to demonstrations.

    Raises:
        ValueError: a robot that `check_robot` refuses; exemplars of other dimensions, or with thetas outside Pi.
    """

    autonomous: Strategy

    def __init__(
        self,
        environment: Environment,
        seed: int,
        memory: Memory | None = None,
        *,
        inverse: Callable[[Problem], Inverse],
    ) -> None:
        check_robot(environment)
        self.contexts, self.policies, self.outcomes = environment.contexts, environment.policies, environment.outcomes
        self.rest, self.outcome_noise, self.seed = environment.rest, environment.outcome_noise, seed
        self.tolerance = max(environment.outcome_noise, 0.02)
        self._shared: dict[object, Any] = {}
        self.memory = Memory(*self.dims) if memory is None else memory.copy_for(self.dims)
        self.policies.check("thetas of a memory to start from", self.memory.thetas, "of another robot?")
        self.remarks: list[str] = []
        self.inverse = Inverse.of(inverse, self)

    @property
    def dims(self) -> tuple[int, int, int]:
        """Dimensions of C, Pi and T."""
        return self.contexts.dim, self.policies.dim, self.outcomes.dim

    def stream(self, name: str) -> np.random.Generator:
        """The random stream of a name; the same name gives the same stream."""
        return self.shared(name, lambda: stream(self.seed, name))

    def shared(self, key: object, make: Callable[[], Made]) -> Made:
        """The one object of this ``key``, for all parts that ask; made at the first call."""
        if key not in self._shared:
            self._shared[key] = make()
        return self._shared[key]

    def over(self, memory: Memory) -> Problem:
        """This problem with another memory, for a part that looks at some exemplars only."""
        other = copy(self)
        other.memory = memory
        return other

    @property
    def trained(self) -> list[Trained]:
        """Shared objects that have to be trained."""
        return [each for each in self._shared.values() if isinstance(each, Trained)]


class Part(Built):
    """A part of a learner. One that draws has ``rng`` for it, the random stream ``draws_from`` of the problem."""

    draws_from: str = ""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem

    @property
    def rng(self) -> np.random.Generator:
        """Random stream of this part."""
        return self.problem.stream(self.draws_from)


class Trained(ABC):
    """Something shared by parts that is trained while the learner moves, as a forward model is."""

    @abstractmethod
    def refresh(self, memory: Memory, goal: Array | None = None) -> Any:
        """Learn from a movement for ``goal`` ``(outcome_dim,)`` that has come into ``memory``."""

    @abstractmethod
    def listener(self, life: Any) -> Any:
        """A `runs.listeners.Listener` that does so in this `runs.run.Life`."""


class Goals(Part):
    """Goal model: which goal next, given what came of earlier ones (section 3.2). `goals.checks` has its checks."""

    draws_from = "goals"

    @abstractmethod
    def sample(self, context: Array) -> Array:
        """``(outcome_dim,)`` a goal in T for this ``context`` ``(context_dim,)``."""

    @abstractmethod
    def add(
        self, context: Array, goal: Array, competence: float, strategy: str = "autonomous", gain: float = 0.0
    ) -> None:
        """Learn that an attempt at a goal has ended.

        Args:
            context: ``(context_dim,)`` in C.
            goal: ``(outcome_dim,)`` in T.
            competence: competence at this goal now, in [-1, 0].
            strategy: name of the strategy that had chosen the goal.
            gain: rise of the best competence remembered at this goal; without a rise, what the attempt came to, less
                what was known before; in [-1, 1].
        """

    @property
    def regions(self) -> Sequence[Any]:
        """Leaves of its map of C x T, each a `goals.regions.Region`. Default: none."""
        return ()


class Inverse(Part):
    """Inverse model: which movement should reach a goal (section 4.4.2). It reads the memory, and draws nothing."""

    @abstractmethod
    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The estimate for a ``goal`` ``(outcome_dim,)`` in a ``context`` ``(context_dim,)``.

        Raises:
            RuntimeError: the memory is empty.
        """

    def answer_many(self, contexts: Array, goals: Array) -> list[Estimate]:
        """Estimates by which evaluations judge: for ``goals`` ``(n, outcome_dim)`` in ``contexts``
        ``(n, context_dim)``. Default: one by one."""
        return [self(context, goal) for context, goal in zip(contexts, goals, strict=True)]

    def predict(self, context: Array, theta: Array) -> Array | None:
        """``(outcome_dim,)`` expected outcome of ``theta`` ``(theta_dim,)``; None if it cannot tell, the default."""
        return None

    def effects(self) -> Memory | None:
        """Exemplars that changed anything, in a robot most of whose movements change nothing; None, the default, if
        all do."""
        return None


class Search(Part):
    """Search: movement by movement from an estimate towards a goal (section 4.4.2)."""

    draws_from = "search"

    @abstractmethod
    def __call__(self, start: Estimate, goal: Array) -> Generator[Array, Array, None]:
        """Yield thetas ``(theta_dim,)`` in Pi to execute; each is sent its outcome ``(outcome_dim,)``."""


class Explore(Part):
    """Global exploration: movements where the inverse model knows nothing (section 4.4.1)."""

    draws_from = "look"

    @abstractmethod
    def __call__(self, context: Array) -> Array:
        """``(theta_dim,)`` the next movement, in Pi."""

    @property
    def share(self) -> float | None:
        """Probability of a global movement; None, the default, leaves it to competence."""
        return None


class Judge(Part):
    """Judge: the competence that a goal model is told when an attempt has ended (eq. 2)."""

    @abstractmethod
    def __call__(self, context: Array, goal: Array, outcomes: Array) -> float:
        """Competence in [-1, 0] at ``goal``, by the ``outcomes`` ``(n, outcome_dim)`` of the attempt."""


class Strategy(Part):
    """What a learner does on its own."""

    @abstractmethod
    def attempt(self, context: Array) -> AskingAttempt:
        """Yield movements in one context, at least one movement or rest, also if no request is answered."""

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of its goal model. Default: none."""
        return ()


class Social(Part):
    """How a learner answers a demonstration (sections 3.2.3 and 4.2)."""

    @abstractmethod
    def attempt(self, context: Array, theta_d: Array, demonstration: Demonstration) -> Attempt:
        """Yield movements, or none, after ``demonstration``, which corresponds to ``theta_d`` ``(theta_dim,)``."""


class Teacher(Built):
    """Teacher who demonstrates of their own accord: the paper's What, How and When in one call (section 2.3).

    Built from ``(demonstrations, rng)`` and options.

    Attributes:
        who: name in the record of whoever has shown the last offer.
        needs_demonstrations: False for somebody who has nothing prepared.
    """

    needs_demonstrations: ClassVar[bool] = True

    who: str = "teacher"

    @abstractmethod
    def offer(self, index: int, memory: Memory) -> Demonstration | None:
        """A demonstration before movement ``index`` (0, 1, ...) of the learner with this ``memory``, or None."""
