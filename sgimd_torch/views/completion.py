"""Shell completion: a script in which the shell finds commands, their options and the choices of an option.

    sgimd --completion bash > ~/.local/share/bash-completion/completions/sgimd

The script holds all words itself, so a press of Tab starts no Python. It is written again after an update.
"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Mapping
from typing import Final, get_type_hints

import shtab

from sgimd_torch.catalogue import CATALOGUE
from sgimd_torch.runs import command_line
from sgimd_torch.runs.config import Config

SHELLS: Final = tuple(shtab.SUPPORTED_SHELLS)
TAKE_OPTIONS_OF_RUN: Final = ("run", "sweep", "suite", "teach")
KINDS: Final = {"task": "environment"}  # an option that is called otherwise in a command than in ``sgimd run``


def script(commands: Mapping[str, tuple[str, str, str]], shell: str) -> str:
    """The completion script of ``sgimd``, for one of ``SHELLS``.

    Args:
        commands: name -> module with ``parser()``, what it does, its extra. Without the extra, the name alone is known.
        shell: bash, zsh, or another one that shtab knows.

    Raises:
        ValueError: it knows no such shell.
    """
    if shell not in SHELLS:
        raise ValueError(f"--completion takes {', '.join(SHELLS)}, got {shell!r}; echo $SHELL says which one is yours")
    whole = argparse.ArgumentParser(prog="sgimd")
    whole.add_argument("--version", action="store_true", help="print the version")
    whole.add_argument("--completion", choices=SHELLS, help="print a script that completes commands in this shell")
    parsers = whole.add_subparsers()
    for name, (module, about, extra) in commands.items():
        parents = [_kinds(), *([command_line.parser()] if name != "run" else [])] if name in TAKE_OPTIONS_OF_RUN else []
        try:
            parents.append(importlib.import_module(f"sgimd_torch.{module}").parser())
        except ImportError:
            if not extra:
                raise
        each = parsers.add_parser(name, help=about, parents=parents, add_help=False, conflict_handler="resolve")
        _name_choices(each)
    return shtab.complete(whole, shell)


def _kinds() -> argparse.ArgumentParser:
    """The kinds of parts that a run may choose."""
    found = argparse.ArgumentParser(add_help=False)
    for kind in CATALOGUE:
        if kind != "algorithm":
            found.add_argument(f"--{kind}")
    return found


def _name_choices(parser: argparse.ArgumentParser) -> None:
    """Tell shtab what an option may be: words of the catalogue, true or false, a file."""
    hints = get_type_hints(Config)
    for action in parser._actions:  # shtab reads the same; argparse has no public list of them
        if isinstance(action, argparse._SubParsersAction):
            for each in action.choices.values():
                _name_choices(each)
            continue
        kind = hints.get(action.dest, action.type)
        known = CATALOGUE.get(KINDS.get(action.dest, action.dest))
        if known is not None:
            action.choices = tuple(known)
        elif kind is bool:
            action.choices = ("true", "false")
        elif "Path" in str(kind):
            action.complete = shtab.FILE  # type: ignore[attr-defined] # how shtab is told
