"""The option ``--teachers`` of a run whose learner asks teachers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from sgimd_torch.options.catalogue import load_word
from sgimd_torch.options.config import check_names
from sgimd_torch.runs.hooks import Hook

if TYPE_CHECKING:
    from sgimd_torch.runs.plan import Plan


class Asked(Hook):
    """Teachers who are asked.

    Args:
        teachers: names of teachers to ask; null: one with all demonstrations.
    """

    def __init__(self, *, teachers: tuple[str, ...] | None = None) -> None:
        self.teachers = teachers
        if teachers is not None:
            check_names("teachers", teachers)

    def given(self, plan: Plan) -> Mapping[str, Any]:
        """The teachers by name, for an algorithm that asks."""
        if plan.config.teaching != "teachers":
            if self.teachers is not None:
                raise ValueError(f"--teachers: algorithm {plan.config.algorithm} asks no teachers")
            return {}
        from sgimd_torch.parts import Demonstrator
        from sgimd_torch.spaces import stream

        made = dict[str, Demonstrator]()
        for word in self.teachers or ("all",):
            made[word] = Demonstrator.of(
                load_word("teachers", word), plan.demonstrations, stream(plan.config.seed, f"teacher {word}")
            )
        return {"teachers": made}
