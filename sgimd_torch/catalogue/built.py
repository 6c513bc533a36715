"""Building parts from constructors: ``Goals.of(make, problem)`` explains each mistake in a user's constructor."""

from __future__ import annotations

from abc import ABC, ABCMeta
from typing import Any, Self

from sgimd_torch.catalogue import called, function_of, place_of


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
        if isinstance(make, str):
            module, _, name = place_of(kind.lower(), make).partition(":")
            raise ValueError(f"{kind} must be a class or a function, got {make!r}; from {module} import {name}")
        if isinstance(make, cls) or not callable(make):
            finished = "finished " if isinstance(make, cls) else ""
            raise ValueError(f"{kind} must be a class or a function, got a {finished}{type(make).__name__}")
        found = function_of(make)
        if isinstance(found, type) and not issubclass(found, cls):
            raise ValueError(f"{found.__name__} must derive from {kind} of sgimd_torch.parts")
        if isinstance(found, ABCMeta) and found.__abstractmethods__:
            missing = ", ".join(sorted(found.__abstractmethods__))
            raise ValueError(f"{found.__name__} has no {missing}, which every {kind} must have; see sgimd_torch.parts")
        made: Any = called(f"{kind} {found.__name__}", make, *given)
        if not isinstance(made, cls):
            raise ValueError(f"{found.__name__} must return an object of {kind}, returned a {type(made).__name__}")
        return made
