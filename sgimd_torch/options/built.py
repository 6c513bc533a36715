"""Building parts from constructors: ``Goals.of(make, problem)`` explains each mistake in a user's constructor."""

from __future__ import annotations

from abc import ABC
from typing import Any, Self

from sgimd_torch.options.catalogue import call_checked, function_of, place_of


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
                got = f"{make!r}; import {place_of(kind.lower(), make).partition(':')[2]}"
            raise ValueError(f"{kind} must be a class or a function, got {got}")
        name = function_of(make).__name__
        if missing := getattr(function_of(make), "__abstractmethods__", ()):
            raise ValueError(f"{name} has no {', '.join(sorted(missing))}, which every {kind} must have")
        made: Any = call_checked(f"{kind} {name}", make, *given)
        if not isinstance(made, cls):
            wanted = f"derive a class from {kind} of sgimd_torch.parts"
            raise ValueError(f"{name} must make a {kind}, made a {type(made).__name__}; {wanted}")
        return made
