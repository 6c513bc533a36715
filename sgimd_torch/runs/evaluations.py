"""Evaluations of a run by each of its answers: those in its record, and new ones, which are added to it.

evaluations = Evaluations(config, arm, benchmark, learner, {"own": learner.inverse}, record)
evaluations.after(500)["own"].mean_error
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark, Evaluation, evaluate
from sgimd_torch.goals.regions import Region
from sgimd_torch.learner import Learner
from sgimd_torch.parts import Inverse
from sgimd_torch.record import Record
from sgimd_torch.runs.config import OWN, Config

Answers = Mapping[str, Evaluation]
"""An evaluation by each answer, the run's own first."""


@dataclass
class Evaluations:
    """All of a run, by the number of movements before them.

    Args:
        config, environment, benchmark, learner: of the run.
        inverses: by their words those that answer, the run's own first; they read the learner's memory.
        record: of the run. Of a recorded evaluation it is not known which movements were executed.
    """

    config: Config
    environment: Environment
    benchmark: Benchmark
    learner: Learner
    inverses: Mapping[str, Inverse]
    record: Record

    def __post_init__(self) -> None:
        rows: dict[int, dict[str, list[Any]]] = {}
        for movements, answer, _, *numbers in self.record.rows("errors"):
            rows.setdefault(movements, {}).setdefault(answer, []).append(numbers)
        self._found: dict[int, Answers] = {
            movements: {answer: _evaluation(np.array(each, dtype=np.float64)) for answer, each in answers.items()}
            for movements, answers in rows.items()
        }

    @property
    def last(self) -> Evaluation | None:
        """The last one by the run's own answer, None before the first."""
        return self._found[max(self._found)][OWN] if self._found else None

    def after(self, movements: int) -> Answers | None:
        """The recorded one after so many movements, or one of the learner as it is now. None without an exemplar to
        infer a movement from: the learner by observation has none before its first demonstration."""
        if movements not in self._found and len(self.learner.memory):
            self._found[movements] = self._evaluate(movements)
            self._write(movements, self._found[movements])
        return self._found.get(movements)

    def _evaluate(self, movements: int) -> Answers:
        """With streams that the run does not use. All answers get the same noise, goal by goal; it is measured for the
        run's own."""
        config, (own, *others) = self.config, self.inverses
        repeats = config.repeats if config.floor_at is None or movements in config.floor_at else 0
        judged: tuple[Any, ...] = self.environment, self.benchmark.goals, config.seed, movements
        found = {own: evaluate(self.inverses[own], *judged, repeats=repeats)}
        for answer in others:
            same = self.inverses[answer] is self.inverses[own]
            found[answer] = found[own].without_noise if same else evaluate(self.inverses[answer], *judged, repeats=0)
        return found

    def _write(self, movements: int, found: Answers) -> None:
        """Add it to the record, and the regions of the goal model as they are now."""
        for answer, each in found.items():
            errors, met = each.errors, each.met(self.benchmark.side / 2)
            summary = each.mean_error, np.median(errors), np.quantile(errors, 0.9), each.noise_floor, met
            self.record.add_rows("evaluations", [(movements, answer, *summary)])
            columns = zip(errors.tolist(), each.scatter.tolist(), each.failed.astype(int), each.contexts, strict=True)
            rows = [(movements, answer, k, *more, *context) for k, (*more, context) in enumerate(columns)]
            self.record.add_rows("errors", rows)
        self.record.add_rows("regions", [(movements, *_fields(region)) for region in self.learner.regions])


def _evaluation(numbers: np.ndarray) -> Evaluation:
    unknown = np.full((len(numbers), 0), np.nan)
    return Evaluation(numbers[:, 0], unknown, unknown, numbers[:, 1], numbers[:, 3:], numbers[:, 2] > 0)


def _fields(region: Region) -> Iterator[Any]:
    n = len(region.competences)
    yield region.path
    yield from (*region.low, *region.high)
    yield from (region.attempts, n, float(region.competences.mean()) if n else np.nan, float(region.interest()))
