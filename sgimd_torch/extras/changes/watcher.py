"""A robot that changes: the learner notices it, and earlier exemplars are kept if they improve predictions now.

Our addition. When a change is noticed, the learner begins again: it is built anew by the function that has built it.
The memory of its problem then holds all movements since the change, and those of before that help to predict them, as
they are or calibrated. The paper asks that a learner focus again where it gets worse (section 3.2.1).
    return noticing_changes(begin, seed, memory, prior)    # at the end of an algorithm
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Final

from sgimd_torch.inverses.among_effects import process_of
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.learner import Learner
from sgimd_torch.learner.events import Change
from sgimd_torch.memory import Memory
from sgimd_torch.spaces import Array, stream

if TYPE_CHECKING:
    from sgimd_torch.changes.detector import ChangeDetector

_FIRST: Final = 32  # exemplars before any movement is predicted

Begin = Callable[[int, Memory | None], Learner]
"""Function (seed, exemplars to start from) -> learner."""


def noticing_changes(begin: Begin, seed: int, memory: Memory | None, prior: Memory | None) -> Learner:
    """The learner that ``begin`` builds; it begins again when its robot has changed.

    Args:
        begin: function that builds the learner.
        seed: number from which all random streams of the learner come.
        memory: exemplars to start from; None: no exemplars.
        prior: exemplars of another robot, such as a simulator; they count as far as they hold. None: no exemplars.

    Raises:
        ValueError: both ``memory`` and ``prior`` are given, or ``prior`` to a learner that cannot notice changes.
    """
    if memory is not None and prior is not None:
        raise ValueError("give memory, exemplars of this robot, or prior, exemplars of another robot; got both")
    learner = begin(seed, memory if prior is None else prior)
    learner.watcher = Watcher(begin, learner, prior)
    check_watcher(learner)
    return learner


def check_watcher(learner: Learner) -> None:
    """Take its watcher from a learner that cannot notice changes, with a remark.

    Raises:
        ValueError: the learner has a prior, which would then count for good.
    """
    if not learner.inverse.says_how_sure:
        why = f"{type(learner.inverse).__name__} does not say how sure it is"
    elif learner.problem.trained:
        why = "a forward model cannot begin again"
    else:
        return
    if isinstance(learner.watcher, Watcher) and learner.watcher.prior is not None:
        needed = "an inverse model that says how sure it is, such as process, and no forward model"
        raise ValueError(f"prior (--begin-with) needs {needed}, but {why}; was another --inverse meant?")
    if learner.watcher is not None:
        learner.watcher = None
        learner.problem.remarks.append(f"changes of the robot are not noticed: {why}")


class Watcher:
    """Notices changes of the robot of a ``learner``. With a ``prior``, the learner's memory becomes empty."""

    def __init__(self, begin: Begin, learner: Learner, prior: Memory | None) -> None:
        self._begin, self._learner, self.prior, self._seed = begin, learner, prior, learner.problem.seed
        self._detector: ChangeDetector | None = None
        self._inverse, self._process = learner.inverse, process_of(learner.inverse)
        if prior is not None:
            learner.memory, learner.begun = Memory(*learner.problem.dims), 0
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
            from sgimd_torch.changes.detector import ChangeDetector  # the first movements of a life do not need it

            self._detector = ChangeDetector(learner.problem, learner.memory, self.prior)
        self._detector.expect(process, context, theta, outcome)

    def restart_if_changed(self) -> tuple[Learner, Change | None] | None:
        """A learner to go on as, and the change if a new one was noticed; None to go on."""
        learner = self._learner
        if self._detector is None:
            return None
        restart = self._detector.restart_if_changed(self.process)
        if restart is None:
            return None
        n = len(learner.memory)
        seed = int(stream(self._seed, "begin again", n).integers(2**63))
        new = self._begin(seed, restart.exemplars.memory)
        if not restart.is_new:
            return new, None
        since = self._numbers[self._detector.since]
        return new, Change(since, learner.movements, restart.n_before, restart.n_kept)
