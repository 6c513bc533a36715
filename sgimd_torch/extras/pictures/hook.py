"""Pictures on the board of a run, with ``--board true``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sgimd_torch.board import board_of
from sgimd_torch.runs.hooks import Hook, Listener
from sgimd_torch.runs.messages import say

if TYPE_CHECKING:
    from sgimd_torch.board.listener import BoardListener
    from sgimd_torch.evaluation import Evaluation
    from sgimd_torch.runs.run import RunLoop


class Pictures(Hook):
    """Pictures on the board."""

    def listener(self, loop: RunLoop) -> Listener | None:
        """A listener that draws them, if the run has a board."""
        board = board_of(loop)
        return None if board is None else Drawing(loop, board)


class Drawing(Listener):
    """Draws maps of T. They take as long as 100 movements, so they are drawn only when there were eight times as many
    movements as at the last ones, and at the end."""

    def __init__(self, loop: RunLoop, board: BoardListener) -> None:
        self._parts, self._board, self._drawn_at = loop.parts, board, 0

    def evaluated(self, movements: int, evaluations: Mapping[str, Evaluation]) -> None:
        """Draw the errors of an evaluation, and the regions of the goal model; a run goes on without a picture."""
        if movements < 8 * self._drawn_at and movements != self._parts.config.movements:
            return
        self._drawn_at, robot = movements, self._parts.environment
        goals, errors = self._parts.benchmark.goals, evaluations["own"].errors
        shown, regions = self._board.behaviour.shown, self._parts.learner.regions
        try:
            from sgimd_torch.extras.pictures.pictures import maps_of

            self._board.show_pictures(maps_of(regions, robot.outcomes, robot.contexts, goals, errors, shown))
        except Exception as error:  # a font, a backend, a disk
            from sgimd_torch.environments.protocol import reason_of

            say(f"the board has no pictures after {movements} movements: {reason_of(error)}")
