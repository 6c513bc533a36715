"""Options of a part: keywords of a class or a function that have a default and a simple type, or that choose a part.

    options_of(InterestMap)["window"]                   # Option(kind=int, default=24)
    options_of(InterestMap)["progress"]                 # Option(kind="progress", default=gained_progress)
    help_of(InterestMap)["window"]                      # "number of recent competences ...", from the docstring
The signature gives name, type and default; the docstring gives the help; the body checks the bounds.
"""

from __future__ import annotations

import inspect
import json
import types
import typing
from collections.abc import Callable
from functools import cache, wraps
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar, cast

from sgimd_torch.options import function_of

F = TypeVar("F", bound=Callable[..., Any])
_EMPTY: Final = inspect.Parameter.empty
_NAMES: Final[dict[Any, str]] = {  # names of types, for help and errors
    float: "a number",
    int: "a whole number",
    str: "text",
    bool: "true or false",
    Path: "a path",
    types.NoneType: "null",
    tuple[float, ...]: "numbers with commas",
    tuple[float, float]: "two numbers with a comma between",
    tuple[float, float, float]: "three numbers with commas",
    tuple[int, ...]: "whole numbers with commas",
    tuple[str, ...]: "names with commas",
}


class Option(NamedTuple):
    """A keyword that a run can set.

    Attributes:
        kind: type of its values; or kind of the part that it chooses, such as "goals".
        default: value if the run sets no other; for a part, its constructor.
    """

    kind: Any
    default: Any


@cache
def options_of(make: Callable[..., Any]) -> dict[str, Option]:
    """Options of ``make``, by name.

    A keyword called like a kind of the catalogue, with a constructor for a default, chooses a part. Simple types are
    number, text, bool, path, tuple of these, or None.
    """
    options = {name: Option(_kind(parameter), parameter.default) for name, parameter in parameters_of(make).items()}
    return {name: option for name, option in options.items() if option.kind and option.default is not _EMPTY}


def parameters_of(make: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Parameters of ``make`` that can be given by name."""
    by_name = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(make).parameters
    return {name: parameter for name, parameter in parameters.items() if parameter.kind in by_name}


def help_of(make: Callable[..., Any]) -> dict[str, str]:
    """Description of each parameter in the docstring, as one line."""
    import docstring_parser  # a module that only help needs

    make = function_of(make)
    decorated = make.__init__ if inspect.isclass(make) else make
    target = vars(decorated).get("with_keywords_of") if inspect.isfunction(decorated) else None
    descriptions = {} if target is None else help_of(target)
    text = inspect.getdoc(make) or ""
    for parameter in docstring_parser.parse(text, docstring_parser.DocstringStyle.GOOGLE).params:
        description = " ".join((parameter.description or "").split()).partition(" Deviation:")[0]
        descriptions |= dict.fromkeys(parameter.arg_name.split(", "), description)
    return descriptions


def with_keywords_of(target: Callable[..., Any], *names: str, **changed: Any) -> Callable[[F], F]:
    """Decorator that lists the keywords of ``target`` in the signature of a function which passes ``**keywords`` to it.

    Args:
        target: function or class with the keywords and their defaults.
        names: keywords to list; if no name is given, all are listed.
        changed: new defaults, by keyword, instead of the defaults of ``target``.
    """

    def decorate(function: F) -> F:
        own = parameters_of(function)
        listed = {
            name: parameter.replace(kind=parameter.KEYWORD_ONLY)
            for name, parameter in parameters_of(target).items()
            if (parameter.default is not _EMPTY or name in changed) and (not names or name in names)
        }
        parameters = [
            parameter.replace(default=changed.get(name, parameter.default))
            for name, parameter in {**own, **listed, **own}.items()
        ]

        @wraps(function)
        def made(*arguments: Any, **keywords: Any) -> Any:
            return function(*arguments, **{**changed, **keywords})

        vars(made).update(__signature__=inspect.Signature(parameters), with_keywords_of=target)
        return cast(F, made)

    return decorate


def _kind(parameter: inspect.Parameter) -> Any:
    """Kind of the part that a parameter chooses, or its type if this is simple; None for other parameters."""
    from sgimd_torch.options.catalogue import WORDS  # learning needs no names

    kind = parameter.annotation
    if parameter.name in WORDS and callable(parameter.default):
        return parameter.name
    if isinstance(kind, str):
        try:
            kind = eval(kind, {**vars(typing), "Path": Path})
        except Exception:  # an unknown name is no simple type
            return None
    kind = type(parameter.default) if kind is _EMPTY else kind
    return kind if kind is not types.NoneType and _is_simple(kind) else None


def _is_simple(kind: Any) -> bool:
    if typing.get_origin(kind) in (tuple, typing.Union, types.UnionType):
        return all(map(_is_simple, typing.get_args(kind)))
    return kind in (*_NAMES, ...)


def parsed(text: str, kind: Any) -> Any:
    """``text`` as a value of type ``kind``; a list may have brackets or none.

    Raises:
        ValueError: the text is of another type; the message says which text was wanted.
    """
    try:
        return _parsed(text, kind)
    except ValueError:
        raise ValueError(f"must be {name_of(kind)}, got {text.strip()!r}") from None


def _parsed(text: str, kind: Any) -> Any:
    inner = typing.get_args(kind)
    if typing.get_origin(kind) is tuple:
        items = [item.strip() for item in text.removeprefix("[").removesuffix("]").split(",") if item]
        kinds = [inner[0]] * len(items) if ... in inner else inner
        return tuple(_parsed(item, of) for item, of in zip(items, kinds, strict=True))
    if inner:  # a union, with None last
        return None if text == "null" and types.NoneType in inner else _parsed(text, inner[0])
    if kind is bool:
        return bool(("false", "true").index(text))
    # Python would read 1_0 as 10, and the digits of all scripts.
    if (not text and kind is not str) or (kind in (int, float) and ("_" in text or not text.isascii())):
        raise ValueError
    return kind(text)


def as_text(value: Any) -> str:
    """A value as a user types it; ``parsed`` is the inverse."""
    if isinstance(value, tuple):
        return ",".join(map(as_text, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)


def name_of(kind: Any) -> str:
    """Name of a type, for somebody who types a value of this type."""
    return _NAMES[kind] if kind in _NAMES else " or ".join(map(name_of, typing.get_args(kind)))
