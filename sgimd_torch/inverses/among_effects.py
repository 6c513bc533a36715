"""Local process fitted to effective movements alone, where most movements have no effect.

Our addition, not in the paper. Where an object is touched, what comes of it changes smoothly with the movement; where
it is not, nothing changes. One process of both would be wrong about both, and most exemplars would say nothing.
    inverse = AmongEffects(problem); estimate = inverse(context, goal)
"""

from __future__ import annotations

from sgimd_torch.explore.effects import Effects
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.spaces import Array, Estimate


class AmongEffects(Inverse):
    """Local Gaussian process, fitted to effective movements alone where most have no effect.

    It is `LocalProcess` while every movement has an effect of its own, or none had one yet.

    Args:
        problem: memory and noise are read.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._effects = Effects(problem.memory, problem.outcome_noise)
        self._all = self._among = LocalProcess(problem)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes, nearest first."""
        acted = self.effects()
        if acted is None or not len(acted):
            return self._all(context, goal)
        if self._among.memory is not acted:
            self._among = LocalProcess(self.problem.over(acted))
        return self._among(context, goal)

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Prediction of `LocalProcess`, from all movements."""
        return self._all.predict(context, theta)

    def effects(self) -> Memory | None:
        """Exemplars with an effect, see `Effects`."""
        return self._effects()
