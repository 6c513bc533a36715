"""Run one learner, evaluate it now and then, and write everything into one folder, such as OUT/NAME/seed-003.

Examples:
  sgimd run --algorithm sgim-d --seed 3
  sgimd run --algorithm sgim-d --seed 3 --resume              go on after Ctrl-C, or with more --movements
  sgimd run --algorithm sagg-riac --goals grid --goals.window 12 --name grid --movements 2000
  sgimd run --environment mypackage.toss:make                 a run on your own robot
"""

from __future__ import annotations

import shlex
import sys
import textwrap
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from sgimd_torch.catalogue import WORDS, about
from sgimd_torch.catalogue.options import Option, help_of
from sgimd_torch.runs.config import FLAGS, RUN, Config, Part, chosen, dashed, typed
from sgimd_torch.runs.process import Stopping, loading

_PARTS: Final = [kind for kind in WORDS if kind not in ("algorithm", "command")]
_PLACES: Final = {"progress": "goals.progress", "choose": "teacher.choose"}  # options that choose parts of other parts
_WIDTH: Final = 120
_NAMES: Final[dict[Any, str]] = {  # of types, in help and in errors
    float: "a number",
    int: "a whole number",
    str: "text",
    bool: "true or false",
    Path: "a path",
    types.NoneType: "null",
    tuple[float, float]: "two numbers with a comma between",
    tuple[int, ...]: "whole numbers with commas",
    tuple[str, ...]: "names with commas",
}


def main(argv: Sequence[str] | None = None) -> int:
    """The command ``sgimd run``; returns 0 when the run has finished, or raises the errors of ``carry_out``."""
    argv = sys.argv[1:] if argv is None else argv
    config, flags = parse(argv, __doc__)
    program = ["sgimd"] if Path(sys.argv[0]).name == "sgimd" else [sys.executable, "-m", "sgimd_torch"]
    again = [*program, "run", *argv, *([] if flags["resume"] else ["--resume"])]
    with loading():
        from sgimd_torch.runs.build import build  # imported here so that --help is fast
        from sgimd_torch.runs.run import carry_out
    parts = build(config)
    with Stopping() as stopping:
        print(carry_out(parts, stopping, **flags, again=shlex.join(again)))
    return 0


def parse(argv: Sequence[str], description: str | None = None) -> tuple[Config, dict[str, bool]]:
    """The run that a command line describes, and its flags.

    The chosen parts are read first, because they determine which options there are.

    Raises:
        SystemExit: code 2, with a message on stderr, for a wrong command line; code 0 after ``--help``.
    """
    try:
        given, asked = _read(argv)
        if "help" in asked and not given:
            print(overview(description))
            raise SystemExit(0)
        parts = chosen({"algorithm": Config.algorithm, **given})
        if "help" in asked:
            print(help_on(parts))
            raise SystemExit(0)
        options = RUN | {name: each for part in parts.values() for name, each in part.options.items()}
        values = {name: _typed(name, text, options) for name, text in given.items()}
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


def _typed(name: str, text: str, options: Mapping[str, Option]) -> Any:
    """A typed value, converted to the type of its option; names of parts and values of unknown options stay text.

    Raises:
        ValueError: the value is of another type.
    """
    try:
        return _value(text, options[name].kind) if name in options else text
    except ValueError as error:
        raise ValueError(f"--{dashed(name)} must be {_wanted(options[name].kind)}, got {text}") from error


def _value(text: str, kind: Any) -> Any:
    """``text`` as a value of type ``kind``; a list may be typed with brackets or without.

    Raises:
        ValueError: the text is of another type.
    """
    inner = typing.get_args(kind)
    if typing.get_origin(kind) is tuple:
        items = [item.strip() for item in text.removeprefix("[").removesuffix("]").split(",") if item]
        kinds = [inner[0]] * len(items) if ... in inner else inner
        return tuple(_value(*each) for each in zip(items, kinds, strict=True))
    if inner:  # a union, with None last
        if text == "null" and types.NoneType in inner:
            return None
        return _value(text, inner[0])
    if kind is bool:
        return bool(("false", "true").index(text))
    if not text:
        raise ValueError("nothing was typed")
    return kind(text)


def _wanted(kind: Any) -> str:
    """Name of a type, for somebody who types a value of this type."""
    return _NAMES[kind] if kind in _NAMES else " or ".join(map(_wanted, typing.get_args(kind)))


def overview(description: str | None) -> str:
    """Text of ``sgimd run --help``: options and flags of every run, and names of parts."""
    rivals = [word for word, at in WORDS["algorithm"].items() if at.startswith("rivals.")]
    lines = [
        "usage: sgimd run [--OPTION VALUE ...] [--resume]",
        "",
        *(description or "").splitlines(),
        "",
        "options of every run:",
        *_described(RUN, Config),
        *(_line(f"--{dashed(flag)}", text) for flag, text in FLAGS.items()),
        "names for --algorithm:",
        *(_line(word, about("algorithm", word)) for word in WORDS["algorithm"] if word not in rivals),
        _line("for comparison", f"{', '.join(rivals)}; these need the extra rivals"),
        "names for the parts of a run; for a part of your own, type package.module:attribute:",
        *(_line(f"--{_PLACES.get(kind, kind)}", ", ".join(words)) for kind, words in WORDS.items() if kind in _PARTS),
        "",
        "Parts have options, too, such as --goals.window 12. To see them, name the algorithm or a part before --help:",
        "sgimd run --goals interest-map --help",
    ]
    return "\n".join(lines)


def help_on(parts: Mapping[str, Part]) -> str:
    """Text of ``sgimd run --goals grid --help``: options of the chosen parts."""
    lines = [
        "This screen has the options of the chosen parts; "
        "sgimd run --help has the options of every run, such as --seed.",
        "usage: sgimd run [--OPTION VALUE ...] [--resume]",
        "C: contexts, which the robot sees and cannot choose. Pi: movement parameters, theta.",
        "T: outcomes; a goal is a point of T. The paper: Nguyen & Oudeyer (2014).",
    ]
    for name, part in parts.items():
        what = [about(part.kind, part.word)] if part.word in WORDS[part.kind] else []
        leads_to = [f"--{each}={parts[each].word}" for each in part.choices]
        what += [f"default or chosen parts, each of which can be replaced: {' '.join(leads_to)}"] if leads_to else []
        lines += ["", textwrap.fill(f"--{name or part.kind} {part.word}: {'; '.join(what)}", _WIDTH)]
        lines += _described(part.options, part.make)
    return "\n".join(lines)


def _described(options: Mapping[str, Option], make: Callable[..., Any]) -> list[str]:
    """Lines of help on ``options``, which are keywords of ``make``; a default tells the type, unless it is null."""
    found, described = [], help_of(make)
    for name, (kind, default) in options.items():
        said = described.get(name.rpartition(".")[2], "").replace("``", "").replace("None", "null").rstrip(".")
        wanted = f"{_wanted(kind).removesuffix(' or null')}; " if default is None else ""
        found.append(_line(f"--{dashed(name)}", f"{said} ({wanted}default: {typed(default)})"))
    return found


def _line(name: str, text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=f"  {name:17} ", subsequent_indent=" " * 20)
