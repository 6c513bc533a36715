"""The parts of a recorded run, with the learner as it was at the end.

learner = load_learner("runs/practice/seed-000"); learner.inverse(context, goal).theta
"""

from __future__ import annotations

import os
from pathlib import Path

from sgimd_torch.learner import Learner
from sgimd_torch.options.build import RunParts, build
from sgimd_torch.record.saving import load_life
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.read import config_of, read_run


def load_learner(path: str | os.PathLike[str], *, trust: bool = False) -> Learner:
    """The learner of a run, as it was after the last recorded movement; it answers goals, and can go on.

    Args:
        path: directory of the run.
        trust: whether to execute the user's code that the settings of the run name.

    Raises:
        RunError: there is no run, it names code of the user and ``trust`` is false, or its record is damaged.
        ReplayError: the learner does not repeat its record.
    """
    return load_parts(path, trust=trust).learner


def load_parts(path: str | os.PathLike[str], *, trust: bool = False) -> RunParts:
    """All parts of a run; the learner has repeated its record. See ``load_learner``."""
    parts = build(config_of(read_run(path), trust=trust))
    learner, trained = parts.learner, parts.learner.problem.trained
    load_life(learner, Path(path) / FILE, after=lambda _: [model.refresh(learner.memory) for model in trained])
    return parts
