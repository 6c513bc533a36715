"""The option ``--context previous`` of a run, and a remark where it would help."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from sgimd_torch.runs.hooks import Hook, Listener

if TYPE_CHECKING:
    from sgimd_torch.environments.protocol import Environment
    from sgimd_torch.runs.plan import Plan
    from sgimd_torch.runs.run import RunLoop
    from sgimd_torch.spaces import Episode

LOOKED_BACK: Final = (50, 100, 200)  # numbers of movements at which to test whether the robot has a memory


class Previous(Hook):
    """The movement before.

    Args:
        context: previous: theta of the movement before, for robots with memory; null: no theta.
    """

    def __init__(self, *, context: str | None = None) -> None:
        if context not in (None, "previous"):
            raise ValueError(f"context must be previous or null, got {context}; is it an option of sgimd ask?")
        self.context = context

    def wrapped(self, environment: Environment) -> Environment:
        """The robot with the theta of the movement before as context."""
        if self.context is None:
            return environment
        from sgimd_torch.extras.previous.with_previous import with_previous  # few robots have a memory

        return with_previous(environment)

    def given(self, plan: Plan) -> Mapping[str, Any]:
        """Nothing; it refuses a taught learner."""
        if self.context and plan.config.teaching:
            raise ValueError("context previous: the movement before a demonstration is not known; use no teacher")
        return {}

    def listener(self, loop: RunLoop) -> Listener | None:
        """A listener that looks whether the robot has a memory; robots that move at once have several."""
        learner = loop.parts.learner
        looks = self.context is None and loop.parts.robots == 1 and learner.inverse.says_how_sure
        return LookingBack(loop) if looks else None


class LookingBack(Listener):
    """Tests now and then whether outcomes depend on the movement before."""

    def __init__(self, loop: RunLoop) -> None:
        self._loop = loop

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Tell once that they do."""
        if replayed or episode.index + 1 not in LOOKED_BACK or self._loop.record.about["remarks"].get("memory"):
            return
        from sgimd_torch.extras.previous.carried_over import error_knowing_previous  # short runs do not need it

        with self._loop.seconds.of("learner"):
            share = error_knowing_previous(self._loop.parts.learner)
        if share is not None:
            gain = f"which would explain {1 - share:.0%} of the error of predictions"
            advice = "give it as context (--context previous), or return to the same state before each movement"
            self._loop.remark("memory", {"memory": f"outcomes depend on the movement before, {gain}: {advice}"})
