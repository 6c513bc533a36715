"""Rooms: features that can be taken away, each with its folder. A room tells in its ``__init__`` what it brings.

    WORDS = "command  command  film"        # lines of the catalogue: a kind, a module of the room, names
    PUBLIC = "traced  traced"               # a module of the room, and names that ``sgimd_torch`` gets from it
    NEEDS = ("models",)                     # rooms that its files import
    INSTALL = "film"                        # extra of the package that installs its libraries
Nothing else in the package knows a room by its name.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, Final

FOLDER: Final = Path(__file__).with_name("extras")


@cache
def rooms() -> dict[str, ModuleType]:
    """The rooms that are there, with all that they need, by name."""
    names = [module.name for module in pkgutil.iter_modules([str(FOLDER)]) if module.ispkg]
    found = {name: importlib.import_module(f"{__package__}.{FOLDER.name}.{name}") for name in names}
    while lacking := [name for name, room in found.items() if not {*getattr(room, "NEEDS", ())} <= found.keys()]:
        found = {name: room for name, room in found.items() if name not in lacking}
    return found


def brought(what: str) -> Iterator[tuple[str, str, list[str]]]:
    """Lines of the table ``what``, WORDS or PUBLIC, of all rooms: kind ("" in PUBLIC), module of the package, names."""
    for room, module in rooms().items():
        for line in getattr(module, what, "").strip().splitlines():
            *kind, file, names = line.split(maxsplit=1 + (what == "WORDS"))
            yield "".join(kind), f"{FOLDER.name}.{room}.{file}", names.split()


@cache
def public_names() -> dict[str, str]:
    """Module of the package, by each name that rooms bring to ``sgimd_torch``."""
    return {name: module for _, module, names in brought("PUBLIC") for name in names}


def room_of(module: str) -> str:
    """Room of a module of the package, such as "film" of "extras.film.command"; "" outside of all rooms."""
    folder, _, rest = module.partition(".")
    return rest.partition(".")[0] if folder == FOLDER.name else ""


def absent(room: str) -> str:
    """A sentence about a room that is not there."""
    lacks = " needs a room that" if (FOLDER / room / "__init__.py").exists() else ""
    return f"the room {room}{lacks} is missing in {FOLDER}"


class Usual:
    """A part that rooms bring, for a default: the first one of its ``kind``, imported when it is called.

    Args:
        kind: kind of the part, such as "watch".
        word: name of what takes its place if no room brings one.
        otherwise: function that takes its place.
    """

    def __init__(self, kind: str, word: str, otherwise: Any) -> None:
        self.kind, self._word, self._otherwise = kind, word, otherwise

    @property
    def word(self) -> str:
        """Name of the part."""
        return next((names[0] for kind, _, names in brought("WORDS") if kind == self.kind), self._word)

    def __call__(self, *given: Any, **options: Any) -> Any:
        for kind, module, (name, *_) in brought("WORDS"):
            if kind == self.kind:
                make = getattr(importlib.import_module(f"{__package__}.{module}"), name.partition("=")[2] or name)
                return make(*given, **options)
        return self._otherwise(*given, **options)
