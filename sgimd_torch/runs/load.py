"""Open a run: its parts are built again from its settings, and its learner gets the exemplars of its record.

learner = load_learner("runs/practice/seed-000"); learner.inverse(context, goal).theta
run = OpenRun(path); run.recall(300); run.recall(5000)     # the learner after 300 movements, later after 5000
"""

from __future__ import annotations

import math
import os
from pathlib import Path

from sgimd_torch.learner import Learner
from sgimd_torch.record import Record
from sgimd_torch.runs.directory import RUN_FILE, build_again, changed_versions, sources
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.runs.recall import Recalled


def load_learner(path: str | os.PathLike[str], *, trust: bool = False) -> Learner:
    """The learner of a run after the last recorded movement: it has all exemplars, and answers goals as it did then.

    Its goal model begins anew; ``sgimd run --resume`` goes on with the run itself.

    Args:
        path: directory of the run.
        trust: whether to execute the user's code that the settings of the run name.

    Raises:
        RunError: there is no run, it names code of the user and ``trust`` is false, or its record is damaged.
    """
    run = OpenRun(path, trust=trust)
    run.recall()
    return run.parts.learner


class OpenRun:
    """A run on disk, finished or still running, whose learner answers from the recorded movements.

    Args:
        path: directory of the run.
        trust: whether to execute the user's code that the settings of the run name.

    Attributes:
        recorded: record of the run, as arrays.
        parts: parts of the run; the memory of the learner is empty before ``recall``.

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
        with Record(Path(path) / RUN_FILE) as record:
            self._recalled = Recalled(self.parts.learner, record)

    def recall(self, movements: float = math.inf) -> None:
        """Give the learner the exemplars of its record up to this number of ``movements``; inf: all.

        Robots that moved at once made the last movements together, so there may be more.
        """
        self._recalled.until(movements)
