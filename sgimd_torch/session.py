"""A learner's life in an environment, movement by movement; live, or replayed from what was recorded.

The main loop of algorithm 1 of Nguyen & Oudeyer (2014).
    for episode in run(learner, environment, seed, movements=5000, teacher=teacher): ...
Movement i draws its noise from a stream of its own, so it meets the same noise whatever came before it, and a replayed
movement need not be executed to leave the next one's noise as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.learner import Learner
from sgimd_torch.spaces import Array, Episode, check_count, read_only, stream
from sgimd_torch.teachers import Teacher

Execute = Callable[[int, Array, Array], Array]
"""(index, context, theta) -> outcome of movement ``index``."""


class Recorded(NamedTuple):
    """A movement that was executed once: ``theta`` and ``outcome``, both None if the learner rested."""

    theta: Array | None
    outcome: Array | None


class ReplayError(RuntimeError):
    """The learner does not do again what was recorded: another library version, processor or configuration."""


def run(
    learner: Learner,
    environment: Environment,
    seed: int,
    *,
    movements: int,
    first: int = 0,
    teacher: Teacher | None = None,
    execute: Execute | None = None,
) -> Iterator[Episode]:
    """Let ``learner`` live for ``movements`` movements, those at rest counted.

    A context is observed when the learner begins something new and holds until that ends; the answer to a demonstration
    takes place in the demonstration's.

    Args:
        learner: asked, told and shown; stop iterating at any time and it stays usable.
        environment: observed and executed.
        seed: of the environment's streams.
        movements: in all, those before ``first`` counted; at least 1.
        first: number of the first one; where an earlier life stopped, to go on with it.
        teacher: asked before every movement whether it demonstrates.
        execute: stands in for the environment, see ``live`` and ``replay``.

    Yields:
        Every episode, once the learner has been told its outcome.

    Raises (when iterated):
        ValueError: ``movements`` or ``first`` is not such a number, or ``first`` comes after them all.
    """
    if check_count("first", first, 0) > check_count("movements", movements, 1):
        raise ValueError(f"first must be at most movements, got {first} of {movements}; movements counts them in all")
    execute = live(environment, seed) if execute is None else execute
    for index in range(first, movements):
        demonstration = teacher.offer(index, learner.memory) if teacher is not None else None
        if demonstration is not None:
            learner.watch(demonstration)
        context = read_only(environment.observe(stream(seed, "context", index))) if learner.idle else learner.context
        move, outcome = learner.ask(context), None
        if move is not None:
            outcome = execute(index, context, move.theta)
            learner.tell(outcome)
        yield Episode(index, context, move, outcome, demonstration)


def live(environment: Environment, seed: int) -> Execute:
    """Execute in ``environment``, movement i with the noise of stream i."""

    def execute(index: int, context: Array, theta: Array) -> Array:
        # Copies, which the environment may write into: the records stay as they are.
        return environment.execute(context.copy(), theta.copy(), stream(seed, "environment", index))

    return execute


def replay(recorded: Sequence[Recorded], then: Execute) -> Execute:
    """Give the outcomes that were ``recorded``, without executing; after them, ``then``.

    Raises (when called):
        ReplayError: the learner proposes another theta than the recorded one.
    """

    slip = "was it recorded by another version, on another processor or with another configuration?"

    def execute(index: int, context: Array, theta: Array) -> Array:
        if index >= len(recorded):
            return then(index, context, theta)
        record = recorded[index]
        if record.theta is None or record.outcome is None:
            raise ReplayError(f"movement {index} was recorded as rest, the learner now moves; {slip}")
        differ = np.flatnonzero(record.theta != theta)
        if differ.size:
            k = differ[0]
            raise ReplayError(
                f"movement {index} was recorded with another theta: theta_{k} was {record.theta[k]}, now {theta[k]}; "
                f"{differ.size} of {theta.size} parameters differ; {slip}"
            )
        return record.outcome

    return execute
