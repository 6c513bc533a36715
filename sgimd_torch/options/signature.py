"""Options of a part: the keywords of a class or a function that have a simple type and a default.

    options_of(InterestMap)["window"]                   # Option(kind=int, default=24)
    help_of(InterestMap)["window"]                      # "number of recent competences ...", from the docstring
The signature gives name, type and default; the docstring gives the help; the body checks the bounds.
"""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar, cast

from sgimd_torch.options.catalogue import WORDS, function_of

F = TypeVar("F", bound=Callable[..., Any])
_SIMPLE: Final = (int, float, bool, str, Path, type(None), ...)
_NAMES: Final[dict[Any, str]] = {  # of types, in help and in errors
    float: "a number",
    int: "a whole number",
    str: "text",
    bool: "true or false",
    Path: "a path",
    types.NoneType: "null",
    tuple[float, ...]: "numbers with commas",
    tuple[float, float]: "two numbers with a comma between",
    tuple[int, ...]: "whole numbers with commas",
    tuple[str, ...]: "names with commas",
}
_NAMED: Final = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


class Option(NamedTuple):
    """A keyword that a run can set: its type and its default."""

    kind: Any
    default: Any


@cache
def options_of(make: Callable[..., Any]) -> dict[str, Option]:
    """Keywords of ``make`` that have a default and a simple type: number, text, bool, path, tuple of these, or None."""
    found = {name: Option(_simple(each), each.default) for name, each in parameters_of(make).items()}
    return {name: each for name, each in found.items() if each.kind is not None and each.default is not _EMPTY}


def choices_of(make: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """Keywords of ``make`` that choose a part: keywords called like a kind of the catalogue, with a default part."""
    found = {name: each.default for name, each in parameters_of(make).items() if name in WORDS}
    return {name: default for name, default in found.items() if callable(default) and default is not _EMPTY}


def parameters_of(make: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Parameters of ``make`` that can be given by name."""
    return {each.name: each for each in inspect.signature(make).parameters.values() if each.kind in _NAMED}


def help_of(make: Callable[..., Any]) -> dict[str, str]:
    """Description of each parameter in the docstring, as one line."""
    import docstring_parser  # a module that only help needs

    make = function_of(make)
    decorated = make.__init__ if inspect.isclass(make) else make
    target = vars(decorated).get("with_keywords_of") if inspect.isfunction(decorated) else None
    found = {} if target is None else help_of(target)
    text = inspect.getdoc(make) or ""
    for each in docstring_parser.parse(text, docstring_parser.DocstringStyle.GOOGLE).params:
        about = " ".join((each.description or "").split()).partition(" Deviation:")[0]
        found |= dict.fromkeys(each.arg_name.split(", "), about)
    return found


def with_keywords_of(target: Callable[..., Any], *names: str, **changed: Any) -> Callable[[F], F]:
    """Decorator that lists the keywords of ``target`` in the signature of a function which passes ``**keywords`` to it.

    Args:
        target: function or class with the keywords and their defaults.
        names: keywords to list; if no name is given, all are listed.
        changed: new defaults, by keyword, instead of the defaults of ``target``.
    """

    def decorate(function: F) -> F:
        own = [each for each in inspect.signature(function).parameters.values() if each.kind is not each.VAR_KEYWORD]
        mine = {each.name for each in own}
        theirs = [each for each in parameters_of(target).values() if each.default is not _EMPTY or each.name in changed]
        wanted = [each for each in theirs if each.name not in mine and (not names or each.name in names)]
        handed = [each.replace(kind=each.KEYWORD_ONLY) for each in wanted]
        every = [each.replace(default=changed.get(each.name, each.default)) for each in (*own, *handed)]

        @wraps(function)
        def made(*arguments: Any, **keywords: Any) -> Any:
            return function(*arguments, **{**changed, **keywords})

        vars(made).update(__signature__=inspect.Signature(every), with_keywords_of=target)
        return cast(F, made)

    return decorate


_EMPTY: Final = inspect.Parameter.empty


def _simple(parameter: inspect.Parameter) -> Any:
    """Type of a parameter if it is simple, else None."""
    kind = parameter.annotation
    if isinstance(kind, str):
        try:
            kind = eval(kind, {**vars(typing), "Path": Path})
        except Exception:  # an unknown name is no simple type
            return None
    kind = type(parameter.default) if kind is _EMPTY else kind
    return kind if kind is not type(None) and _is_simple(kind) else None


def _is_simple(kind: Any) -> bool:
    if typing.get_origin(kind) in (tuple, typing.Union, types.UnionType):
        return all(map(_is_simple, typing.get_args(kind)))
    return kind in _SIMPLE


def parsed(text: str, kind: Any) -> Any:
    """``text`` as a value of type ``kind``; a list may be typed with brackets or without.

    Raises:
        ValueError: the text is of another type.
    """
    inner = typing.get_args(kind)
    if typing.get_origin(kind) is tuple:
        items = [item.strip() for item in text.removeprefix("[").removesuffix("]").split(",") if item]
        kinds = [inner[0]] * len(items) if ... in inner else inner
        return tuple(parsed(*each) for each in zip(items, kinds, strict=True))
    if inner:  # a union, with None last
        if text == "null" and types.NoneType in inner:
            return None
        return parsed(text, inner[0])
    if kind is bool:
        return bool(("false", "true").index(text))
    if not text or (kind in (int, float) and "_" in text):  # Python would read 1_0 as 10
        raise ValueError(f"{text!r} is not {wanted(kind)}")
    return kind(text)


def wanted(kind: Any) -> str:
    """Name of a type, for somebody who types a value of this type."""
    return _NAMES[kind] if kind in _NAMES else " or ".join(map(wanted, typing.get_args(kind)))
