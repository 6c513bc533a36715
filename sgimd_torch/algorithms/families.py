"""Two families of movements: goal babbling that knows all exemplars, and one that began around the middle of Pi.

Our addition. Practice begins with uniform movements, which suit most robots. But each stays the centre of its own
variations: with the fishing rod these groups never join, and the error stops falling. Movements that spread from one
posture stay in one group (Rolf, Steil & Gienger 2010). So a second goal babbling pursues every third goal. It is not
told of the first one's movements, and begins around the middle of Pi. Answers come from all movements.
    TwoFamilies(GoalBabbling(problem, **PRACTICE), GoalBabbling(own_problem, **PRACTICE, explore=Widening))
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from sgimd_torch.parts import Part, Strategy
from sgimd_torch.spaces import Array, AskingAttempt
from sgimd_torch.strategies import GoalBabbling

_FIRST: Final = 100  # least number of exemplars; until then the wide family alone pursues goals
_TURNS: Final = 3  # number of attempts of which one is narrow


class TwoFamilies(Strategy):
    """Goal babbling in two families of movements; of three goals the narrow family pursues one.

    The wide family knows all exemplars. The narrow family knows all except those of the wide one. If the learner begins
    again, after a change of the robot or with a prior, both families know the exemplars so far. Narrow attempts begin
    at 100 exemplars. While most movements have no effect, all attempts are wide: effects are too rare.

    Args:
        wide, narrow: goal babbling of each family. The problem of the narrow one begins without exemplars.
    """

    def __init__(self, wide: GoalBabbling, narrow: GoalBabbling) -> None:
        super().__init__(wide.problem)
        self.wide, self.narrow = wide, narrow
        self._attempts, self._seen = 0, 0  # number of attempts at goals, and of exemplars that `_tell_narrow` has seen

    @property
    def regions(self) -> Sequence[Any]:
        """Regions of the goal model of the wide family."""
        return self.wide.regions

    def maker(self, origin: str) -> Part:
        """See `GoalBabbling.maker`."""
        return self.wide.maker(origin)

    def attempt(self, context: Array) -> AskingAttempt:
        """An attempt at a goal by one family; the narrow one is told of its outcomes before it goes on."""
        self._attempts += 1
        self._tell_narrow()
        turn = self._attempts % _TURNS == 0 and len(self.problem.memory) >= _FIRST
        narrow = turn and self.problem.inverse.effects() is None
        family: Strategy = self.narrow if narrow else self.wide
        moves, outcome = family.attempt(context), None
        try:
            while True:
                outcome = yield moves.send(outcome)
                self._tell_narrow(wide=not narrow)
        except StopIteration:
            return
        finally:
            moves.close()

    def _tell_narrow(self, *, wide: bool = False) -> None:
        """Tell the narrow family all new exemplars; ``wide``: not the last one, which is the wide family's."""
        memory, n = self.problem.memory, len(self.problem.memory)
        new = slice(self._seen, n - wide)
        self.narrow.memory.extend(memory.contexts[new], memory.thetas[new], memory.outcomes[new])
        self._seen = n
