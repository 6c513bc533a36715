"""Run one learner, evaluate it now and then, and write everything into one folder, such as OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3 --resume              go on after Ctrl-C, or with more --movements
  sgimd run --algorithm sagg-riac --goals uniform --name uniform --movements 2000
  sgimd run --environment mypackage.toss:make                 a run on your own robot
"""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

from sgimd_torch.options.config import Config
from sgimd_torch.runs.signals import Stopping, loading


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; returns 0 when the run has finished, or raises the errors of ``run_one``."""
    argv = sys.argv[1:] if argv is None else argv
    config, resume = parse(argv, __doc__)
    program = ["sgimd"] if Path(sys.argv[0]).name == "sgimd" else [sys.executable, "-m", "sgimd_torch"]
    again = [*program, "run", *argv, *([] if resume else ["--resume"])]
    with loading():
        from sgimd_torch.runs.directory import build_again, record_of, with_found_earlier  # late, so --help is fast
        from sgimd_torch.runs.run import run_one
    parts = build_again(with_found_earlier(config), record_of(config) if resume else None)
    with Stopping() as stopping:
        print(run_one(parts, stopping, resume=resume, again=shlex.join(again)))
    return 0


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, bool]:
    """The run that a command line describes, and whether to resume it.

    Raises:
        ValueError: a word belongs to no option, or a value is wrong.
        SystemExit: code 0, after ``--help``.
    """
    try:
        texts, flags = _read(argv)
        if "help" in flags:
            from sgimd_torch.options.help import help_on, overview  # runs need no help

            print(help_on(texts) if texts else overview(description))
            raise SystemExit(0)
        return Config.from_settings(texts), "resume" in flags
    except ValueError as error:
        raise ValueError(f"{error}\n--help explains all options") from error


def _read(argv: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """The text of each option by its name, and the flags.

    Raises:
        ValueError: a word belongs to no option, or an option has no value.
    """
    texts, flags, waiting = dict[str, str](), set[str](), [*argv]
    while waiting:
        word, equals, text = waiting.pop(0).partition("=")
        name = word.removeprefix("--").replace("-", "_")
        if word in ("-h", "--help", "--resume") and not equals:
            flags.add("resume" if word == "--resume" else "help")
        elif not word.startswith("--"):
            what = "an option begins with -- and takes one value, a flag such as --resume none"
            raise ValueError(f"{word!r} belongs to no option; {what}")
        elif word in ("--help", "--resume"):
            raise ValueError(f"{word} takes no value, got {text!r}")
        elif equals:
            texts[name] = text
        elif waiting and not waiting[0].startswith("--"):
            texts[name] = waiting.pop(0)
        else:
            raise ValueError(f"{word} needs a value")
    return texts, flags
