"""A forward model that has to prove itself: it answers once it has predicted movements better than a local process.

Our addition, not in the paper. Before the model learns from new movements, it and the process predict what came of
them, from what both had been told by then (prequential analysis: Dawid, J. R. Stat. Soc. A 147, 1984). Whoever missed
the recent ones by less answers. So neither judges its own answers, and no movement is spent on judging.
    inverse = ProvedModel(memory, model, environment.policies, outcome_noise=environment.outcome_noise)
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from sgimd_torch.forward_model.anchored import TRUST, Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.through_model import ModelInverse
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box, Estimate

_EVERY: Final = 2  # one movement in so many is a test
_FEWEST: Final = 100  # tests before the model can have proved itself
_NEARLY: Final = 1.1  # with predictions a tenth worse it still answers as well; measured on seven tasks


class ProvedModel:
    """The answer of `ModelInverse` where the model has proved itself, else that of `LocalProcess`.

    Tests are made when the model learns, in ``model.refresh``. So to ask it, in an evaluation say, changes nothing.

    Args:
        memory, model, policies, trust: as for `ModelInverse`.
        outcome_noise: as for `LocalProcess`.

    Raises:
        ValueError: ``outcome_noise`` out of its range, or a model of other dimensions.
    """

    def __init__(
        self, memory: Memory, model: ForwardModel, policies: Box, *, outcome_noise: float = 0.0, trust: Trust = TRUST
    ) -> None:
        self.process = LocalProcess(memory, outcome_noise=outcome_noise)
        self.through_model = ModelInverse(memory, model, policies, trust=trust)
        self._told = Memory(memory.context_dim, memory.theta_dim, memory.outcome_dim)
        self._rivals = (
            LocalProcess(self._told, outcome_noise=outcome_noise),
            ModelInverse(self._told, model, policies, trust=trust),
        )
        self._tests: list[tuple[int, float, float]] = []  # row of the movement; by how much process and model missed it
        model.before_learning.append(self._test)

    @property
    def trusted(self) -> bool:
        """Whether the model has proved itself, on the newer half of what it was told."""
        recent = [missed for row, *missed in self._tests if row >= len(self._told) / 2]
        if len(recent) < _FEWEST or not self.through_model.trusted:
            return False
        by_process, by_model = np.sum(recent, axis=0)
        return bool(by_model <= _NEARLY * by_process)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes.

        Raises:
            RuntimeError: the memory is empty.
        """
        return self.through_model(context, goal) if self.trusted else self.process(context, goal)

    def many(self, context: Array, goals: Array) -> list[Estimate]:
        """An estimate for each of ``(n, outcome_dim)`` goals, several times faster than one by one.

        Raises:
            RuntimeError: the memory is empty.
        """
        if self.trusted:
            return self.through_model.many(context, goals)
        return [self.process(context, goal) for goal in goals]

    def predict(self, context: Array, theta: Array) -> Array | None:
        """``(outcome_dim,)`` what ``theta`` should lead to, as `LocalProcess` has it."""
        return self.process.predict(context, theta)

    def _test(self, memory: Memory, learnt: int) -> None:
        """Both predict movements that the model has not learnt from; then they are told them."""
        self._tell(memory, learnt)
        process, through_model = self._rivals
        rows = np.arange(learnt, len(memory), _EVERY)
        contexts, thetas, outcomes = memory.contexts[rows], memory.thetas[rows], memory.outcomes[rows]
        by_process = [process.predict(*each) for each in zip(contexts, thetas, strict=True)]
        by_model = through_model.predict(contexts, thetas)
        for row, one, other, outcome in zip(rows.tolist(), by_process, by_model, outcomes, strict=True):
            if one is not None:
                self._tests.append((row, math.dist(one, outcome), math.dist(other, outcome)))

    def _tell(self, memory: Memory, n: int) -> None:
        for row in range(len(self._told), n):
            self._told.add(memory.contexts[row], memory.thetas[row], memory.outcomes[row])
