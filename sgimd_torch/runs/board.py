"""The board of a run: what TensorBoard shows of it, after a resume as if the run had never stopped.

with RunBoard(directory, parts, seconds) as board: board.episode(episode); board.evaluation(found)
``sgimd watch RUNS`` opens TensorBoard on it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Final, Self

import numpy as np

from sgimd_torch.board.scalars import EVERYWHERE, MOST_PLACES, Grid, layout_of
from sgimd_torch.evaluation import Evaluation
from sgimd_torch.runs import model_record
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import LEADS, OWN
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.spaces import Array, Box, Episode

GOALS: Final = 100  # the last ones are drawn
OF_EVALUATIONS: Final = ("error", "answers", "grid_error", "grid_met", "met")  # families of tags
LEGEND: Final = {
    "time": "Seconds spent so far: on physics, by the learner and on evaluations.",
    "answers": "error/mean (m) if another inverse model answers, such as linear in all runs: compare learners by it.",
    "competent/since": "Where half of the benchmark's goals are met, and since when; elsewhere the share now.",
    "map/competence": "The regions, named like the curves, coloured by the mean competence of the goals they remember.",
    "map/interest": "The regions, coloured by interest, and the last goals that the learner chose.",
    "map/landed": "Where movements have landed so far, and what was demonstrated.",
    "map/error": "How far from each benchmark goal the movement for it landed at this evaluation.",
    "about/regions": "Where the regions with curves of their own lie, and how they are now.",
}


class RunBoard:
    """Shows what a run does. A context manager.

    Args:
        directory: of the run; its event files stay as they are until ``begin``.
        parts: of the run.
        seconds: its clock.
    """

    def __init__(self, directory: RunDirectory, parts: RunParts, seconds: Seconds) -> None:
        from sgimd_torch.board.writer import Board  # loaded only when there is a board

        self._recorded, self._parts, self._seconds = len(directory.lines), parts, seconds
        self._goals: deque[Array] = deque(maxlen=GOALS)
        self._demonstrated: list[Array] = []
        self._drawn_at = 0
        self._timed = False  # earlier event files hold times
        tolerance = getattr(parts.learner.autonomous, "tolerance", 0.02)
        cells = cells_of(parts.environment.outcomes, parts.benchmark.goals)
        near = parts.benchmark.side / 2
        legend, charts = ({}, {}) if parts.model is None else (model_record.LEGEND, model_record.LAYOUT)
        self._board = Board(
            directory.path,
            cells,
            tolerance=tolerance,
            near=near,
            legend={**LEGEND, **legend},
            layout=layout_of(_places(cells, parts.benchmark.goals), near, _has(parts), charts),
            replace=True,
        )
        settings = {name: _plain(value) for name, value in parts.config.settings.items()}
        self._board.settings(settings, first=LEADS)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._board.close()

    def episode(self, episode: Episode, curves: Mapping[str, float]) -> None:
        """Count a movement, new or replayed; ``curves`` are those of a forward model that learnt from it."""
        board = self._board
        board.episode(episode)
        if episode.demonstration is not None:
            self._demonstrated.append(episode.demonstration.outcome)
        move = episode.move
        goal = None if move is None or move.origin == "imitate" else move.goal
        if goal is not None and not (self._goals and np.array_equal(goal, self._goals[-1])):
            self._goals.append(goal)
        replayed = board.movements <= self._recorded
        if board.due:
            board.regions(self._parts.regions)
            recalled = replayed and board.recall("time")
            self._timed |= recalled
            if not replayed or (self._timed and not recalled):  # not written by a killed run: now is close
                spent = self._seconds.summary().items()
                board.scalars({f"time/{name.removeprefix('seconds_')}": value for name, value in spent})
        board.scalars(curves)

    def evaluation(self, answers: Mapping[str, Evaluation]) -> None:
        """Show a new evaluation, sometimes with pictures; of answers that are not the run's own only the mean error.
        It is on disk when this returns."""
        board, found = self._board, answers[OWN]
        board.scalars({f"answers/{answer}": each.mean_error for answer, each in answers.items() if answer != OWN})
        values = board.curves.of_evaluation(self._parts.benchmark.goals, found.errors, found.noise_floor)
        board.curves.evaluated(board.movements, values)
        # The error comes last: where an event file holds it, it holds all of this evaluation, see recall_evaluation.
        if self._draws:
            self._draw(found)
        board.scalars(values)
        board.flush()

    def recall_evaluation(self) -> bool:
        """Take over from earlier event files what they hold of an evaluation after this movement.

        Returns:
            Whether they hold all of it; if not, it has to be evaluated again.
        """
        board = self._board
        needs = ("error/mean", f"met/{EVERYWHERE}")
        if not self._draws:
            return board.recall(*OF_EVALUATIONS, needs=needs)
        last = "about/regions" if self._parts.regions else "map/error"
        whole = board.recall(*OF_EVALUATIONS, "competent", "map", "about", needs=(*needs, last))
        if whole:
            self._drawn_at = board.movements
        return whole

    def begin(self) -> None:
        """The replay is over: replace earlier event files."""
        self._board.publish()

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._board.flush()

    def finish(self) -> None:
        """The run has ended."""
        self._board.finish()

    @property
    def _draws(self) -> bool:
        """Whether this evaluation gets pictures, which take as long as 100 movements: when the number of movements has
        doubled, and at the end."""
        return self._board.movements >= 2 * self._drawn_at or self._board.movements == self._parts.config.movements

    def _draw(self, found: Evaluation) -> None:
        from sgimd_torch.board.pictures import draw, where  # loaded only when there is a board

        board, space, regions = self._board, self._parts.environment.outcomes, self._parts.regions
        self._drawn_at = board.movements
        pictures = draw(
            regions,
            space,
            outcomes=self._parts.learner.memory.outcomes,
            goals=np.array(self._goals).reshape(-1, space.dim),
            demonstrated=np.array(self._demonstrated).reshape(-1, space.dim),
            benchmark=self._parts.benchmark.goals,
            errors=found.errors,
            cells=board.curves.grid,
            shares=board.curves.shares,
            since=board.curves.since,
        )
        for name, png in pictures.items():
            board.image(name, png)
        if regions:
            board.text("about/regions", where(regions))


def cells_of(space: Box, goals: Array) -> Box:
    """The part of T that is cut into cells: where the benchmark's ``goals`` ``(n, outcome_dim)`` lie, rounded outwards.

    So runs on one benchmark have the same cells, however large their T is.
    """
    sides = np.ptp(goals, axis=0)
    step = 10 ** np.floor(np.log10(np.where(sides > 0, sides, space.sides))) / 2
    low = space.clip(np.floor(goals.min(axis=0) / step) * step + 0.0)  # no -0 in the names of cells
    high = space.clip(np.ceil(goals.max(axis=0) / step) * step + 0.0)
    return Box(np.where(low < high, low, space.low), np.where(low < high, high, space.high))


def _places(cells: Box, goals: Array) -> list[str]:
    """The places on the first page that have goals of the benchmark."""
    return list(Grid(cells, MOST_PLACES).means_of(goals, np.ones(len(goals))))


def _has(parts: RunParts) -> set[str]:
    """What the run has that a chart of the first page needs."""
    found = {
        "repeats": parts.config.repeats > 0,
        "goals": getattr(parts.learner.autonomous, "goals", None) is not None,
        "regions": len(parts.regions) > 0,
        "teacher": parts.teacher is not None or len(parts.teachers) > 0,
        "imitates": (parts.teacher is not None and parts.config.algorithm != "observation") or len(parts.teachers) > 0,
        "asks": len(parts.teachers) > 0,
    }
    return {name for name, there in found.items() if there}


def _plain(value: object) -> bool | float | str:
    """A setting as TensorBoard takes it."""
    return value if isinstance(value, bool | int | float) else str(value)
