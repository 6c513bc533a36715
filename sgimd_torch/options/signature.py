"""Options of a part: keywords of a class or a function that have a default and a simple type, or that choose a part.

    options_of(InterestMap)["window"]                   # Option(24, VALUES["int"])
    options_of(InterestMap)["progress"]                 # Option(gained_progress, part="progress")
    help_of(InterestMap)["window"]                      # "number of recent competences ...", from the docstring
The signature gives name, type and default; the docstring gives the help; the body checks the bounds.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

from sgimd_torch.calls import NO_DEFAULT, function_of, parameters_of
from sgimd_torch.options.catalogue import WORDS
from sgimd_torch.texts import VALUES, Values


class Option(NamedTuple):
    """A keyword that a run can set.

    Attributes:
        default: value if the run sets no other; for a part, its constructor.
        values: values that it may have; None if it chooses a part.
        part: kind of the part that it chooses, such as "goals"; "" if it chooses none.
    """

    default: Any
    values: Values | None = None
    part: str = ""


@cache
def options_of(make: Callable[..., Any]) -> dict[str, Option]:
    """Options of ``make``, by name.

    A keyword called like a kind of the catalogue, with a constructor for a default, chooses a part. Simple types are
    number, text, bool, path, tuple of these, or None.
    """
    options = {}
    for name, parameter in parameters_of(make).items():
        if parameter.default is NO_DEFAULT:
            continue
        if name in WORDS and callable(parameter.default):
            options[name] = Option(parameter.default, part=name)
        elif values := _values(parameter):
            options[name] = Option(parameter.default, values)
    return options


def _values(parameter: inspect.Parameter) -> Values | None:
    """Values of a parameter of a simple type; without an annotation, of the type of its default."""
    kind = type(parameter.default) if parameter.annotation is NO_DEFAULT else parameter.annotation
    text = kind if isinstance(kind, str) else inspect.formatannotation(kind)
    text = re.sub(r"\b(pathlib|typing)\.", "", text)
    return VALUES.get(re.sub(r"Optional\[(.*)\]", r"\1 | None", text))


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
