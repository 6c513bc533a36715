"""The web server of the page, on this machine only, and who of its viewers teaches.

with serving(8080) as server: print(server.get_port())
    seat = Seat(); seat.take(client_id, now)    # True: this viewer may act
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator
from typing import Final

import viser

PATIENCE: Final = 60.0  # s without doing anything, after which someone else may take the seat


@contextlib.contextmanager
def serving(port: int) -> Iterator[viser.ViserServer]:
    """A server on 127.0.0.1, at the first free port from ``port`` on: viser looks for it."""
    with contextlib.redirect_stdout(io.StringIO()):  # a banner, and where it listens
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


class Seat:
    """The teacher's: one viewer has it at a time, the others watch, and take over when it is free."""

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
