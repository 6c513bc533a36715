"""Things built by a constructor that may be a user's own: ``Goals.of(make, problem)`` says what is wrong with it."""

from __future__ import annotations

from abc import ABC, ABCMeta
from typing import Any, Self

from sgimd_torch.catalogue import called, function_of, place_of


class Built(ABC):  # noqa: B024
    """Something that a learner or a run is put together from."""

    @classmethod
    def of(cls, make: Any, *given: Any) -> Self:
        """The thing of this class that a constructor builds from what it is ``given``.

        Raises:
            ValueError: no constructor, one that takes something else, an abstract method is missing, or what was built
                is of another class.
        """
        kind = cls.__name__
        if isinstance(make, str):
            module, _, name = place_of(kind.lower(), make).partition(":")
            raise ValueError(f"{kind} must be given as its constructor, got {make!r}; from {module} import {name}")
        if isinstance(make, cls) or not callable(make):
            made_already = " that is made already" if isinstance(make, cls) else ""
            raise ValueError(f"{kind} must be given as its constructor, got a {type(make).__name__}{made_already}")
        found = function_of(make)
        if isinstance(found, type) and not issubclass(found, cls):
            raise ValueError(f"{found.__name__} must derive from {kind} of sgimd_torch.parts")
        if isinstance(found, ABCMeta) and found.__abstractmethods__:
            missing = ", ".join(sorted(found.__abstractmethods__))
            raise ValueError(f"{found.__name__} has no {missing}, which {kind} demands; see sgimd_torch.parts")
        made: Any = called(f"{kind} {found.__name__}", make, *given)
        if not isinstance(made, cls):
            raise ValueError(f"{found.__name__} must give a thing of class {kind}, gave a {type(made).__name__}")
        return made
