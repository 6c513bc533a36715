"""The function ``build``, which builds all parts of a run from its ``Config``.

parts = build(Config(seed=3)); for episode in run(parts.learner, parts.environment, 3, teacher=parts.teacher, ...): ...
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from sgimd_torch.calls import call_checked, function_of
from sgimd_torch.environments.protocol import FromFiles
from sgimd_torch.learner import Learner
from sgimd_torch.options.config import Config
from sgimd_torch.parts import Teacher
from sgimd_torch.runs.plan import Plan
from sgimd_torch.runs.run_parts import RunParts
from sgimd_torch.spaces import stream


def build(config: Config, record: Path | None = None) -> RunParts:
    """Build the parts of a run; nothing is executed yet.

    Args:
        config: settings of the run.
        record: record of the run, which keeps the exemplars that it began with; None: the run is not on disk.

    Raises:
        ValueError: a part refuses an option, or a file does not fit the robot.
        FileNotFoundError: a file does not exist.
    """
    plan = Plan(config, record)
    robot, seed, teacher, given = plan.task.environment, config.seed, None, dict[str, Any]()
    config = config.with_found(robot.found_options if isinstance(robot, FromFiles) else {})
    plan.notes += robot.remarks if isinstance(robot, FromFiles) else ()
    for hook in plan.hooks:
        given |= hook.given(plan)
    if config.teaching == "teacher":
        make = config.constructor("teacher")
        kind = function_of(make)
        alone = isinstance(kind, type) and issubclass(kind, Teacher) and not kind.needs_demonstrations
        shown = () if alone else plan.demonstrations
        teacher = Teacher.of(make, shown, stream(seed, "teacher"))
    if config.teaching:
        from sgimd_torch.tasks.taught import correspondence_of

        given["correspondence"] = correspondence_of(plan.task)
    algorithm = f"algorithm {config.algorithm}"
    learner = call_checked(algorithm, config.constructor("algorithm"), robot, seed, **given)
    if not isinstance(learner, Learner):
        raise ValueError(f"{algorithm} must return a Learner, got a {type(learner).__name__}")
    of_hooks = given.get("teachers", {}), given.get("prior")
    parts = RunParts(config, plan.task, plan.hooks, learner, teacher, *of_hooks, plan.data, plan.notes)
    assert parts.inverses  # made here, so that their remarks are among the notes
    for hook in plan.hooks:
        hook.built(parts)
    parts.notes.extend(learner.problem.remarks)
    return parts
