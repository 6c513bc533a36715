"""A listener that writes the board of a run for TensorBoard. Steps are movements.

A resumed run first tells its listeners its whole record. So the board is written anew, and holds each point once.
    board = BoardListener(folder, parts, seconds); board.episode(episode, replayed=False); board.flush(); board.close()
``tensorboard --logdir RUNS`` shows it.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from tensorboardX import summary

from sgimd_torch.board.curves import Behaviour, of_evaluation, of_regions
from sgimd_torch.board.events import EventFile
from sgimd_torch.board.legend import page, sentence
from sgimd_torch.board.pictures import draw
from sgimd_torch.evaluation import Benchmark, Evaluation
from sgimd_torch.spaces import Box, Episode

EVERY: Final = 50  # number of movements from one point of a curve to the next


class BoardListener(EventFile):
    """A listener that writes the curves and pictures of a run.

    Args:
        folder: folder of the run; its event files do not change before ``begin``, the end of a replay.
        parts: parts of the run; only config, environment, learner and benchmark are used.
        seconds: function that returns the seconds spent so far, by part of the run.
        curves: function that returns the new numbers of other listeners for the board, by tag.
    """

    def __init__(
        self,
        folder: Path,
        parts: Any,
        seconds: Callable[[], Mapping[str, float]],
        curves: Callable[[], Mapping[str, float]] = dict,
    ) -> None:
        super().__init__(folder)
        self._config, self._learner, self._seconds, self._curves = parts.config, parts.learner, seconds, curves
        self._space: Box = parts.environment.outcomes
        self._benchmark: Benchmark = parts.benchmark
        self._behaviour = Behaviour(parts.learner.problem.tolerance, parts.config.at_once)
        self._movements = self._drawn_at = self._changes = 0
        self._explained: set[str] = set()
        # The result on TensorBoard's page of hyperparameters.
        result = "error/mean" if parts.config.evaluations else "goals/missed_by"
        for each in summary.hparams(hparams_of(parts.config), {result: math.nan})[:2]:  # the third marks the end
            self.add(0, each)
        self.add(0, summary.text("about/legend", page(self._space.unit)))

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Count a movement; after every 50th movement the curves get a point. Replayed movements have no times."""
        self._movements = episode.index + 1
        self._behaviour.episode(episode)
        if self._movements % EVERY == 0:
            self._scalars({**self._behaviour.curves(), **of_regions(self._learner.regions)})
            if not replayed:
                self._scalars({f"time/{name.removeprefix('seconds_')}": s for name, s in self._seconds().items()})
        self._scalars(self._curves())
        for change in self._learner.changes[self._changes :]:
            self.add(self._movements, summary.text("about/changes", str(change)))
        self._changes = len(self._learner.changes)

    def evaluated(self, movements: int, evaluations: Mapping[str, Evaluation]) -> None:
        """Show an evaluation; of inverse models other than the run's own, show only the mean error.

        Pictures take as long as 100 movements. So they are drawn only when the number of movements has doubled since
        the last pictures, and at the end.
        """
        own, goals = evaluations["own"], self._benchmark.goals
        others = {f"error/by_{word}": other.mean_error for word, other in evaluations.items() if word != "own"}
        self._scalars({**of_evaluation(own, self._benchmark.side / 2), **others})
        if movements >= 2 * self._drawn_at or movements == self._config.movements:
            self._drawn_at = movements
            for tag, picture in draw(self._learner.regions, self._space, goals, own.errors).items():
                self._show(tag, summary.image(tag, picture, dataformats="HWC"), "images")

    def curves(self) -> Mapping[str, float]:
        """No numbers, because the board only draws those of other listeners."""
        return {}

    def _scalars(self, values: Mapping[str, float]) -> None:
        """Add a point to each curve; ``values`` are by tag, and values that are not finite are left out."""
        for tag, value in values.items():
            if math.isfinite(value):
                self._show(tag, summary.scalar(tag, value), "scalars")

    def _show(self, tag: str, made: Any, plugin: str) -> None:
        """Add a summary to TensorBoard's page ``plugin``; the first summary of a tag carries the tag's explanation."""
        if tag not in self._explained:
            self._explained.add(tag)
            made.value[0].metadata.summary_description = sentence(tag, self._space.unit)
            made.value[0].metadata.plugin_data.plugin_name = plugin
        self.add(self._movements, made)


def hparams_of(config: Any) -> dict[str, bool | float | str]:
    """Options of a run for TensorBoard's page of hyperparameters, by their names on the command line.

    These are algorithm, environment, seed, options of parts that differ from their defaults, and the options in the
    name of the variant, such as "sgim-d,budget=5". So each run of a sweep has all options that the sweep varies.
    """
    varied = re.findall(r"(?:^|,)([\w.-]+)=", config.variant)
    typed = {name.replace("_", "-"): value for name, value in config.settings.items()}
    chosen = ["algorithm", "environment", "seed", *(name.replace("_", "-") for name in dict(config.parts)), *varied]
    return {
        name: value if isinstance(value, bool | int | float | str) else json.dumps(value)
        for name, value in typed.items()
        if name in chosen
    }
