"""Learners in a few lines each: the five of the paper in ``paper``, our own in ``practice``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, TypeAlias

from sgimd_torch.learner import Beginning, Learner, Watcher
from sgimd_torch.memory import MakeMemory, Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.rooms import Usual

MakeInverse: TypeAlias = Callable[[Problem], Inverse]
Begin: TypeAlias = Callable[[int, Memory | MakeMemory], Learner]
"""Function (seed, memory) -> learner."""
MakeWatcher: TypeAlias = Callable[[Begin, Learner, Memory | None], Watcher | None]
"""Function (begin, learner, prior) -> watcher of the learner; None: nobody watches."""


def nobody(begin: Begin, learner: Learner, prior: Memory | None) -> Watcher | None:
    """Nobody: changes of the robot are not noticed."""
    if prior is not None:
        raise ValueError("prior (--begin-with) needs a watcher, which finds out what holds of it; got --watch none")
    return None


usual_watcher: Final = Usual("watch", "none", nobody)


def learner_of(
    begin: Begin,
    seed: int,
    memory: Memory | MakeMemory,
    prior: Memory | None = None,
    watch: MakeWatcher = nobody,
) -> Learner:
    """The learner that ``begin`` builds. It begins again when ``watch`` finds a change of its robot, and to forget.

    Args:
        begin: function that builds the learner.
        seed: number from which all random streams of the learner come.
        memory: memory, or exemplars to start from.
        prior: exemplars of another robot, such as a simulator; they count as far as they hold. None: no exemplars.
        watch: watcher.

    Raises:
        ValueError: both ``memory`` and ``prior`` are given, or the watcher refuses the learner.
    """
    if prior is not None:
        if isinstance(memory, Memory):
            raise ValueError("give memory, exemplars of this robot, or prior, exemplars of another robot; got both")
        memory = Exemplars.of(prior).memory_like(memory(prior.context_dim, prior.theta_dim, prior.outcome_dim))
    learner = begin(seed, memory)
    learner.beginning = Beginning(begin, learner.memory.copy(), lambda: watch(begin, learner, prior))
    learner.watcher = learner.beginning.watch()
    return learner
