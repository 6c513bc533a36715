"""Run one learner, evaluate it now and then, and write everything into one folder, such as OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3 --resume              go on after Ctrl-C, or with more --movements
  sgimd run --algorithm sagg-riac --goals uniform --name uniform --movements 2000
  sgimd run --environment mypackage.toss:make                 a run on your own robot
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from sgimd_torch.options.config import FLAGS, RUN, Config, chosen, dashed
from sgimd_torch.options.signature import Option, parsed, wanted
from sgimd_torch.runs.signals import Stopping, loading


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; returns 0 when the run has finished, or raises the errors of ``run_one``."""
    argv = sys.argv[1:] if argv is None else argv
    config, flags = parse(argv, __doc__)
    program = ["sgimd"] if Path(sys.argv[0]).name == "sgimd" else [sys.executable, "-m", "sgimd_torch"]
    again = [*program, "run", *argv, *([] if flags["resume"] else ["--resume"])]
    with loading():
        from sgimd_torch.options.build import build  # imported here so that --help is fast
        from sgimd_torch.runs.directory import with_found_earlier
        from sgimd_torch.runs.run import run_one
    parts = build(with_found_earlier(config))
    with Stopping() as stopping:
        print(run_one(parts, stopping, **flags, again=shlex.join(again)))
    return 0


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, dict[str, bool]]:
    """The run that a command line describes, and its flags.

    The chosen parts are read first, because they determine which options there are.

    Raises:
        SystemExit: code 2, with a message on stderr, for a wrong command line; code 0 after ``--help``.
    """
    try:
        given, asked = _read(argv)
        choices = {"algorithm": Config.algorithm, **given}
        if "help" in asked:
            from sgimd_torch.options.help import help_on, overview  # imported here, as runs show no help

            print(help_on(chosen(choices)) if given else overview(description))
            raise SystemExit(0)
        options = RUN | {name: each for part in chosen(choices).values() for name, each in part.options.items()}
        values = {name: _value(name, text, options) for name, text in given.items()}
        own = {name: values.pop(name) for name in RUN if name in values}
        return Config(**own, parts=values), {flag: flag in asked for flag in FLAGS}
    except ValueError as error:
        print(f"error: {error}\n--help explains all options", file=sys.stderr)
        raise SystemExit(2) from None


def _read(argv: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """The typed values by option, and the flags.

    Raises:
        ValueError: a word belongs to no option, or an option has no value.
    """
    given, asked, waiting = dict[str, str](), set[str](), list(reversed(argv))
    while waiting:
        word, equals, value = waiting.pop().partition("=")
        name = word.removeprefix("--").replace("-", "_")
        if word in ("-h", "--help"):
            asked.add("help")
        elif not word.startswith("--"):
            flags = f"; --{', --'.join(map(dashed, FLAGS))} take no value"
            raise ValueError(f"{word!r} belongs to no option; an option begins with -- and takes one value{flags}")
        elif name in FLAGS:
            if equals:
                raise ValueError(f"{word} takes no value, got {value!r}")
            asked.add(name)
        elif equals:
            given[name] = value
        elif waiting and not waiting[-1].startswith("--"):
            given[name] = waiting.pop()
        else:
            raise ValueError(f"{word} needs a value")
    return given, asked


def _value(name: str, text: str, options: Mapping[str, Option]) -> Any:
    """A typed value, converted to the type of its option; names of parts and values of unknown options stay text.

    Raises:
        ValueError: the value is of another type.
    """
    try:
        return parsed(text, options[name].kind) if name in options else text
    except ValueError as error:
        raise ValueError(f"--{dashed(name)} must be {wanted(options[name].kind)}, got {text}") from error
