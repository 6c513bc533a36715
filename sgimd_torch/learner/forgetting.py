"""Which movements of a learner can be forgotten: those that left an exemplar.

numbers = forgettable([12, 40], learner.rows, under_way=0)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from operator import index
from typing import Final

from sgimd_torch.learner.events import Kind
from sgimd_torch.texts import as_spans

_LEFT_NOTHING: Final = {
    Kind.FAILED: "failed, so nothing was learnt from it",
    Kind.RESTED: "was a rest, without an outcome; demonstrations stay",
    Kind.FORGOTTEN: "was forgotten before",
}
_UNDER_WAY: Final = "is under way: tell its outcome first, or fail it, so that nothing is learnt from it"


def forgettable(movements: Iterable[int], rows: Mapping[int, int | Kind], under_way: int) -> list[int]:
    """The numbers of some movements, in order.

    Args:
        movements: numbers of movements, from 0.
        rows: row in memory of the exemplar of each movement so far, or what the movement was if it left none.
        under_way: number of movements that follow them, and whose outcomes were not told.

    Raises:
        ValueError: there are none, or one of them has no exemplar; all such numbers are told, with the reason.
    """
    try:
        numbers = sorted({*map(index, movements)})
    except TypeError:
        raise ValueError(f"forget() needs numbers of movements, such as [12, 40], got {movements!r}") from None
    refused, made = dict[str, list[int]](), len(rows)
    for number in numbers:
        row = rows.get(number)
        if isinstance(row, int):
            continue
        unknown = _UNDER_WAY if made <= number < made + under_way else f"does not exist: {made} were made, from 0 on"
        refused.setdefault(unknown if row is None else _LEFT_NOTHING[row], []).append(number)
    if refused or not numbers:
        told = "; ".join(f"movement {as_spans(found)} {why}" for why, found in refused.items())
        raise ValueError(f"{told or 'forget() needs numbers of movements, got none'}; nothing was forgotten")
    return numbers
