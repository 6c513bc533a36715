"""From a command line to a ``Config``: an option for each of its fields, explained by its docstring, and --resume.

config, resume = parse(["--algorithm", "sagg-riac", "--goals", "uniform", "--resume"])
"""

from __future__ import annotations

import argparse
import difflib
import re
import sys
from collections.abc import Sequence
from dataclasses import fields
from typing import NoReturn

import jsonargparse

from config import Config


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, bool]:
    """The run that a command line asks for, and whether to resume it.

    Raises:
        SystemExit: with code 2 and a message on stderr when it makes no sense, 0 after ``--help``.
    """
    parser = _Parser(
        prog="run.py", usage="%(prog)s [--OPTION VALUE ...] [--resume]", description=description, formatter_class=_Help
    )
    parser.add_class_arguments(Config)
    parser.add_argument(
        "--resume", action="store_true", help="Go on with a stopped or killed run, or lengthen a finished one."
    )
    options = {f"--{field.name}" for field in fields(Config)} | {"--resume", "--help"}
    arguments: list[str] = []
    for argument in argv:
        name, equals, value = argument.partition("=")
        if name.startswith("--"):  # --task-space is --task_space
            name = name.replace("-", "_").replace("__", "--", 1)
            if name not in options:
                near = difflib.get_close_matches(name, options, 1)
                parser.error(f"unknown option {argument}" + (f"; did you mean {near[0]}?" if near else ""))
            argument = name + equals + value
        elif arguments and arguments[-1] == "--evaluate_at" and re.fullmatch(r"\d+(,\d+)*", argument):
            argument = f"[{argument}]"
        arguments.append(argument)
    values = parser.parse_args(arguments).as_dict()
    resume = values.pop("resume")
    try:
        return Config(**values), resume
    except ValueError as error:
        parser.error(str(error))


class _Help(jsonargparse.DefaultHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Keeps the lines of the examples."""


class _Parser(jsonargparse.ArgumentParser):
    def error(self, message: str, ex: Exception | None = None) -> NoReturn:
        print(f"error: {message}\n--help lists all options", file=sys.stderr)
        raise SystemExit(2)
