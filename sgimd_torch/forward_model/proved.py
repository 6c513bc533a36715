"""A forward model that has to prove itself: it answers once it has predicted movements better than a local process.

Our addition, not in the paper. Before the model learns from new movements, it and the process predict what came of
them, from what both had been told by then (prequential analysis: Dawid, J. R. Stat. Soc. A 147, 1984). Whoever missed
the recent ones by less answers. Those count that the process was surest of: its answers are such movements. So neither
judges its own answers, and no movement is spent on judging.
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

_FEWEST: Final = 200  # recent movements before the model can have proved itself
_SUREST: Final = 10  # the process was surest of one in so many of them
# With predictions of these a tenth worse the model still answers as well, as lucky outcomes mislead the process. Where
# there is no noise they cannot, and it has to predict a tenth better. Measured on five tasks.
_NEARLY: Final = 1.1
_TINY: Final = np.finfo(float).tiny
_MOST: Final = 10.0  # times that either misses a movement by more counts as so many


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
        # Of each movement its row, the variance that the process expected, and by how much process and model missed it.
        self._tests: list[tuple[int, float, float, float]] = []
        self._proved = False
        model.before_learning.append(self._test)

    @property
    def trusted(self) -> bool:
        """Whether the model has proved itself, on the newer half of what it was told."""
        return self._proved and self.through_model.trusted

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
        new = slice(learnt, len(memory))
        contexts, thetas, outcomes = memory.contexts[new], memory.thetas[new], memory.outcomes[new]
        by_process = [process.predict_variance(*each) for each in zip(contexts, thetas, strict=True)]
        by_model = through_model.predict(contexts, thetas)
        for row, (one, other, outcome) in enumerate(zip(by_process, by_model, outcomes, strict=True), learnt):
            if one is not None:
                expected, variance = one
                self._tests.append((row, variance, math.dist(expected, outcome), math.dist(other, outcome)))
        self._proved = self._is_nearly_as_good(len(memory))

    def _is_nearly_as_good(self, n: int) -> bool:
        """Whether it missed those of the newer half of ``n`` movements that the process was surest of by as little."""
        recent = np.array([test for row, *test in self._tests if row >= n / 2])
        if len(recent) < _FEWEST:
            return False
        _, by_process, by_model = recent[recent[:, 0].argsort(kind="stable")[: len(recent) // _SUREST]].T
        times = np.maximum(by_model, _TINY) / np.maximum(by_process, _TINY)
        limit = _NEARLY if self.process.noise > 0 else 1 / _NEARLY
        return bool(np.log(times.clip(1 / _MOST, _MOST)).mean() <= math.log(limit))

    def _tell(self, memory: Memory, n: int) -> None:
        for row in range(len(self._told), n):
            self._told.add(memory.contexts[row], memory.thetas[row], memory.outcomes[row])
