"""Open a run: its parts are built again from its settings, and its learner repeats its record.

learner = load_learner("runs/practice/seed-000"); learner.inverse(context, goal).theta
run = OpenRun(path); run.replay(300); run.replay(5000)     # the learner after 300 movements, later after 5000
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from sgimd_torch.learner import Learner
from sgimd_torch.record import ReplayError
from sgimd_torch.record.replay import repeated
from sgimd_torch.runs.directory import RUN_FILE, build_again, changed_versions, sources, versions_of
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.runs.run import Listening
from sgimd_torch.runs.signals import say


def load_learner(path: str | os.PathLike[str], *, trust: bool = False) -> Learner:
    """The learner of a run, as it was after the last recorded movement; it answers goals, and can go on.

    Args:
        path: directory of the run.
        trust: whether to execute the user's code that the settings of the run name.

    Raises:
        RunError: there is no run, it names code of the user and ``trust`` is false, or its record is damaged.
        ReplayError: the learner does not repeat its record.
    """
    run = OpenRun(path, trust=trust)
    run.replay()
    return run.parts.learner


class OpenRun:
    """A run on disk, finished or still running, whose learner can repeat the recorded movements.

    Args:
        path: directory of the run.
        trust: whether to execute the user's code that the settings of the run name.

    Attributes:
        recorded: record of the run, as arrays.
        parts: parts of the run; the learner has made no movement before ``replay``.

    Raises:
        RunError: see ``load_learner``.
    """

    def __init__(self, path: str | os.PathLike[str], *, trust: bool = False) -> None:
        self.recorded = read_run(path)
        say(*(f"{path}: {remark}" for remark in self.recorded.remarks))
        self.parts = build_again(config_of(self.recorded, trust=trust), Path(path) / RUN_FILE)
        now = sources(self.parts.config, self.parts.environment)
        if changes := changed_versions(self.recorded.versions, now):
            say(f"the robot of {path} is not what it was, and moves as it is now: {changes}")
        self._episodes = repeated(self.parts.learner, Path(path) / RUN_FILE)

    def replay(self, movements: int | None = None) -> None:
        """Let the learner repeat its record until it has made this number of ``movements``; None: to the end.

        Robots that moved at once make the last movements together, so there may be more.

        Raises:
            ReplayError: the learner does not repeat its record.
        """
        learner = self.parts.learner
        last = math.inf if movements is None or movements >= len(self.recorded.index) else movements
        if learner.movements >= last:
            return
        refreshes = [*zip(*(self.recorded.refreshes or {}).values(), strict=True)]
        for part in learner.problem.trained:
            if isinstance(part, Listening):
                part.restore(self.recorded.path, refreshes, (learner.movements, last))
        try:
            for episode in self._episodes:
                for model in learner.problem.trained:
                    model.refresh(learner.memory)
                if last <= learner.movements == episode.index + 1:
                    return
        except ReplayError as error:
            changes = changed_versions(self.recorded.versions, versions_of(self.parts))
            raise ReplayError(f"{error}{f' What differs: {changes}' * bool(changes)}") from error
