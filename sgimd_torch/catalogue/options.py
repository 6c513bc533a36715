"""Options of a part: the keywords of simple types that a class or a function takes.

    options_of(InterestMap)["window"]                   # Option(kind=int, default=24)
    help_of(InterestMap)["window"]                      # from the docstring, "number of recent competences ..."
The signature has name, type and default, the docstring the help, the body the bounds: nothing repeats them.
"""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable
from functools import partial, wraps
from typing import Any, Final, NamedTuple, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])
_SIMPLE: Final = (int, float, bool, str, type(None), ...)
_TARGETS: Final[dict[Callable[..., Any], Callable[..., Any]]] = {}  # of what `hands_on` has decorated
_NAMED: Final = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)


class Option(NamedTuple):
    """A keyword that a run can set: its type and its default."""

    kind: Any
    default: Any


def options_of(make: Callable[..., Any]) -> dict[str, Option]:
    """The keywords of simple types (numbers, words, true or false, tuples of these, or None) that ``make`` takes."""
    found = {name: Option(_simple(each), each.default) for name, each in parameters_of(make).items()}
    return {name: each for name, each in found.items() if each.kind is not None and each.default is not _EMPTY}


def parameters_of(make: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """The parameters that can be given by name."""
    return {each.name: each for each in inspect.signature(make).parameters.values() if each.kind in _NAMED}


def help_of(make: Callable[..., Any]) -> dict[str, str]:
    """What the docstring says of each parameter, on one line."""
    import docstring_parser  # only help needs it

    while isinstance(make, partial):
        make = make.func
    decorated = make.__init__ if inspect.isclass(make) else make
    found = help_of(_TARGETS[decorated]) if decorated in _TARGETS else {}
    text = inspect.getdoc(make) or ""
    for each in docstring_parser.parse(text, docstring_parser.DocstringStyle.GOOGLE).params:
        about = " ".join((each.description or "").split()).partition(" Deviation:")[0]
        found |= dict.fromkeys(each.arg_name.split(", "), about)
    return found


def hands_on(target: Callable[..., Any], *names: str, **changed: Any) -> Callable[[F], F]:
    """Give a function that hands its ``**keywords`` on to ``target`` a signature with those keywords.

    Args:
        target: function or class that has the keywords and their defaults.
        names: keywords to hand on; none for all.
        changed: other defaults, by keyword.
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

        vars(made).update(__signature__=inspect.Signature(every))
        _TARGETS[made] = target
        return cast(F, made)

    return decorate


_EMPTY: Final = inspect.Parameter.empty


def _simple(parameter: inspect.Parameter) -> Any:
    """Its type if that is a simple one, else None."""
    kind = parameter.annotation
    if isinstance(kind, str):
        try:
            kind = eval(kind, vars(typing).copy())
        except Exception:  # whatever it names, it is no simple type
            return None
    kind = type(parameter.default) if kind is _EMPTY else kind
    return kind if kind is not type(None) and _is_simple(kind) else None


def _is_simple(kind: Any) -> bool:
    if typing.get_origin(kind) in (tuple, typing.Union, types.UnionType):
        return all(map(_is_simple, typing.get_args(kind)))
    return kind in _SIMPLE
