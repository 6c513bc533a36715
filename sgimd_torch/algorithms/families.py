"""Two families of movements: goal babbling that knows all exemplars, and one that began around the middle of Pi.

Our addition. Uniform movements at the start suit most robots, but each becomes the centre of a family of its own. With
the fishing rod these families never join, and practice stalls. Goal babbling that spreads from one posture stays in one
family (Rolf, Steil & Gienger 2010). So a second goal babbling, which knows none of those movements, pursues every third
goal. Answers come from all movements.
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

    The wide family knows all exemplars. The narrow family knows all but those of the wide one: its own, demonstrated
    and added ones, and those with which the learner begins, as after a change of the robot. It acts once there are 100
    exemplars. While most movements have no effect, the wide family acts alone: effects are too rare to be kept from it.

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
        """An attempt at a goal by the family whose turn it is."""
        self._attempts += 1
        ready = len(self.problem.memory) >= _FIRST and self.problem.inverse.effects() is None
        yield from self._followed(self.narrow if ready and self._attempts % _TURNS == 0 else self.wide, context)

    def _followed(self, family: GoalBabbling, context: Array) -> AskingAttempt:
        """An attempt of a family; the narrow one is told of its outcomes before the attempt goes on."""
        self._tell_narrow(newest=True)
        moves, outcome = family.attempt(context), None
        try:
            while True:
                outcome = yield moves.send(outcome)
                self._tell_narrow(newest=family is self.narrow)
        except StopIteration:
            return
        finally:
            moves.close()

    def _tell_narrow(self, *, newest: bool) -> None:
        """Tell the narrow family all new exemplars; ``newest``: the last one, too."""
        memory, n = self.problem.memory, len(self.problem.memory)
        new = slice(self._seen, n if newest else n - 1)
        self.narrow.memory.extend(memory.contexts[new], memory.thetas[new], memory.outcomes[new])
        self._seen = n
