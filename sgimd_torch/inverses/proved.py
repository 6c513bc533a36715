"""A forward model that has to prove itself: it answers where a local process expects no more error of its answer.

Our addition, not in the paper. A model that was trained on few kinds of movements, those around what was demonstrated
say, predicts others with confidence and wrongly. The process, which knows the movements near the goal, does not.
    inverse = ProvedInverse(memory, model, environment.policies, outcome_noise=environment.outcome_noise)
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.forward_model.anchored import TRUST, Trust
from sgimd_torch.forward_model.model import ForwardModel
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.inverses.through_model import ModelInverse
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, Box, Estimate


class ProvedInverse:
    """The answer of `ModelInverse` or of `LocalProcess`, whichever is expected to err less by the latter.

    Args:
        memory, model, policies, trust: as for `ModelInverse`.
        outcome_noise: as for `LocalProcess`.

    Raises:
        ValueError: ``noise`` out of its range, or a model of other dimensions.
    """

    learns_with = LocalProcess  # the inverse of a learner whose evaluations are answered by this one

    def __init__(
        self, memory: Memory, model: ForwardModel, policies: Box, *, outcome_noise: float = 0.0, trust: Trust = TRUST
    ) -> None:
        self.process = LocalProcess(memory, outcome_noise=outcome_noise)
        self.through_model = ModelInverse(memory, model, policies, trust=trust)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes.

        Raises:
            RuntimeError: the memory is empty.
        """
        return self.many(context, goal[None])[0]

    def many(self, context: Array, goals: Array) -> list[Estimate]:
        """An estimate for each of ``(n, outcome_dim)`` goals, several times faster than one by one.

        Raises:
            RuntimeError: the memory is empty.
        """
        found = [self.process(context, goal) for goal in goals]
        if not self.through_model.trusted:
            return found
        for row, answer in enumerate(self.through_model.many(context, goals)):
            both = np.stack((found[row].theta, answer.theta))
            errors = self.process.expected_errors(context, goals[row], both)
            if errors is not None and errors[1] <= errors[0]:
                found[row] = answer
        return found
