"""Teach a learner by hand, in a browser.

Lead the arm, show your movement to the learner, and see what the learner can do then. Only this machine can open the
page.

Examples:
  sgimd teach                                           a new learner on the fishing rod, into runs/taught/seed-000
  sgimd teach runs/taught/seed-000                      continue an earlier run, even one without lessons
  sgimd teach --environment planar-arm-7 --seed 3       a new learner, with options of sgimd run
"""

from __future__ import annotations

import argparse
import contextlib
import io
import secrets
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Final

from sgimd_torch.extras.teach.by_hand import BY_HAND
from sgimd_torch.options.config import Config
from sgimd_torch.options.parse import parse
from sgimd_torch.record import ReplayError
from sgimd_torch.runs.directory import with_found_earlier
from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import Failed, parser_of
from sgimd_torch.runs.read import config_of, read_run
from sgimd_torch.runs.signals import loading
from sgimd_torch.session import NoOutcomeError

if TYPE_CHECKING:
    from viser import ViserServer

NAME: Final = "taught"  # name of a new run
LEARNER: Final = "practice-taught"  # its algorithm, unless another one is chosen
WHERE: Final = """
Teach it here:  http://127.0.0.1:{port}/?token={token}   (Ctrl-C ends the session; {path} keeps everything)
From another machine:  ssh -L {port}:127.0.0.1:{port} THIS-MACHINE   and open the address above on that machine.
"""


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd teach``; it serves the page until Ctrl-C.

    Raises:
        ValueError: the request is wrong, or the robot cannot be led by the hand.
    """
    config, port = options_of(sys.argv[1:] if argv is None else argv)
    token = secrets.token_urlsafe(16)
    with loading():
        from sgimd_torch.extras.teach.page import Page
        from sgimd_torch.extras.teach.taught import TaughtRun
    taught = TaughtRun(config)
    with serving(port, token) as server:
        page = Page(server, taught)
        print(WHERE.format(port=server.get_port(), token=token, path=config.directory), flush=True)
        try:
            page.run()
        except (NoOutcomeError, ReplayError) as error:
            raise Failed(str(error)) from error
        except KeyboardInterrupt:
            say(f"everything is kept; to go on: sgimd teach {config.directory}")
            raise
    return 0


@contextlib.contextmanager
def serving(port: int, token: str) -> Iterator[ViserServer]:
    """A web server on 127.0.0.1, at the first free port from ``port`` on; it answers only requests with the ``token``.

    Raises:
        ValueError: ``port`` is no port number, or no port from ``port`` on is free.
    """
    import viser  # slow to load, and an optional dependency

    from sgimd_torch.extras.teach.guard import guarded

    with contextlib.redirect_stdout(io.StringIO()), guarded(token):  # viser prints a banner
        server = viser.ViserServer(host="127.0.0.1", port=port, verbose=False)
    try:
        yield server
    finally:
        with contextlib.redirect_stdout(io.StringIO()):
            server.stop()


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd teach``."""
    parser = parser_of("teach", __doc__, usage="sgimd teach [RUN | options of sgimd run] [--port N]")
    parser.add_argument("--port", type=int, default=8080, help="first port to try (default: 8080)")
    parser.add_argument("--trust", action="store_true", help="execute the user's code that the settings of RUN name")
    return parser


def options_of(argv: Sequence[str]) -> tuple[Config, int]:
    """The settings of the taught run, and the first port to try."""
    options, words = parser().parse_known_args(argv)
    if words and not words[0].startswith("-"):
        path = Path(words[0])
        config = config_of(read_run(path), trust=options.trust)
        if len(words) > 1:
            parser().error(f"{path} has its own options; {' '.join(words[1:])} cannot change them")
        config = replace(config, out=path.parent.parent, name=path.parent.name)
        if config.directory.resolve() != path.resolve():
            raise ValueError(f"{path} must be called {config.directory.name}, as sgimd run calls it; was it renamed?")
        return config, options.port
    words = [f"--name={NAME}", f"--algorithm={LEARNER}", "--repeats=0", *words]
    config, _ = parse(words)
    if "teacher" in config.values:
        config, _ = parse([f"--teacher={BY_HAND}", *words])
    return with_found_earlier(config), options.port
