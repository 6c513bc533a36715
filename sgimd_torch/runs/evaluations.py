"""Evaluations in the record of a run: rows of them, and evaluations made again from the rows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.goals.regions import Region
from sgimd_torch.record import Record

EVALUATED: Final = ("evaluations", "errors", "regions")
"""Tables of evaluations; in each, rows begin with the number of movements."""


def write_evaluation(
    record: Record, movements: int, found: Mapping[str, Evaluation], near: float, regions: Sequence[Region]
) -> None:
    """Add an evaluation after so many ``movements``, and the regions as they were then.

    Args:
        found: by answer, the run's own first.
        near: distance at which a goal counts as met.
        regions: of the goal model, none if it has none.
    """
    for answer, each in found.items():
        errors = each.errors
        summary = each.mean_error, np.median(errors), np.quantile(errors, 0.9), each.noise_floor, each.met(near)
        record.add_rows("evaluations", [(movements, answer, *summary)])
        columns = zip(
            errors.tolist(),
            each.scatter.tolist(),
            each.failed.astype(int).tolist(),
            each.contexts.tolist(),
            strict=True,
        )
        record.add_rows("errors", [(movements, answer, k, *more, *c) for k, (*more, c) in enumerate(columns)])
    record.add_rows("regions", [(movements, *_fields(region)) for region in regions])


def read_evaluations(record: Record) -> dict[int, dict[str, Evaluation]]:
    """By movements and answer; of a recorded evaluation it is not known which movements were executed."""
    rows: dict[int, dict[str, list[Any]]] = {}
    for movements, answer, _, *numbers in record.rows("errors"):
        rows.setdefault(movements, {}).setdefault(answer, []).append(numbers)
    return {
        movements: {answer: _evaluation(np.array(each, dtype=np.float64)) for answer, each in answers.items()}
        for movements, answers in rows.items()
    }


def _evaluation(numbers: np.ndarray) -> Evaluation:
    unknown = np.full((len(numbers), 0), np.nan)
    return Evaluation(numbers[:, 0], unknown, unknown, numbers[:, 1], numbers[:, 3:], numbers[:, 2] > 0)


def _fields(region: Region) -> Iterator[Any]:
    n = len(region.competences)
    yield region.path
    yield from region.low.tolist()
    yield from region.high.tolist()
    yield from (region.attempts, n, float(region.competences.mean()) if n else np.nan, float(region.interest()))
