"""Calls of constructors, which may be a user's code: ``Goals.of(make, problem)`` explains each mistake in one."""

from __future__ import annotations

import inspect
from abc import ABC
from collections.abc import Callable
from typing import Any, Self

from sgimd_torch.options import function_of


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
            if isinstance(make, str):
                from sgimd_torch.options.catalogue import place_of  # learning needs no names

                got = f"{make!r}; import {place_of(kind.lower(), make).partition(':')[2]}"
            raise ValueError(f"{kind} must be a class or a function, got {got}")
        name = function_of(make).__name__
        if missing := getattr(function_of(make), "__abstractmethods__", ()):
            raise ValueError(f"{name} has no {', '.join(sorted(missing))}, which every {kind} must have")
        part: Any = call_checked(f"{kind} {name}", make, *given)
        if not isinstance(part, cls):
            wanted = f"derive a class from {kind} of sgimd_torch.parts"
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
