"""A robot with memory: do outcomes depend on the movement before?

Our addition. Each outcome is predicted from all other movements twice: from context and theta alone, and with the theta
of the movement before as a further input. An input without effect makes predictions worse, so noise passes the test
hardly ever.
    share = error_knowing_previous(learner)
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from sgimd_torch.changes.eras import SURE, Era, Exemplars, better
from sgimd_torch.inverses.gaussian_process import one_thread
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Kind
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array


@one_thread
def error_knowing_previous(learner: Learner) -> float | None:
    """The error of predictions that know the movement before, relative to that of predictions that do not know it.

    None: it is not sure that they are better. The learner's robots must not have moved at once.
    """
    pairs = [
        (before.theta, (event.context, event.theta, event.outcome))
        for before, event in pairwise(learner.events())
        if before.kind == event.kind == Kind.MOVED
    ]
    if not pairs:
        return None
    thetas_before, movements = zip(*pairs, strict=True)
    exemplars = Exemplars(*map(np.array, zip(*movements, strict=True)))
    knowing = exemplars._replace(contexts=np.hstack((np.array(thetas_before), exemplars.contexts)))
    errors, errors_knowing = (_left_out(learner.problem, known) for known in (exemplars, knowing))
    if errors is None or errors_knowing is None or better(errors, errors_knowing, learner.problem.outcome_noise) < SURE:
        return None
    return float(np.sqrt(errors_knowing.mean() / errors.mean()))


def _left_out(problem: Problem, exemplars: Exemplars) -> Array | None:
    """Squared errors ``(n,)`` of predicting each movement from all others; None: too few, or all outcomes are equal."""
    fitted = LocalProcess(problem.over(exemplars.memory)).fitted()
    return None if fitted is None else Era(fitted, exemplars).left_out(np.arange(len(exemplars.thetas)))[0]
