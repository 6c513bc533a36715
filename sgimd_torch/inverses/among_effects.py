"""The answer of a local process that has seen only movements with an effect, where most movements have none.

Our addition, not in the paper. Where an object is touched, what comes of it changes smoothly with the movement; where
it is not, nothing changes. One process of both would be wrong about both, and most exemplars would say nothing.
    inverse = AmongEffects(memory, outcome_noise=environment.outcome_noise); estimate = inverse(context, goal)
"""

from __future__ import annotations

from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory
from sgimd_torch.memory.effects import Effects
from sgimd_torch.spaces import Array, Estimate


class AmongEffects:
    """`LocalProcess` while every movement has an effect of its own, or none had one yet.

    Args:
        memory, outcome_noise: as in `LocalProcess`.
    """

    def __init__(self, memory: Memory, *, outcome_noise: float = 0.0) -> None:
        self.effects = Effects(memory, outcome_noise)
        self.noise = outcome_noise
        self._all = self._among = LocalProcess(memory, outcome_noise=outcome_noise)

    def __call__(self, context: Array, goal: Array) -> Estimate:
        """The answer, and the exemplars of the nearest outcomes, nearest first.

        Raises:
            RuntimeError: the memory is empty.
        """
        acted = self.effects()
        if acted is None or not len(acted):
            return self._all(context, goal)
        if self._among.memory is not acted:
            self._among = LocalProcess(acted, outcome_noise=self.noise)
        return self._among(context, goal)

    def predict(self, context: Array, theta: Array) -> Array | None:
        """As `LocalProcess` does, from all movements."""
        return self._all.predict(context, theta)
