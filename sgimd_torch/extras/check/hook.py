"""Remarks of a run on its robot."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from sgimd_torch.runs.hooks import Hook, Listener

if TYPE_CHECKING:
    from sgimd_torch.runs.run import RunLoop
    from sgimd_torch.spaces import Episode

EVERY: Final = 50  # number of movements between two looks at the outcomes


class Remarks(Hook):
    """Remarks of a run on its robot."""

    def listener(self, loop: RunLoop) -> Listener:
        """A listener that looks at the outcomes."""
        return Looking(loop)


class Looking(Listener):
    """Looks at the outcomes every 50 movements."""

    def __init__(self, loop: RunLoop) -> None:
        self._loop = loop

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Tell what the outcomes so far tell of the robot."""
        if replayed or (episode.index + 1) % EVERY:
            return
        from sgimd_torch.extras.check.remarks import remarks_on  # a short run looks at nothing

        learner = self._loop.parts.learner
        self._loop.remark(
            "outcomes", remarks_on(self._loop.parts.environment, learner.memory.outcomes[learner.begun :])
        )
