"""Two families of movements, the wide and the narrow one; a family is a group of movements with their variations.

Our addition. Practice begins with uniform movements, which suit most robots. But each of them stays the centre of its
own variations: with the fishing rod these groups never join, and the error stops falling. Movements that spread from
one posture stay in one group (Rolf, Steil & Gienger 2010). So a second goal babbling, the narrow family, pursues some
of the goals. It is not told of the movements of the wide family, and begins around the middle of Pi. The family with
the smaller errors gets more goals, by Thompson sampling (Thompson 1933) of the newest errors. Answers come from all
movements.
    TwoFamilies(GoalBabbling(problem, **PRACTICE), GoalBabbling(own_problem, **PRACTICE, explore=Widening))
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from sgimd_torch.algorithms import ThroughBabbling
from sgimd_torch.spaces import Array, AskingAttempt
from sgimd_torch.strategies import GoalBabbling

_FIRST: Final = 100  # least number of exemplars; until then the wide family alone pursues goals
_DECIDED: Final = 150  # number of exemplars of the narrow family from which on errors decide
_SHARE: Final = 1 / 3  # share of the goals that the narrow family gets before
_NEWEST: Final = 60  # number of movements whose errors decide
_TINY: Final = 1e-300  # added to an error, so that the logarithm of an error of 0 is finite


class TwoFamilies(ThroughBabbling):
    """Goal babbling in two families of movements, which share the goals of the wide family.

    The wide family knows all exemplars. The narrow family knows all except those of the wide one. If the learner begins
    again, after a change of the robot or with a prior, both families know the exemplars so far. Narrow attempts begin
    at 100 exemplars. While most movements have no effect, all attempts are wide: effects are too rare.

    Args:
        wide, narrow: goal babbling of each family. The problem of the narrow one begins without exemplars.
    """

    draws_from = "families"

    def __init__(self, wide: GoalBabbling, narrow: GoalBabbling) -> None:
        super().__init__(wide)
        self.wide, self.narrow = wide, narrow
        self._seen = 0  # number of exemplars that `_tell_narrow` has seen
        self._errors = deque[tuple[bool, float]](maxlen=_NEWEST)  # whether narrow, and log of the distance to the goal

    def attempt(self, context: Array) -> AskingAttempt:
        """An attempt at a goal by one family; the narrow one is told of its outcomes before it goes on."""
        self._tell_narrow()
        goal, narrow = self.wide.goals.sample(context), self._narrow_turn()
        moves: AskingAttempt = (self.narrow if narrow else self.wide).pursue(context, goal)
        outcome = None
        try:
            while True:
                outcome = yield moves.send(outcome)
                self._errors.append((narrow, math.log(math.dist(outcome, goal) + _TINY)))
                self._tell_narrow(wide=not narrow)
        except StopIteration:
            return
        finally:
            moves.close()

    def _narrow_turn(self) -> bool:
        """Whether the narrow family pursues the next goal: it does if its drawn mean error is the smaller one."""
        if len(self.problem.memory) < _FIRST or self.problem.inverse.effects() is not None:
            return False
        if len(self.narrow.memory) < _DECIDED:
            return bool(self.rng.random() < _SHARE)
        means = []
        for family in (False, True):
            errors = [error for narrow, error in self._errors if narrow is family]
            if len(errors) < 2:
                return family
            n, mean = len(errors), sum(errors) / len(errors)  # numpy takes five times as long for sixty numbers
            means.append(self.rng.normal(mean, math.sqrt(sum((error - mean) ** 2 for error in errors) / (n - 1) / n)))
        return bool(means[True] < means[False])

    def _tell_narrow(self, *, wide: bool = False) -> None:
        """Tell the narrow family all new exemplars; ``wide``: not the last one, which is the wide family's."""
        memory, n = self.problem.memory, len(self.problem.memory)
        new = slice(self._seen, n - wide)
        if new.start < new.stop:
            self.narrow.memory.extend(memory.contexts[new], memory.thetas[new], memory.outcomes[new])
        self._seen = n
