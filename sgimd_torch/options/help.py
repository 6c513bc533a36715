"""Help texts of ``sgimd run``, from the signatures and docstrings of the parts."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping
from typing import Any, Final

from sgimd_torch.options.catalogue import WORDS, about, load_word
from sgimd_torch.options.config import RUN, Config, chosen, dashed
from sgimd_torch.options.signature import Option, help_of, options_of
from sgimd_torch.rooms import room_of, rooms
from sgimd_torch.texts import as_text

_CHOOSE: Final = {"progress": "goals.progress", "choose": "teacher.choose"}  # options that choose parts of other parts
_ELSEWHERE: Final = (
    "algorithm",
    "command",
    "network",
    "hook",
)  # kinds that have lists of their own, or help on their part
_WIDTH: Final = 120  # signs in a line


def overview(description: str | None) -> str:
    """Text of ``sgimd run --help``: options and flags of every run, and names of parts."""
    installs = {word: getattr(rooms().get(room_of(at)), "INSTALL", "") for word, at in WORDS["algorithm"].items()}
    extras = {extra: [word for word in installs if installs[word] == extra] for extra in installs.values() if extra}
    hooks = [load_word("hook", word) for word in WORDS["hook"]]
    parts = {_CHOOSE.get(kind, kind): words for kind, words in WORDS.items() if kind not in _ELSEWHERE}
    lines = [
        "usage: sgimd run [--OPTION VALUE ...] [--resume]",
        "",
        *(description or "").splitlines(),
        "",
        "options of every run:",
        *_described(RUN, Config),
        *(line for hook in hooks for line in _described(options_of(hook), hook)),
        _line("--resume", "flag: go on with a stopped or killed run, or lengthen a finished one"),
        "names for --algorithm:",
        *(_line(word, about("algorithm", word)) for word in installs if not installs[word]),
        *(_line(f"with [{extra}]", " ".join(words)) for extra, words in extras.items()),
        "names for the parts of a run; for a part of your own, type package.module:attribute:",
        *(_line(f"--{option}", ", ".join(words)) for option, words in parts.items()),
        "Parts have options, too, such as --goals.window 12; to see them: sgimd run --goals interest-map --help",
    ]
    return "\n".join(lines)


def help_on(choices: Mapping[str, str]) -> str:
    """Text of ``sgimd run --goals uniform --help``: options of the chosen parts."""
    parts = chosen({"algorithm": Config.algorithm, **choices})
    lines = [
        "This screen has the options of the chosen parts; "
        "sgimd run --help has the options of every run, such as --seed.",
        "usage: sgimd run [--OPTION VALUE ...] [--resume]",
        "C: contexts, which the robot sees and cannot choose. Pi: movement parameters, theta.",
        "T: outcomes; a goal is a point of T. The paper: Nguyen & Oudeyer (2014).",
    ]
    for name, part in parts.items():
        if part.kind in ("run", "hook"):
            continue
        what = [about(part.kind, part.word)] if part.word in WORDS[part.kind] else []
        leads_to = [f"--{option}={parts[option].word}" for option in part.options if option in parts]
        what += [f"default or chosen parts, each of which can be replaced: {' '.join(leads_to)}"] if leads_to else []
        lines += ["", textwrap.fill(f"--{name} {part.word}: {'; '.join(what)}", _WIDTH)]
        options = {option: value for option, value in part.options.items() if option not in parts}
        lines += _described(options, part.make)
    return "\n".join(lines)


def _described(options: Mapping[str, Option], make: Callable[..., Any]) -> list[str]:
    """Lines of help on ``options``, which are keywords of ``make``; a default tells the type, unless it is null."""
    lines, descriptions = [], help_of(make)
    for name, (default, values, _) in options.items():
        text = descriptions.get(name.rpartition(".")[2], "").replace("``", "").replace("None", "null").rstrip(".")
        its_type = f"{values.name.removesuffix(' or null')}; " if default is None and values else ""
        lines.append(_line(f"--{dashed(name)}", f"{text} ({its_type}default: {as_text(default)})"))
    return lines


def _line(name: str, text: str) -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=f"  {name:17} ", subsequent_indent=" " * 20)
