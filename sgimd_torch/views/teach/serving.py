"""The web server of the page: on this machine only, and silent.

with serving(8080) as server: print(server.get_port())
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterator

import viser

from sgimd_torch.views.watch import free_port


@contextlib.contextmanager
def serving(port: int) -> Iterator[viser.ViserServer]:
    """A server on 127.0.0.1, at the first free port from ``port`` on.

    Raises:
        ValueError: no such port, or none is free.
    """
    with contextlib.redirect_stdout(io.StringIO()):  # a banner, and where it listens
        server = viser.ViserServer(host="127.0.0.1", port=free_port(port), verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()
