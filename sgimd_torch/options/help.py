"""Help texts of ``sgimd run``, from the signatures and docstrings of the parts."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from typing import Any, Final

from sgimd_torch.options.catalogue import WORDS, about
from sgimd_torch.options.config import FLAGS, RUN, Config, Part, as_text, dashed
from sgimd_torch.options.signature import Option, help_of, wanted

_PARTS: Final = [kind for kind in WORDS if kind not in ("algorithm", "command")]
_PLACES: Final = {"progress": "goals.progress", "choose": "teacher.choose"}  # options that choose parts of other parts
_WIDTH: Final = 120


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
        "Parts have options, too, such as --goals.window 12; to see them: sgimd run --goals interest-map --help",
    ]
    return "\n".join(lines)


def help_on(parts: Mapping[str, Part]) -> str:
    """Text of ``sgimd run --goals uniform --help``: options of the chosen parts."""
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
    for name, option in options.items():
        said = described.get(name.rpartition(".")[2], "").replace("``", "").replace("None", "null").rstrip(".")
        typed_as = f"{wanted(option.kind).removesuffix(' or null')}; " if option.default is None else ""
        found.append(_line(f"--{dashed(name)}", f"{said} ({typed_as}default: {as_text(option.default)})"))
    return found


def _line(name: str, text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=f"  {name:17} ", subsequent_indent=" " * 20)
