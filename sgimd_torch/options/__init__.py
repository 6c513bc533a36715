"""From a command line to a built learner: names of parts, their options, the settings of a run, its parts."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any


def function_of(make: Callable[..., Any]) -> Callable[..., Any]:
    """The function or class inside of any ``partial``."""
    return function_of(make.func) if isinstance(make, partial) else make
