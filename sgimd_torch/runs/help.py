"""What ``sgimd run`` says of its options."""

from __future__ import annotations

import textwrap
import types
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.catalogue.options import help_of
from sgimd_torch.runs.chosen import Part
from sgimd_torch.runs.config import RUN, Config, dashed, typed

_PLACES: Final = {"progress": "goals.progress", "choose": "teacher.choose"}  # of kinds that another part chooses
_WANTED: Final = {int: "a whole number", float: "a number", bool: "true or false", str: "a word", Path: "a path"}
_MANY: Final = {int: "whole numbers such as 250,500", float: "numbers such as .1,.2", str: "words such as own,nearest"}
_WIDTH: Final = 120


def overview(description: str | None, flags: Mapping[str, str]) -> str:
    """What ``sgimd run --help`` prints: the options of every run, its flags, and the words for its parts."""
    about = help_of(Config)
    shown = {name: typed(getattr(Config, name)) for name in RUN}
    run = {name: about[name] + f" ({text})" * (text != "null") for name, text in shown.items()} | {**flags}
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


def help_on(parts: Mapping[str, Part]) -> str:
    """What ``sgimd run --goals grid --help`` prints: the options of the parts that are chosen."""
    lines = ["usage: sgimd run [--OPTION VALUE ...] [--resume]; sgimd run --help shows the options of every run"]
    for part in parts.values():
        words, about = CATALOGUE.get(part.kind, {}), help_of(part.make)
        what = [words[part.word].about] if part.word in words else []
        leads_to = [f"--{part.full(each)}={parts[part.full(each)].word}" for each in part.choices]
        what += [f"its parts: {' '.join(leads_to)}"] if leads_to else []
        lines += ["", textwrap.fill(f"--{part.name or part.kind} {part.word}: {'; '.join(what)}", _WIDTH)]
        for name, option in part.options.items():
            meant = f"{wanted(option.kind)}; default: {typed(option.default)}"
            lines.append(_line(f"--{dashed(part.full(name))}", f"{about.get(name, '')} ({meant})"))
    return "\n".join(lines)


def _line(name: str, text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=f"  {name:17} ", subsequent_indent=" " * 20)


def wanted(kind: Any) -> str:
    """A type in words."""
    inner = typing.get_args(kind)
    if typing.get_origin(kind) is tuple:
        many = _MANY.get(inner[0], "values")
        return f"{many}, or []" if ... in inner else f"{len(inner)} {many}"
    if inner:  # of a union
        return " or ".join("null" if each is types.NoneType else wanted(each) for each in inner)
    return _WANTED.get(kind, "a value")
