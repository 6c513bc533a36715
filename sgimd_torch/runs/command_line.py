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
from typing import Any, NoReturn

import jsonargparse

from sgimd_torch.runs.config import Config


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, bool]:
    """The run that a command line asks for, and whether to resume it.

    Raises:
        SystemExit: with code 2 and a message on stderr when it makes no sense, 0 after ``--help``.
    """
    parser = _Parser(
        prog="run.py",
        usage="%(prog)s [--OPTION VALUE ...] [--resume]",
        description=description,
        epilog="Dashes work too: --task-space is --task_space. null stands for nothing.",
        formatter_class=_Help,
    )
    parser.add_class_arguments(Config)
    parser.add_argument(
        "--resume", action="store_true", help="Go on with a stopped or killed run, or lengthen a finished one."
    )
    options = {f"--{field.name}" for field in fields(Config)} | {"--resume", "--help"}
    arguments: list[str] = []
    waiting = False  # the word before was an option that takes a value
    for argument in argv:
        typed, equals, value = argument.partition("=")
        if typed.startswith("--"):  # --task-space is --task_space
            name = typed.replace("-", "_").replace("__", "--", 1)
            if name not in options:
                near = difflib.get_close_matches(name, options, 1, 0.7)
                parser.error(f"unknown option {argument}" + (f"; did you mean {near[0]}?" if near else ""))
            arguments.append(name)
            waiting = not equals and name not in ("--resume", "--help")
            if not equals:
                parser.typed[name[2:]] = typed, ""
                continue
            if name in ("--resume", "--help"):
                parser.error(f"{typed} takes no value, got {value!r}")
        elif waiting:
            value, waiting = argument, False
            name, typed = arguments[-1], parser.typed[arguments[-1][2:]][0]
        elif argument == "-h":
            arguments.append(argument)
            continue
        else:
            parser.error(f"{argument!r} belongs to no option; an option begins with -- and takes one value")
        parser.typed[name[2:]] = typed, value
        if not value and name in ("--out", "--benchmark", "--demonstrations"):
            parser.error(f"{typed} must be a path, got an empty one")
        if name in ("--evaluate_at", "--floor_at") and re.fullmatch(r"\d+(,\d+)*", value):
            value = f"[{value}]"
        arguments[-1] = f"{name}={value}"
    values = parser.parse_args(arguments).as_dict()
    resume = values.pop("resume")
    try:
        return Config(**values), resume
    except ValueError as error:
        parser.error(str(error))


class _Help(jsonargparse.DefaultHelpFormatter, argparse.RawDescriptionHelpFormatter):
    """Keeps the lines of the examples; names types for people."""

    def _expand_help(self, action: argparse.Action) -> str:
        text = super()._expand_help(action)
        return text.replace("<class 'Path'>", "path").replace("Path |", "path |").replace(_INTS, "int,int,... | null")


_INTS = "Optional[tuple[int, ...]]"
_WANTED = {"int": "a whole number", "float": "a number", "bool": "true or false"}
_WANTED |= {f"{name} | None": f"{wanted}, or null" for name, wanted in _WANTED.items()}
_WANTED["tuple[int, ...] | None"] = "whole numbers such as 250,500, or [], or null"


class _Parser(jsonargparse.ArgumentParser):
    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.typed: dict[str, tuple[str, str]] = {}  # by field: the option as it was typed, and its value

    def error(self, message: str, ex: Exception | None = None) -> NoReturn:
        key = re.search(r'[Kk]ey "(\w+)"', message)
        if key and key[1] in self.typed:
            kinds = {field.name: str(field.type) for field in fields(Config)}
            typed, value = self.typed[key[1]]
            message = f"{typed} must be {_WANTED.get(kinds[key[1]], 'text')}, got {value}"
        print(f"error: {message}\n--help lists all options", file=sys.stderr)
        raise SystemExit(2)
