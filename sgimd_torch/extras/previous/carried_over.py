"""A robot with memory: do outcomes depend on the movement before?

Our addition. Each outcome is predicted from all other movements twice: from context and theta alone, and with the theta
of the movement before as a further input. Predictions become worse with an input that has no effect. So if they become
clearly better, outcomes depend on the movement before.
    share = error_knowing_previous(learner)
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np

from sgimd_torch.extras.changes.eras import SURE, Era, better
from sgimd_torch.inverses.gaussian_process import one_thread
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array

_FEWEST: Final = 16  # least number of movements, the number to which a process is first fitted
_WORTH: Final = 0.75  # largest share of the error that is told; another fit of the kernel gained .15 on a Jaco arm


@one_thread
def error_knowing_previous(learner: Learner) -> float | None:
    """The error of predictions that know the movement before, relative to that of predictions that do not know it.

    None: it is not sure that they are worth knowing. The learner's robots must not have moved at once.
    """
    rows = [learner.rows[number] for number in range(learner.movements)]
    pairs = [pair for pair in pairwise(rows) if all(isinstance(row, int) for row in pair)]
    if len(pairs) < _FEWEST:
        return None
    earlier, later = np.array(pairs).T
    alone, before = Exemplars.of(learner.memory, later), learner.memory.thetas[earlier]
    knowing = alone._replace(contexts=np.hstack((before, alone.contexts)))
    errors, errors_knowing = (_left_out(learner.problem, exemplars) for exemplars in (alone, knowing))
    if better(errors, errors_knowing, learner.problem.outcome_noise) < SURE:
        return None
    share = float(np.sqrt(errors_knowing.mean() / errors.mean()))
    return share if share < _WORTH else None


def _left_out(problem: Problem, exemplars: Exemplars) -> Array:
    """Squared errors ``(n,)`` of predicting each movement from all others; 0 if all outcomes are equal."""
    memory = exemplars.memory_like(Memory(*(table.shape[1] for table in exemplars)))
    fitted, n = LocalProcess(problem.over(memory)).fitted(), len(exemplars.thetas)
    return np.zeros(n) if fitted is None else Era(fitted, exemplars).left_out(np.arange(n))[0]
