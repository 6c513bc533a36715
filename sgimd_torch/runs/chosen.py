"""Which parts a run is put together from: the choices of a run, followed from part to part.

    parts = chosen("sagg-riac", {"goals": "grid", "goals.progress": "absolute"}); parts["goals.progress"].word
The keywords of a part's signature are its options; where one has the name of a kind of the catalogue, it is a choice,
which leads to the next part.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Collection, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from sgimd_torch.catalogue import CATALOGUE, ROD, SHARED, did_you_mean, find, word_of
from sgimd_torch.catalogue.options import Option, options_of, parameters_of

ALGORITHM: Final = ""  # the name of this part; its options have no prefix
_HANDED: Final = "outcome_noise"  # a number, but the environment's
_TEACHERS: Final = Option(tuple[str, ...], ("all",))


@dataclass(frozen=True)
class Part:
    """A part of a run.

    Args:
        name: of the part in the run, "goals" or "goals.progress" say.
        kind, word: what was chosen; of a shared part both are its name.
        standard: the word if nobody chooses.
        make: the thing itself, with what its word fixes.
        takes: names of all its parameters, but those that its word fixes or hides.
        options: those of them that a run can set.
        choices: those that lead to other parts, and their defaults.
    """

    name: str
    kind: str
    word: str
    standard: str
    make: Callable[..., Any]
    takes: Collection[str]
    options: Mapping[str, Option]
    choices: Mapping[str, Callable[..., Any]]

    @property
    def teaching(self) -> str:
        """Of an algorithm: "teachers" that it asks, a "teacher" who shows it something, or "" if it learns alone."""
        if self.kind != "algorithm":
            return ""
        return "teachers" if "teachers" in self.takes else "teacher" if "correspondence" in self.takes else ""

    def full(self, parameter: str) -> str:
        """The name of a parameter in the run."""
        return f"{self.name}.{parameter}" if self.name else parameter

    def set_by(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """The keywords that it gets from what a run has set."""
        return {each: values[self.full(each)] for each in self.options if each != "teachers"}


def part_of(name: str, kind: str, word: str, default: Callable[..., Any] | str = "") -> Part:
    """The part that a word names.

    Args:
        name: of the part in the run.
        kind: of the catalogue, or the name of a shared part.
        word: of that kind, or package.module:attribute; "" for the default.
        default: the word if nobody chooses, or the default of the parameter that leads here, which may have options
            of its own.

    Raises:
        ValueError: there is no such thing, or a package that it needs is not installed.
    """
    standard = default if isinstance(default, str) else word_of(kind, default)
    word = word or standard
    return (_read if ":" in word else _READ)(name, kind, word, standard, default)  # a user's own may change


def _read(name: str, kind: str, word: str, standard: str, default: Callable[..., Any] | str) -> Part:
    entry = SHARED[kind] if kind in SHARED else find(kind, word)
    make = default if callable(default) and word == standard else entry.load()
    left_out = {*entry.fixed, *entry.hidden}
    takes = {each: known.default for each, known in parameters_of(make).items() if each not in left_out}
    options = {each: known for each, known in options_of(make).items() if each in takes and each != _HANDED}
    if kind == "algorithm" and "teachers" in takes:
        options["teachers"] = _TEACHERS
    choices = {each: value for each, value in takes.items() if each in CATALOGUE and _has_name(each, value)}
    return Part(name, kind, word, standard or word, make, takes, options, choices)


_READ: Final = cache(_read)


def chosen(algorithm: str, given: Mapping[str, Any]) -> dict[str, Part]:
    """The parts of a run by name: first the algorithm and the environment, then those that others lead to.

    Args:
        algorithm: which learner.
        given: by name, what was chosen; what names no part of this run is passed over.

    Raises:
        ValueError: see ``part_of``.
    """
    found: dict[str, Part] = {}

    def take(name: str, kind: str, default: Callable[..., Any] | str) -> None:
        part = found[name] = part_of(name, kind, given.get(name, ""), default)
        for parameter, value in part.choices.items():
            take(part.full(parameter), parameter, value)
        for each in SHARED:
            if each in part.takes and each not in found:
                take(each, each, each)

    take("environment", "environment", ROD)
    take(ALGORITHM, "algorithm", algorithm)
    if found[ALGORITHM].teaching == "teacher":
        take("teacher", "teacher", find("algorithm", algorithm).teacher)
    for word in given.get("teachers", ()) if found[ALGORITHM].teaching == "teachers" else ():
        find("teachers", word)
    return found


def standards(parts: Mapping[str, Part]) -> dict[str, Any]:
    """By name, what every part and every option is unless a run says otherwise."""
    found: dict[str, Any] = {}
    for name, part in parts.items():
        if name != ALGORITHM and name not in SHARED:
            found[name] = part.standard
        found |= {part.full(each): option.default for each, option in part.options.items()}
    return found


def _has_name(kind: str, default: Any) -> bool:
    return callable(default) and default is not inspect.Parameter.empty and word_of(kind, default) != ""


def refused(name: str, parts: Mapping[str, Part], others: Iterable[str]) -> ValueError:
    """The error for a name that is none of this run, with the part that has it.

    Args:
        name: of an option or a part.
        parts: of the run.
        others: options that every run has.
    """
    owner, _, last = name.rpartition(".")
    kind = owner.partition(".")[0]
    if owner not in parts:  # what it belongs to is no part of this run, either
        owner, last = ALGORITHM, kind
    part, spelt = parts[owner], name.replace("_", "-")
    near = did_you_mean(name, [each for each in (*standards(parts), *others) if each.rpartition(".")[0] == owner], 2)
    kinds = ("search", "inverse") if last in SHARED else (part.kind,)
    having = [f"{each} {', '.join(_with(each, last))}" for each in kinds if _with(each, last)]
    if not having and owner == ALGORITHM:  # spelt without its part
        having = [f"{each} {', '.join(_with(each, last))} ({each}.{last})" for each in CATALOGUE if _with(each, last)]
    said = f"--{spelt}: {part.kind} {part.word} has no such option"
    return ValueError(f"{said}; {' and '.join(having)} have it" if having else f"{said}{near.replace('_', '-')}")


def _with(kind: str, name: str) -> list[str]:
    """The words of a kind whose parts have an option, or lead to a part, of this name."""
    found = []
    for word in CATALOGUE.get(kind, ()):
        with suppress(ValueError):  # one that is not installed has nothing
            part = part_of(ALGORITHM, kind, word)
            if name in (*part.options, *part.choices, *SHARED.keys() & part.takes, part.teaching):
                found.append(word)
    return found
