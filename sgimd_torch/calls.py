"""Calls of constructors, which may be a user's code, and functions that pass their keywords on.

Goals.of(make, problem)     # explains each mistake in one sentence
"""

from __future__ import annotations

import inspect
from abc import ABC
from collections.abc import Callable
from functools import partial, wraps
from typing import Any, Final, Self, TypeVar, cast

F = TypeVar("F", bound=Callable[..., Any])
NO_DEFAULT: Final = inspect.Parameter.empty


def function_of(make: Callable[..., Any]) -> Callable[..., Any]:
    """The function or class inside of any ``partial``."""
    return function_of(make.func) if isinstance(make, partial) else make


class Built(ABC):  # noqa: B024
    """A part of a learner or of a run."""

    @classmethod
    def of(cls, make: Any, *given: Any) -> Self:
        """The part of this class that the constructor ``make`` builds from the arguments ``given``.

        Raises:
            ValueError: ``make`` is no constructor or takes other arguments, an abstract method is missing, or the part
                is of another class.
        """
        kind = cls.__name__
        if isinstance(make, cls) or not callable(make):
            got = f"a {'finished ' * isinstance(make, cls)}{type(make).__name__}"
            got = f"{make!r}; import its class, names are for the command line" if isinstance(make, str) else got
            raise ValueError(f"{kind} must be a class or a function, got {got}")
        name = function_of(make).__name__
        if missing := getattr(function_of(make), "__abstractmethods__", ()):
            raise ValueError(f"{name} has no {', '.join(sorted(missing))}, which every {kind} must have")
        part: Any = call_checked(f"{kind} {name}", make, *given)
        if not isinstance(part, cls):
            wanted = f"derive a class from {kind} of {cls.__module__}"
            raise ValueError(f"{name} must make a {kind}, made a {type(part).__name__}; {wanted}")
        return part


def call_checked(what: str, make: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
    """Result of a call of ``make``, which may be code of a user.

    Raises:
        ValueError: ``make`` takes other arguments, or it ends the program.
    """
    try:
        inspect.signature(make).bind(*arguments, **options)
    except TypeError as error:
        raise ValueError(f"{what} cannot be called with the arguments of its kind: {error}") from error
    try:
        return make(*arguments, **options)
    except SystemExit as end:  # SystemExit would end the command, which would look successful
        raise ValueError(f"{what} cannot be made: it calls exit({end})") from end


def parameters_of(make: Callable[..., Any]) -> dict[str, inspect.Parameter]:
    """Parameters of ``make`` that can be given by name."""
    by_name = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    parameters = inspect.signature(make).parameters
    return {name: parameter for name, parameter in parameters.items() if parameter.kind in by_name}


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
            if (parameter.default is not NO_DEFAULT or name in changed) and (not names or name in names)
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
