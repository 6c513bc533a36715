"""What all commands share: exit codes, errors in one line, standard streams that may be closed, a parser.

    sys.exit(command(main))    # main(argv) returns the exit code; an exception becomes one line and an exit code

Exit codes: 0 done, 1 failed while running, 2 the request is wrong, 130 stopped by Ctrl-C, 143 stopped by SIGTERM.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final, TextIO

from sgimd_torch.runs.messages import say
from sgimd_torch.runs.signals import Stopped, stopping_at_once
from sgimd_torch.texts import COUNT, NUMBER, NUMBERS, Values

ONE_THREAD: Final = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment of a process for small matrices, for which several threads would be slower."""


class Failed(RuntimeError):
    """A correct request failed while running: exit code 1."""


def command(main: Callable[[Sequence[str]], int], argv: Sequence[str] | None = None) -> int:
    """Run ``main`` with the arguments of the command line; handle signals, exceptions and closed standard streams.

    Returns:
        The exit code. It is 2, a wrong request, after a ``ValueError``, an error of a file or a missing package.
    """
    sys.stdout, sys.stderr = sys.stdout or _sink(), sys.stderr or _sink()  # a closed stream is None
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # the locale may lack signs of a name
    code = 0
    with stopping_at_once():
        try:
            try:
                code = main(sys.argv[1:] if argv is None else argv)
            except SystemExit as end:  # of argparse, after --help or a wrong option
                code = int(end.code or 0)
            sys.stdout.flush()
        except KeyboardInterrupt as stop:
            code = stop.exit_code if isinstance(stop, Stopped) else 130
        except Failed as error:
            say(f"error: {error}")
            code = 1
        except (ValueError, ImportError) as error:
            say(f"error: {error}")
            code = 2
        except BrokenPipeError:  # a reader such as head has seen enough
            pass
        except OSError as error:
            code, why = 2, str(error)  # an error of this library has a complete message
            if error.filename is not None:
                name = str(error.filename)  # with control characters or lone surrogates, it is shown as Python does
                why = f"{name if name.isprintable() else repr(name)} cannot be read or written: {error.strerror}"
            elif error.errno is not None:
                code, why = 1, f"not everything could be written: {error.strerror}"
            say(f"error: {why}")
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())  # the interpreter would complain at exit
    return code


def parser_of(name: str, about: str | None, **more: Any) -> argparse.ArgumentParser:
    """A parser for the options of ``sgimd name``. Its help shows the text ``about`` with its line ends.

    Numbers, of ``type=int``, ``float`` or ``"numbers"`` with commas between, are read like those of ``sgimd run``.
    """
    form = argparse.RawDescriptionHelpFormatter
    made = argparse.ArgumentParser(f"sgimd {name}", description=about, formatter_class=form, allow_abbrev=False, **more)
    for kind, values in {int: COUNT, float: NUMBER, "numbers": NUMBERS}.items():
        made.register("type", kind, partial(argument, values))
    return made


def argument(values: Values, text: str) -> Any:
    """The value that a word of the command line stands for.

    Raises:
        ArgumentTypeError: it stands for none.
    """
    try:
        return values.of(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _sink() -> TextIO:
    return os.fdopen(os.open(os.devnull, os.O_WRONLY), "w")
