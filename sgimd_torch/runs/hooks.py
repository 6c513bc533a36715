"""What a room can do in every run: a hook takes part while the run is built, a listener while it is under way.

class Until(Hook): ...                      # WORDS = "hook  until  until=Until" in the room; its keywords are options
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, runtime_checkable

from sgimd_torch.calls import Built

if TYPE_CHECKING:  # the help on options loads hooks, and shall be fast
    from sgimd_torch.environments.protocol import Environment
    from sgimd_torch.evaluation import Evaluation
    from sgimd_torch.memory import Memory
    from sgimd_torch.record import Row
    from sgimd_torch.runs.plan import Plan
    from sgimd_torch.runs.run import RunLoop
    from sgimd_torch.runs.run_parts import RunParts
    from sgimd_torch.session import Execute
    from sgimd_torch.spaces import Episode


class Hook(Built):
    """A hook of a room; it overrides the methods that it needs. Its keywords are options of every run.

    Attributes:
        may_change: options that may change when a run is resumed, as they do not affect the learner.
        compared: whether runs with other options of this hook are other runs.
        robots: number of robots that move at once.
        needs_episodes: whether a finished run is lived again for its listener.
    """

    may_change: ClassVar[tuple[str, ...]] = ()
    compared: ClassVar[bool] = True
    robots: int = 1
    needs_episodes: bool = False

    def wrapped(self, environment: Environment) -> Environment:
        """The environment that the learner sees."""
        return environment

    def given(self, plan: Plan) -> Mapping[str, Any]:
        """Keywords for the algorithm. ValueError: the hook's options do not fit the run."""
        return {}

    def built(self, parts: RunParts) -> None:
        """The learner was built. ValueError: the hook's options do not fit it."""
        return

    def executing(self, parts: RunParts) -> AbstractContextManager[Execute] | None:
        """The function that executes the movements of the run; None: as usual."""
        return None

    def listener(self, loop: RunLoop) -> Listener | None:
        """A listener in the run ``loop``; None: nobody listens."""
        return None


class Listener(Protocol):
    """Listener of a run; it overrides the methods that it needs.

    A resumed run first tells its listeners everything that is in the record.
    """

    def episode(self, episode: Episode, replayed: bool) -> None:
        """A movement was made, or replayed."""
        return

    def evaluated(self, movements: int, evaluations: Mapping[str, Evaluation]) -> None:
        """The learner was evaluated after ``movements`` movements; ``evaluations`` are by name of the inverse model."""
        return

    def begin(self) -> None:
        """The replay of the record is over; before this call, a listener must not change files."""
        return

    def ends(self) -> str:
        """Why the run ends now, before it has made all movements; "": it goes on. Not asked during a replay."""
        return ""

    def curves(self) -> Mapping[str, float]:
        """New numbers for the board since the last call, by tag."""
        return {}

    def flush(self) -> None:
        """Write everything to the disk that is still in memory."""
        return

    def close(self) -> None:
        """The run has ended, or was stopped."""
        return


@runtime_checkable
class Listening(Protocol):
    """A trained part of a learner that has a listener in a run, and checkpoints."""

    def listener(self, loop: RunLoop) -> Listener:
        """The listener in the run ``loop``."""

    def restore(self, directory: Path, refreshes: Sequence[Row]) -> None:
        """Let the replay of the run in ``directory`` load its checkpoint instead of training, if it was made after one
        of these ``refreshes``, which are rows of the record."""

    def recall(self, directory: Path, refreshes: Sequence[Row], memory: Memory) -> None:
        """Bring the part into its state after the last of these ``refreshes`` of the ``memory``, without a replay."""
