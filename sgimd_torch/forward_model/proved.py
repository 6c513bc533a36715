"""A forward model as inverse model, once a test shows that it predicts movements as well as a local process.

Our addition, not in the paper. Before the model learns from new movements, model and process both predict their
outcomes from the earlier movements (prequential analysis: Dawid, J. R. Stat. Soc. A 147, 1984). They are compared on
those movements for which the process predicted the least variance, because answers are such movements. So neither of
the two is tested on its own answers, and no movements are executed for the test.
    inverse = ProvedModel(problem); inverse.trusted
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np

from sgimd_torch.calls import with_keywords_of
from sgimd_torch.forward_model.inverse import ModelInverse
from sgimd_torch.forward_model.shared import ModelBased
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate

_FEWEST: Final = 200  # least number of recent movements for a test
_ONE_IN: Final = 10  # one in ten recent movements is compared, those with the least variance by the process
# Largest accepted ratio of the errors of model and process, measured on five tasks. With noise, a model with errors a
# tenth larger answers as well, because lucky outcomes mislead the process. Without noise it is 1 / 1.1.
_RATIO: Final = 1.1
_TINY: Final = np.finfo(float).tiny  # least error, so that a ratio of errors is finite
_LARGEST: Final = 10.0  # largest ratio of errors; ratios are clipped to [1/10, 10]


class ProvedModel(ModelBased):
    """Local Gaussian process; the forward model once it predicts as well (extra forward).

    The answers of the forward model are those of `ModelInverse`. The test is part of ``model.refresh``, so evaluations
    change nothing.

    Args:
        problem: problem to learn.
    """

    @with_keywords_of(ModelBased)
    def __init__(self, problem: Problem, **options: Any) -> None:
        super().__init__(problem, **options)
        self.process, self.model_inverse = LocalProcess(problem), ModelInverse(problem)
        self._earlier = problem.memory.empty()
        before = problem.over(self._earlier)
        self._rivals = LocalProcess(before), ModelInverse(before)
        # For each movement: its row, the variance that the process predicts, and the errors of process and model.
        self._tests: list[tuple[int, float, float, float]] = []
        self.model.before_learning.append(self._test)
        self.model.guides = True

    @property
    def trusted(self) -> bool:
        """Whether the model has passed the test on the newer half of the movements, and its relative error is small."""
        return bool(self.model.proved) and self.model.trusted

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes."""
        return self._better(context, goal)

    def answer_many(self, contexts: Array, goals: Array) -> list[Estimate]:
        """Estimates for ``goals`` ``(n, outcome_dim)``, see `ModelInverse.answer_many`."""
        return self._better.answer_many(contexts, goals)

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Expected outcome ``(outcome_dim,)`` of ``theta`` by `LocalProcess`; None while there are too few
        exemplars."""
        return self.process.predict(context, theta)

    @property
    def _better(self) -> Inverse:
        return self.model_inverse if self.trusted else self.process

    def _test(self, memory: Memory, learnt: int) -> None:
        """Test model and process, which know the first ``learnt`` movements, on the later movements."""
        for row in range(len(self._earlier), learnt):
            self._earlier.add(memory.contexts[row], memory.thetas[row], memory.outcomes[row])
        process, model_inverse = self._rivals
        new = slice(learnt, len(memory))
        contexts, thetas, outcomes = memory.contexts[new], memory.thetas[new], memory.outcomes[new]
        by_process = map(process.predict_variance, contexts, thetas)
        by_model = model_inverse.predict_many(contexts, thetas)
        for row, (prediction, landing, outcome) in enumerate(zip(by_process, by_model, outcomes, strict=True), learnt):
            if prediction is not None:
                expected, variance, _ = prediction
                self._tests.append((row, variance, math.dist(expected, outcome), math.dist(landing, outcome)))
        self.model.proved.fill_(self._is_nearly_as_good(len(memory)))

    def _is_nearly_as_good(self, n: int) -> bool:
        """Whether the model predicted as well as the process, on recent movements with the least predicted variance."""
        recent = np.array([test for row, *test in self._tests if row >= n / 2])
        if len(recent) < _FEWEST:
            return False
        _, by_process, by_model = recent[recent[:, 0].argsort(kind="stable")[: len(recent) // _ONE_IN]].T
        ratios = np.maximum(by_model, _TINY) / np.maximum(by_process, _TINY)
        limit = _RATIO if self.process.noise > 0 else 1 / _RATIO
        return bool(np.log(ratios.clip(1 / _LARGEST, _LARGEST)).mean() <= math.log(limit))
