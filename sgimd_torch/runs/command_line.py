"""Run one learner, evaluate it now and then, and write everything to one run directory, OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3
  sgimd run --algorithm sgim-d --seed 3 --resume              after Ctrl-C, or with more --movements
  sgimd run --algorithm sagg-riac --goals grid --goals.window 12 --name grid --movements 2000
  sgimd run --environment mypackage.toss:make                 on a robot of your own
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import sys
import textwrap
import typing
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, Final, NoReturn, get_type_hints

import jsonargparse

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.catalogue.options import help_of
from sgimd_torch.runs.chosen import ALGORITHM, Part, chosen, refused, standards
from sgimd_torch.runs.config import RUN, Config, dashed, plain
from sgimd_torch.runs.process import Stopping, loading

FLAGS: Final = {
    "resume": "go on with a stopped or killed run, or lengthen a finished one.",
    "accept_loss": "with --resume: go on even if the log has lost movements; a copy of it is kept.",
}
ALONE: Final = "practice"  # the default learner of a robot without demonstrations
_WANTED: Final = {int: "a whole number", float: "a number", bool: "true or false", str: "a word", Path: "a path"}
_MANY: Final = {int: "whole numbers such as 250,500", float: "numbers such as .1,.2", str: "words such as own,nearest"}
_WIDTH: Final = 120


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; 0 when the run has finished. It raises what ``carry_out`` raises."""
    argv = sys.argv[1:] if argv is None else argv
    config, flags = parse(argv, __doc__)
    typed = [Path(sys.argv[0]).name] if Path(sys.argv[0]).name == "sgimd" else [sys.executable, "-m", "sgimd_torch"]
    again = [*typed, "run", *argv, *([] if flags["resume"] else ["--resume"])]
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

    The choices are read first; they decide which options there are.

    Raises:
        SystemExit: with code 2 and a message on stderr when it makes no sense, 0 after ``--help``.
    """
    try:
        given, asked = _read(argv)
        flags = {flag: flag in asked for flag in FLAGS}
        if "help" in asked and not given:
            print(overview(description))
            raise SystemExit(0)
        algorithm = given.setdefault("algorithm", _suited(given))
        choices = {name: text for name, text in given.items() if name != "teachers"}
        parts = chosen(algorithm, choices)
        for name in given:
            if name not in RUN and name not in standards(parts):
                raise refused(name, parts, (*RUN, *FLAGS))
        reader = parser(parts, description)
        if "help" in asked:
            reader.print_help()
            raise SystemExit(0)
        values = reader.values({name: text for name, text in given.items() if name not in parts})
        own = {name: value for name, value in values.items() if name in RUN}
        others = {name: value for name, value in values.items() if name not in RUN}
        return Config(**own, parts={**{name: given[name] for name in parts if name in given}, **others}), flags
    except ValueError as error:
        print(f"error: {error}\n--help explains all options", file=sys.stderr)
        raise SystemExit(2) from None


def _suited(given: Mapping[str, str]) -> str:
    """The default learner for a robot: one that is taught if there are demonstrations, else one that learns alone."""
    robot = {name: text for name, text in given.items() if name.partition(".")[0] == "environment"}
    if not robot or "demonstrations" in given:
        return Config.algorithm
    with loading():
        from sgimd_torch.runs.build import has_demonstrations
    parts = chosen(ALONE, robot)
    options = {name: text for name, text in robot.items() if name in standards(parts)}
    values = parser(parts).values({name: text for name, text in options.items() if name not in parts})
    config = Config(ALONE, parts={**{name: text for name, text in options.items() if name in parts}, **values})
    return Config.algorithm if has_demonstrations(config) else ALONE


def parser(parts: Mapping[str, Part] | None = None, description: str | None = None) -> _Parser:
    """The options that every run has, and those of these parts."""
    found = _Parser(prog="sgimd run", usage="%(prog)s [--OPTION VALUE ...] [--resume]", description=description)
    hints, about = get_type_hints(Config), help_of(Config)
    group = found.add_argument_group("The run")
    for each in fields(Config):
        if each.name in RUN:
            found.take(group, each.name, hints[each.name], each.default, about[each.name])
    for flag, text in FLAGS.items():
        group.add_argument(f"--{dashed(flag)}", action="store_true", help=text)
    for part in (parts or {}).values():
        about = help_of(part.make)
        named = part.kind if part.name == ALGORITHM else part.name
        group = found.add_argument_group(f"--{named} {part.word}", _choices(part, parts or {}))
        for name, option in part.options.items():
            found.take(group, name, option.kind, option.default, about.get(name.rpartition(".")[2], ""))
    return found


def overview(description: str | None = None) -> str:
    """What ``sgimd run --help`` prints: the options of every run, and the words for its parts."""
    about = help_of(Config)
    shown = {name: _shown(getattr(Config, name)) for name in RUN}
    run = {name: about[name] + f" ({text})" * (text != "null") for name, text in shown.items()} | FLAGS
    algorithms = {word: entry.about for word, entry in CATALOGUE["algorithm"].items() if "rivals" not in entry.about}
    rivals = [word for word in CATALOGUE["algorithm"] if word not in algorithms]
    kinds = {kind: ", ".join(words) for kind, words in CATALOGUE.items() if kind != "algorithm"}
    lines = [
        "usage: sgimd run [--OPTION VALUE ...] [--resume]",
        "",
        *(description or "").splitlines(),
        "the run, with defaults (null, for no value, where there is none):",
        *(_line(f"--{dashed(name)}", text) for name, text in run.items()),
        "algorithms (--algorithm):",
        *(_line(word, text) for word, text in algorithms.items()),
        _line("extra rivals", ", ".join(rivals)),
        "parts, each a word of these or package.module:attribute, one of your own:",
        *(_line(f"--{_PLACES.get(kind, kind)}", words) for kind, words in kinds.items()),
        "",
        "Parts have options of their own: sgimd run --goals interest-map --help shows those of the parts that are",
        "chosen, such as --goals.window 12.",
    ]
    return "\n".join(lines)


_PLACES: Final = {"progress": "goals.progress", "choose": "teacher.choose"}  # of kinds that another part chooses


def _line(name: str, text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=f"  {name:17} ", subsequent_indent=" " * 20)


def _choices(part: Part, parts: Mapping[str, Part]) -> str:
    """What a part is, and which words could stand for it and for the parts that it leads to."""
    words = CATALOGUE.get(part.kind, {})
    about = words[part.word].about if part.word in words else "of your own" if ":" in part.word else ""
    found = [f"--{part.full(each)}={parts[part.full(each)].word}" for each in part.choices]
    return f"{about}{'; its parts: ' if found else ''}{' '.join(found)}"


def _read(argv: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """The values that were typed, by the names of their options, and the flags.

    Raises:
        ValueError: a word belongs to no option, or an option has no value.
    """
    given, asked, waiting = dict[str, str](), set[str](), list(reversed(argv))
    while waiting:
        typed, equals, value = waiting.pop().partition("=")
        name = typed.removeprefix("--").replace("-", "_")
        if typed in ("-h", "--help"):
            asked.add("help")
        elif not typed.startswith("--"):
            flags = f"; --{', --'.join(map(dashed, FLAGS))} take none"
            raise ValueError(f"{typed!r} belongs to no option; an option begins with -- and takes one value{flags}")
        elif name in FLAGS:
            if equals:
                raise ValueError(f"{typed} takes no value, got {value!r}")
            asked.add(name)
        elif equals:
            given[name] = value
        elif waiting and not waiting[-1].startswith("--"):
            given[name] = waiting.pop()
        else:
            raise ValueError(f"{typed} needs a value")
    return given, asked


class _Parser(jsonargparse.ArgumentParser):
    """Reads values by the types of their options, and says in one line what was wanted."""

    def __init__(self, **arguments: Any) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **arguments)
        self._kinds: dict[str, Any] = {}
        self._given: Mapping[str, str] = {}

    def take(self, group: Any, name: str, kind: Any, default: Any, about: str) -> None:
        """Add an option to a group."""
        self._kinds[name] = kind
        text = f"{about} ({_wanted(kind)}; default: {_shown(default)})".replace("%", "%%")
        group.add_argument(f"--{dashed(name)}", type=kind, default=default, metavar="X", help=text)

    def values(self, given: Mapping[str, str]) -> dict[str, Any]:
        """What was typed, as values of their types.

        Raises:
            ValueError: one is of another type.
        """
        self._given = given
        known = vars(
            self.parse_args([f"--{dashed(name)}={self._listed(name, text)}" for name, text in given.items()]).as_flat()
        )
        return {name: known[name] for name in given}

    def error(self, message: str, ex: Exception | None = None) -> NoReturn:
        key = re.search(r'key "([\w.]+)"', message)
        if key is None or key[1] not in self._given:
            raise ValueError(message)
        raise ValueError(f"--{dashed(key[1])} must be {_wanted(self._kinds[key[1]])}, got {self._given[key[1]]}")

    def _listed(self, name: str, text: str) -> str:
        """A list may be typed without brackets."""
        if not text and "Path" in str(self._kinds[name]):
            raise ValueError(f"--{dashed(name)} must be a path, got an empty one")
        is_list = "tuple" in str(self._kinds[name]) and text != "null" and not text.startswith("[")
        return f"[{text}]" if is_list else text


def _wanted(kind: Any) -> str:
    """A type in words."""
    parts = typing.get_args(kind)
    if typing.get_origin(kind) is tuple:
        many = _MANY.get(parts[0], "values")
        return f"{many}, or []" if ... in parts else f"{len(parts)} {many}"
    if parts:  # of a union
        return " or ".join("null" if each is type(None) else _wanted(each) for each in parts)
    return _WANTED.get(kind, "a value")


def _shown(default: Any) -> str:
    """A default, as one types it."""
    return str(default) if isinstance(default, str | Path) else json.dumps(plain(default))
