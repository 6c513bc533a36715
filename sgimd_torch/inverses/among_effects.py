"""Local process fitted to effective movements alone, for robots most of whose movements have no effect.

Our addition, not in the paper. If a movement touches an object, its outcome changes smoothly with theta; otherwise the
outcome does not depend on theta. One process for both kinds of movements would predict both badly.
    inverse = AmongEffects(problem); estimate = inverse(context, goal)
"""

from __future__ import annotations

from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.parts import Inverse, Problem
from sgimd_torch.searches.effects import Effects
from sgimd_torch.spaces import Array, Estimate


class AmongEffects(Inverse):
    """Local Gaussian process; if most movements have no effect, it is fitted to effective movements alone.

    While all movements or no movements have an effect, this inverse model equals `LocalProcess`.

    Args:
        problem: problem to learn.

    Attributes:
        of_all: process fitted to all movements.
    """

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self._effects = Effects(problem.memory, problem.outcome_noise)
        self.of_all = self._of_effective = LocalProcess(problem)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes, nearest first."""
        effective = self.effects()
        if effective is None or not len(effective):
            return self.of_all(context, goal)
        if self._of_effective.memory is not effective:
            self._of_effective = LocalProcess(self.problem.over(effective))
        return self._of_effective(context, goal)

    def uncertainty(self, context: Array, goals: Array) -> Array:
        """That of the process of all movements: a goal model asks for it only while all movements have an effect."""
        return self.of_all.uncertainty(context, goals)

    def predict(self, context: Array, theta: Array) -> Array | None:
        """Prediction of `LocalProcess`, fitted to all movements."""
        return self.of_all.predict(context, theta)

    def unexplained(self, context: Array, theta: Array, outcome: Array) -> float:
        """That of the process of all movements; 0 if most have no effect."""
        return self.of_all.unexplained(context, theta, outcome) if self.effects() is None else 0.0

    def effects(self) -> Memory | None:
        """Exemplars with an effect, see `Effects`."""
        return self._effects()


def process_of(inverse: Inverse) -> LocalProcess:
    """A local process of all exemplars, to predict any movement: that of the inverse model, or a new one."""
    own = inverse.of_all if isinstance(inverse, AmongEffects) else inverse
    return own if isinstance(own, LocalProcess) else LocalProcess(inverse.problem)
