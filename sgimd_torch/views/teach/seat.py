"""Who teaches: one viewer at a time. The others watch, and take over when the seat is free.

seat = Seat(); seat.take(client_id, now)    # True: this viewer may act
"""

from __future__ import annotations

from typing import Final

PATIENCE: Final = 60.0  # s without doing anything, after which someone else may take the seat


class Seat:
    """The teacher's."""

    def __init__(self) -> None:
        self._holder: int | None = None
        self._used = 0.0

    def is_held_by(self, client_id: int) -> bool:
        """Whether this viewer teaches."""
        return self._holder == client_id

    def take(self, client_id: int, now: float) -> bool:
        """Whether this viewer may act at ``now`` (s); they then have the seat."""
        if self._holder not in (None, client_id) and now < self._used + PATIENCE:
            return False
        self._holder, self._used = client_id, now
        return True

    def busy(self, now: float) -> None:
        """Whoever has it is doing something."""
        self._used = now

    def leave(self, client_id: int) -> None:
        """Free the seat, if this viewer has it."""
        if self._holder == client_id:
            self._holder = None
