"""The memory that a learner had, made again from its run: what it would answer then can be asked now.

run = read_run("runs/sgim-d/seed-003"); parts = build(config_of(run)); remember(run, parts, 0, 500)
theta = parts.inverse(context, goal).theta
"""

from __future__ import annotations

import numpy as np

from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.read import Run
from sgimd_torch.strategies import Remember


def remember(run: Run, parts: RunParts, start: int, stop: int) -> None:
    """Add to the memory of ``parts`` what the learner remembered in movements ``start`` to ``stop``, in the same order,
    and train a forward model on it as in the run."""
    memory, correspondence = parts.learner.memory, parts.learner.correspondence
    by_observation = isinstance(parts.learner.social, Remember)  # other learners remember only their own movements
    for row in range(start, min(stop, len(run.index))):
        if by_observation and correspondence is not None and run.demonstration[row] >= 0:
            shown = run.demonstrations[run.demonstration[row]]
            memory.add(shown.context, correspondence(shown.times, shown.trajectory), shown.outcome)
        if np.isfinite(run.outcomes[row]).all():
            memory.add(run.contexts[row], run.thetas[row], run.outcomes[row])
        if parts.model is not None:
            goal = run.goals[row]
            parts.model.refresh(memory, goal if np.isfinite(goal).all() else None)
