"""What people type: how a text becomes a value, and which name was meant.

NUMBER.of("0.5"); VALUES["tuple[int, ...] | None"].of("1,2"); did_you_mean("unifrom", ["uniform"])
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Collection, Iterable
from difflib import get_close_matches
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, Final, NamedTuple


class Values(NamedTuple):
    """The values of an option.

    Attributes:
        name: name for people, such as "a number".
        read: function from a text to a value; ValueError for any other text.
        are_paths: whether they name files.
    """

    name: str
    read: Callable[[str], Any]
    are_paths: bool = False

    def of(self, text: str) -> Any:
        """The value that a text stands for.

        Raises:
            ValueError: the text stands for none; the message says which text was wanted.
        """
        try:
            return self.read(text)
        except ValueError:
            raise ValueError(f"must be {self.name}, got {text.strip()!r}") from None


def _number(kind: Callable[[str], Any], text: str) -> Any:
    if not text or "_" in text or not text.isascii():  # Python reads 1_0 as 10, and the digits of all scripts
        raise ValueError
    return kind(text)


def _several(kind: Callable[[str], Any], n: int | None, text: str) -> tuple[Any, ...]:
    """A tuple, with brackets around it or without; ``n``: number of its entries, None for any."""
    items = [item.strip() for item in text.removeprefix("[").removesuffix("]").split(",") if item]
    if n not in (None, len(items)):
        raise ValueError
    return tuple(map(kind, items))


def _truth(text: str) -> bool:
    return bool(("false", "true").index(text))


def _spans(text: str) -> tuple[range, ...]:
    spans = list[range]()
    for part in text.split(","):
        ends = re.fullmatch(r"(\d+)(?:-(\d+))?", part.strip(), re.ASCII)  # Python reads the digits of all scripts
        if ends is None or not (span := range(int(ends[1]), int(ends[2] or ends[1]) + 1)):
            raise ValueError
        spans.append(span)
    return tuple(spans)


def _or_null(read: Callable[[str], Any], text: str) -> Any:
    return None if text == "null" else read(text)


_FLOAT, _INT = partial(_number, float), partial(_number, int)  # values of a Config go to other processes
NUMBER: Final = Values("a number", _FLOAT)
COUNT: Final = Values("a whole number", _INT)
NUMBERS: Final = Values("numbers with commas", partial(_several, _FLOAT, None))
SPANS: Final = Values("like 5, 0-19 or 0,3,7-9", _spans)
_SIMPLE: Final = {
    "float": NUMBER,
    "int": COUNT,
    "str": Values("text", str),
    "bool": Values("true or false", _truth),
    "Path": Values("a path", Path, are_paths=True),
    "str | Path": Values("text", str, are_paths=True),
    "tuple[float, ...]": NUMBERS,
    "tuple[float, float]": Values("two numbers with a comma between", partial(_several, _FLOAT, 2)),
    "tuple[float, float, float]": Values("three numbers with commas", partial(_several, _FLOAT, 3)),
    "tuple[int, ...]": Values("whole numbers with commas", partial(_several, _INT, None)),
    "tuple[str, ...]": Values("names with commas", partial(_several, str, None)),
}
VALUES: Final = _SIMPLE | {
    f"{annotation} | None": Values(f"{name} or null", partial(_or_null, read), are_paths)
    for annotation, (name, read, are_paths) in _SIMPLE.items()
}
"""Values by their annotation in a signature."""


def as_text(value: Any) -> str:
    """A value as a user types it; `Values.of` is the inverse."""
    if isinstance(value, tuple):
        return ",".join(map(as_text, value)) or "[]"
    return json.dumps(value) if value is None or isinstance(value, bool) else str(value)


def as_spans(numbers: Iterable[int]) -> str:
    """Whole numbers, in order, as a user types them, such as "12,40-45"; `numbers_in` is the inverse."""
    ends = list[list[int]]()
    for number in numbers:
        if ends and number == ends[-1][1] + 1:
            ends[-1][1] = number
        else:
            ends.append([number, number])
    return ",".join(f"{first}-{last}" if first < last else str(first) for first, last in ends)


def numbers_in(spans: str) -> list[int]:
    """All whole numbers of a text such as "12,40-45"."""
    return list(chain(*SPANS.of(spans)))


def unknown_name_error(what: str, word: str, known: Collection[str], also: str = "") -> ValueError:
    """The error for an unknown ``word``; the message has the nearest ``known`` name, all known names, and ``also``."""
    near = did_you_mean(word, known)
    return ValueError(f"unknown {what} {word!r}{f'{near} Known' if near else '; known'} are {', '.join(known)}{also}")


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str:
    """A question such as ``; did you mean vary?`` with at most ``most`` similar names; empty if no name is similar."""
    spellings = {word.lower().replace("_", "-"): word for word in known}
    near = get_close_matches(name.lower().replace("_", "-"), spellings, most, 0.5)
    return f"; did you mean {' or '.join(spellings[word] for word in near)}?" if near else ""
