"""Evaluations of a run's inverse models: those in its record, and new ones, which are added to the record.

evaluations = Evaluations(build(config), record)
evaluations.after(500)["own"].mean_error
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sgimd_torch.evaluation import Evaluation, evaluate
from sgimd_torch.options.config import OWN
from sgimd_torch.record import Record
from sgimd_torch.runs.run_parts import RunParts

ByInverse = Mapping[str, Evaluation]
"""The evaluation of each inverse model, by name, the run's own inverse model first."""


@dataclass
class Evaluations:
    """All evaluations of a run, by the number of movements before each one.

    Args:
        parts: parts of the run; their ``inverses`` are evaluated.
        record: record of the run; movements of an evaluation are not recorded.
        with_regions: whether the record gets the present regions of the goal model at each new evaluation.
        between: function to call between movements of an evaluation; it may raise `KeyboardInterrupt`.
    """

    parts: RunParts
    record: Record
    with_regions: bool = True
    between: Callable[[], object] = bool

    def __post_init__(self) -> None:
        rows: dict[int, dict[str, list[Any]]] = {}
        for movements, word, _, *numbers in self.record.rows("errors"):
            rows.setdefault(movements, {}).setdefault(word, []).append(numbers)
        self._by_movements: dict[int, ByInverse] = {
            movements: {word: _evaluation(np.array(numbers, dtype=np.float64)) for word, numbers in by_word.items()}
            for movements, by_word in rows.items()
        }

    @property
    def last(self) -> Evaluation | None:
        """The last evaluation of the run's own inverse model, None if there is none."""
        return self._by_movements[max(self._by_movements)][OWN] if self._by_movements else None

    @property
    def missing(self) -> list[int]:
        """Numbers of movements before the requested evaluations that are not in the record."""
        return self.parts.missing(self._by_movements, self.parts.config.evaluations)

    def after(self, movements: int) -> ByInverse | None:
        """The recorded evaluation after this number of movements, else a new evaluation of the present learner.

        The result is None while memory is empty: the observing learner remembers nothing before a demonstration.
        """
        if movements not in self._by_movements and len(self.parts.learner.memory):
            self._by_movements[movements] = self._evaluate(movements)
            self._write(movements, self._by_movements[movements])
        return self._by_movements.get(movements)

    def _evaluate(self, movements: int) -> ByInverse:
        """Evaluate with streams that the run does not use.

        At each goal the noise is the same for all inverse models. The noise floor is measured for the run's own model.
        """
        parts, config = self.parts, self.parts.config
        where = parts.environment, parts.benchmark.goals, config.seed, movements
        floors = (config.movements,) if config.floor_at is None else config.floor_at
        repeats = config.repeats if parts.due(movements, floors) else 0
        own = evaluate(parts.inverses[OWN], *where, repeats=repeats, between=self.between)
        evaluations = {OWN: own}
        for name, inverse in parts.inverses.items():
            if inverse is parts.inverses[OWN]:
                evaluations.setdefault(name, own.without_noise)
            else:
                evaluations[name] = evaluate(inverse, *where, repeats=0, between=self.between)
        return evaluations

    def _write(self, movements: int, evaluations: ByInverse) -> None:
        """Add evaluations to the record, and the current regions of the goal model."""
        for word, evaluation in evaluations.items():
            errors, met = evaluation.errors, evaluation.met(self.parts.benchmark.side / 2)
            quantiles = np.median(errors), np.quantile(errors, 0.9)
            summary = evaluation.mean_error, *quantiles, evaluation.noise_floor, evaluation.expected.mean(), met
            self.record.add_rows("evaluations", [(movements, word, *summary)])
            columns = errors, evaluation.scatter, evaluation.failed.astype(int), evaluation.expected
            rows = zip(range(len(errors)), *columns, evaluation.contexts, strict=True)
            self.record.add_rows("errors", [(movements, word, *numbers, *context) for *numbers, context in rows])
        for region in self.parts.learner.regions if self.with_regions else ():
            n = len(region.competences)
            results = n, float(region.competences.mean()) if n else np.nan, float(region.interest())
            row = movements, region.path, *region.low, *region.high, region.attempts, *results
            self.record.add_rows("regions", [row])


def _evaluation(numbers: np.ndarray) -> Evaluation:
    unknown = np.full((len(numbers), 0), np.nan)
    errors, noise, failed, expected, *_ = numbers.T
    return Evaluation(errors, unknown, unknown, noise, numbers[:, 4:], failed > 0, expected)
