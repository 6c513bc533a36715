"""Curves of a run for TensorBoard: ``sgimd run --board true``, then ``tensorboard --logdir RUNS``."""

from __future__ import annotations

import importlib.util
from typing import TYPE_CHECKING, ClassVar

from sgimd_torch.runs.hooks import Hook, Listener

if TYPE_CHECKING:
    from sgimd_torch.board.listener import BoardListener
    from sgimd_torch.runs.run import RunLoop


class Board(Hook):
    """Curves for TensorBoard.

    Args:
        board: true to write curves and pictures for TensorBoard into the run's folder.
    """

    may_change: ClassVar = ("board",)
    compared: ClassVar = False

    def __init__(self, *, board: bool = False) -> None:
        if board and importlib.util.find_spec("tensorboardX") is None:
            raise ValueError("board true needs tensorboardX, which is not installed; pip install 'sgimd-torch[board]'")
        self.needs_episodes = board

    def listener(self, loop: RunLoop) -> Listener | None:
        """A listener that writes them."""
        if not self.needs_episodes:
            return None
        from sgimd_torch.board.listener import BoardListener  # most runs have no board

        return BoardListener(loop.parts.config.directory, loop.parts, loop.seconds.summary, loop.curves)


def board_of(loop: RunLoop) -> BoardListener | None:
    """The listener that writes the board of a run; None: it has no board."""
    if not loop.parts.config["board"]:
        return None
    from sgimd_torch.board.listener import BoardListener

    (board,) = (listener for listener in loop.listeners if isinstance(listener, BoardListener))
    return board
