"""The option ``--begin-with`` of a run, and a last look at whether its learner can notice changes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sgimd_torch.calls import parameters_of
from sgimd_torch.runs.hooks import Hook

if TYPE_CHECKING:
    from sgimd_torch.runs.plan import Plan
    from sgimd_torch.runs.run_parts import RunParts


class BeginWith(Hook):
    """Movements of another robot.

    Args:
        begin_with: run.sqlite or csv of another robot or simulator to begin with; null: none.
    """

    def __init__(self, *, begin_with: Path | None = None) -> None:
        self.begin_with = begin_with

    def given(self, plan: Plan) -> Mapping[str, Any]:
        """These movements, as the prior of the algorithm."""
        if self.begin_with is None:
            return {}
        if "prior" not in parameters_of(plan.config.chosen["algorithm"].make):
            raise ValueError(f"--begin-with: algorithm {plan.config.algorithm} does not learn from another robot")
        from sgimd_torch.extras.changes.past import past_of  # few runs begin with a past

        prior, notes, plan.data["begin_with_crc32"] = past_of(plan.task, self.begin_with, plan.record)
        plan.notes += notes
        return {"prior": prior}

    def built(self, parts: RunParts) -> None:
        """An inverse model of the evaluations may have brought a forward model, with which nobody notices changes."""
        from sgimd_torch.extras.changes.watcher import Changes, can_notice

        learner = parts.learner
        if isinstance(learner.watcher, Changes) and not can_notice(learner, learner.watcher.prior):
            learner.watcher = None
