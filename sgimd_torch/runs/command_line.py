"""Run one learner, evaluate it now and then, and write everything to one run directory, OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3
  sgimd run --algorithm sgim-d --seed 3 --resume              after Ctrl-C, or with more --movements
  sgimd run --algorithm sagg-riac --goals uniform --name uniform-goals --movements 2000
  sgimd run --environment mypackage.toss:make                 on a robot of your own
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import sys
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import Field, fields
from pathlib import Path
from typing import Any, Final, NoReturn, get_type_hints

import jsonargparse

from sgimd_torch.catalogue import CATALOGUE, did_you_mean
from sgimd_torch.runs.config import Config, dashed, default, options
from sgimd_torch.runs.process import Stopping, loading

FLAGS: Final = {
    "resume": "Go on with a stopped or killed run, or lengthen a finished one.",
    "accept_loss": "With --resume: go on even if the log has lost movements; a copy of it is kept.",
}
_WANTED: Final = {
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "int | None": "a whole number, or null",
    "tuple[int, ...] | None": "whole numbers such as 250,500, or [], or null",
    "tuple[str, ...]": "words such as own,nearest",
}
_BOOL: Final = ("true", "false")


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; 0 when the run has finished. It raises what ``carry_out`` raises."""
    argv = sys.argv[1:] if argv is None else argv
    config, flags = parse(argv, __doc__)
    again = [sys.executable, "-m", "sgimd_torch", "run", *argv, *([] if flags["resume"] else ["--resume"])]
    with loading():
        from sgimd_torch.runs.build import build  # after --help
        from sgimd_torch.runs.run import carry_out
    with Stopping() as stopping:
        with stopping.at_once():
            parts = build(config)
        print(carry_out(parts, stopping, **flags, again=shlex.join(again)))
    return 0


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, dict[str, bool]]:
    """The run that a command line asks for, and its flags.

    Raises:
        SystemExit: with code 2 and a message on stderr when it makes no sense, 0 after ``--help``.
    """
    reader = parser(description)
    values = reader.parse_args(reader.joined(argv)).as_dict()
    flags = {flag: bool(values.pop(flag)) for flag in FLAGS}
    try:
        return Config(**values), flags
    except ValueError as error:
        reader.error(str(error))


def parser(description: str | None = None) -> _Parser:
    """The options of ``sgimd run``."""
    parser = _Parser(
        prog="sgimd run",
        usage="%(prog)s [--OPTION VALUE ...] [--resume]",
        description=description,
        epilog="null means no value. Options may be typed with underscores instead of dashes.",
        formatter_class=_Help,
    )
    hints, groups = get_type_hints(Config), dict[str, Any]()
    for each in fields(Config):
        about = options()[each.name]
        group = groups.get(about.group) or groups.setdefault(about.group, parser.add_argument_group(about.group))
        wanted = _WANTED.get(str(each.type), "")
        text = f"{about.about} ({wanted}{wanted and '; '}default: {_default(each)}){_choices(each.name)}"
        metavar = f"{{{','.join(_BOOL)}}}" if each.type == "bool" else each.name.upper()
        group.add_argument(
            f"--{dashed(each.name)}", type=hints[each.name], default=each.default, metavar=metavar, help=text
        )
    for flag, text in FLAGS.items():
        groups[next(iter(groups))].add_argument(f"--{dashed(flag)}", action="store_true", help=text)
    return parser


def _default(each: Field[Any]) -> str:
    """Of all algorithms, and of those that have one of their own."""
    standard = default(each, "")
    own = {word: entry.own[each.name] for word, entry in CATALOGUE["algorithm"].items() if each.name in entry.own}
    return "; ".join([_typed(standard), *(f"{word}: {_typed(value)}" for word, value in own.items())])


def _typed(value: Any) -> str:
    """A default, as one types it."""
    return str(value) if isinstance(value, str | Path) else json.dumps(value)


def _choices(name: str) -> str:
    """The choices that the catalogue has for an option, one per line."""
    entries = CATALOGUE.get(name, {})
    lines = [f"\n  {word}: {entry.about}" for word, entry in entries.items()]
    return "".join([*lines, "\n  or package.module:attribute, one of your own"]) if lines else ""


class _Help(argparse.RawTextHelpFormatter):
    """Keeps the lines of a text and wraps each by itself."""

    def _split_lines(self, text: str, width: int) -> list[str]:
        lines: list[str] = []
        for line in text.splitlines():
            indent = len(line) - len(line.lstrip())
            lines += textwrap.wrap(line, width, subsequent_indent=" " * (indent and indent + 2))
        return lines


class _Parser(jsonargparse.ArgumentParser):
    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        self.typed: dict[str, tuple[str, str, str]] = {}  # by field: the option as it was typed, its value, its type

    def joined(self, argv: Sequence[str]) -> list[str]:
        """Each option and its value as one word, spelt with dashes; a word that belongs to no option is refused."""
        names = {f"--{dashed(each.name)}": each for each in fields(Config)}
        words: list[str] = []
        for word in argv:
            if words and dashed(words[-1]) in names and not word.startswith("--"):  # the value that it waits for
                words[-1] += f"={word}"
            else:
                words.append(word)
        return [self._spelt(word, names) for word in words]

    def _spelt(self, word: str, names: Mapping[str, Field[Any]]) -> str:
        typed, equals, value = word.partition("=")
        option, flags = dashed(typed), {*(f"--{dashed(flag)}" for flag in FLAGS), "--help"}
        if option in names:
            kind = str(names[option].type)
            self.typed[names[option].name] = typed, value, kind
            if equals and not value and "Path" in kind:
                self.error(f"{typed} must be a path, got an empty one")
            item = r"\d+" if "int" in kind else r"[^\[\],]+"
            if "tuple" in kind and re.fullmatch(f"{item}(,{item})*", value):
                value = f"[{value}]"
            return f"{option}={value}" if equals else option
        if word != "-h" and not typed.startswith("--"):
            self.error(f"{word!r} belongs to no option; an option begins with -- and takes one value")
        if word != "-h" and option not in flags:
            self.error(f"unknown option {word}{did_you_mean(option, {*names, *flags})}")
        if equals:
            self.error(f"{typed} takes no value, got {value!r}")
        return option

    def error(self, message: str, ex: Exception | None = None) -> NoReturn:
        key = re.search(r'[Kk]ey "(\w+)"', message)
        if key and key[1] in self.typed:
            typed, value, kind = self.typed[key[1]]
            message = f"{typed} must be {_WANTED.get(kind, 'text')}, got {value}"
        print(f"error: {message}\n--help lists all options", file=sys.stderr)
        raise SystemExit(2)
