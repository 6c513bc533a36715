"""A robot that changes: the learner notices it, and earlier exemplars are kept if they improve predictions now.

Our addition. When a change is noticed, the learner begins again: it is built anew by the function that has built it.
The memory of its problem then holds all movements since the change, and those of before that help to predict them, as
they are or calibrated. The paper asks that a learner focus again where it gets worse (section 3.2.1).
    learner = practice(robot, seed, watch=changes)
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sgimd_torch.algorithms import Begin
from sgimd_torch.inverses.among_effects import process_of
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner, Restart
from sgimd_torch.learner.events import Change
from sgimd_torch.memory import Memory
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.spaces import Array, stream

if TYPE_CHECKING:
    from sgimd_torch.extras.changes.detector import ChangeDetector

_FIRST: Final = 32  # exemplars before any movement is predicted


def changes(begin: Begin, learner: Learner, prior: Memory | None) -> Changes | None:
    """Notices changes of the robot, and keeps what still helps.

    Raises:
        ValueError: ``prior`` to a learner that cannot notice changes.
    """
    return Changes(begin, learner, prior) if can_notice(learner, prior) else None


def can_notice(learner: Learner, prior: Memory | None) -> bool:
    """Whether a learner can notice changes; if not, a remark says why.

    Raises:
        ValueError: it cannot, but has a prior, which would then count for good.
    """
    if not learner.inverse.says_how_sure:
        why = f"{type(learner.inverse).__name__} does not say how sure it is"
    elif learner.problem.trained:
        why = "a forward model cannot begin again"
    elif learner.problem.outcomes.periodic:
        why = "a calibration does not know outcomes that wrap"
    else:
        return True
    if prior is not None:
        needed = (
            "an inverse model that says how sure it is, such as process, no forward model, and no outcome that wraps"
        )
        raise ValueError(f"prior (--begin-with) needs {needed}, but {why}; was another --inverse meant?")
    learner.problem.remarks.append(f"changes of the robot are not noticed: {why}")
    return False


class Changes:
    """Notices changes of the robot of a ``learner``. With a ``prior``, the learner's memory becomes empty."""

    def __init__(self, begin: Begin, learner: Learner, prior: Memory | None) -> None:
        self._begin, self._learner, self.prior, self._seed = begin, learner, prior, learner.problem.seed
        self._detector: ChangeDetector | None = None
        self._inverse, self._process = learner.inverse, process_of(learner.inverse)
        if prior is not None:
            learner.memory, learner.begun = learner.memory.empty(), 0
        self._numbers = [0] * learner.begun  # of each exemplar the number of its movement, or of the last one before it

    @property
    def process(self) -> LocalProcess:
        """Local process from which movements are predicted."""
        if self._learner.inverse is not self._inverse:
            self._inverse, self._process = self._learner.inverse, process_of(self._learner.inverse)
        return self._process

    def expect(self, context: Array, theta: Array, outcome: Array) -> None:
        """Compare an outcome, which is not in memory yet, with what is expected."""
        learner, process = self._learner, self.process
        self._numbers.append(max(0, learner.movements - 1))
        if self.prior is None and len(process.memory) < _FIRST:
            return
        if self._detector is None:
            from sgimd_torch.extras.changes.detector import ChangeDetector  # the first movements do not need it

            self._detector = ChangeDetector(learner.problem, learner.memory, self.prior)
        self._detector.expect(process, context, theta, outcome)

    def restart_if_changed(self) -> Restart | None:
        """What to begin again with; None to go on."""
        learner = self._learner
        found = None if self._detector is None else self._detector.restart_if_changed(self.process)
        if self._detector is None or found is None:
            return None
        since, change = self._detector.since, None
        if found.is_new:
            change = Change(self._numbers[since], learner.movements, found.n_before, len(found.kept.thetas))
        new = self.begin_again(
            found.kept.and_then(Exemplars.of(learner.memory, slice(since, None))), len(learner.memory)
        )
        return Restart(new, found.kept, since, change)

    def begin_again(self, exemplars: Exemplars, n: int) -> Learner:
        """A learner that begins again with these exemplars, after ``n`` exemplars in all."""
        return self._begin(
            int(stream(self._seed, "begin again", n).integers(2**63)), exemplars.memory_like(self._learner.memory)
        )
