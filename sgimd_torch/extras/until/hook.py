"""The option ``--until`` of a run."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, ClassVar

from sgimd_torch.runs.hooks import Hook, Listener

if TYPE_CHECKING:
    from sgimd_torch.runs.run import RunLoop
    from sgimd_torch.runs.run_parts import RunParts


class Until(Hook):
    """An early end.

    Args:
        until: mean error (unit of T) that ends the run once it is expected; null: none.
    """

    may_change: ClassVar = ("until",)

    def __init__(self, *, until: float | None = None) -> None:
        if until is not None and not 0 < until < math.inf:
            raise ValueError(f"until must be an error above 0, in the unit of T, got {until}")
        self.until = until

    def built(self, parts: RunParts) -> None:
        """Refuse an inverse model that does not say how sure it is."""
        if self.until is not None and not parts.learner.inverse.says_how_sure:
            name = type(parts.learner.inverse).__name__
            raise ValueError(
                f"--until needs an inverse model that says how sure it is, such as process; {name} does not"
            )

    def listener(self, loop: RunLoop) -> Listener | None:
        """A listener that ends the run."""
        if self.until is None:
            return None
        from sgimd_torch.extras.until.until import Ending  # few runs end early

        return Ending(loop, self.until)
