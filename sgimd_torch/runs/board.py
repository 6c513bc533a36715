"""The board of a run: what ``run.py`` shows in TensorBoard while it goes on, and after a resume as if it never stopped.

with RunBoard(directory, config, parts, seconds) as board: board.episode(episode); board.evaluation(found)
``scripts/watch RUNS`` opens TensorBoard on it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import Field, fields
from types import TracebackType
from typing import TYPE_CHECKING, Any, Final, Self

import numpy as np

from sgimd_torch.evaluation import Evaluation
from sgimd_torch.goals.regions import Region
from sgimd_torch.runs import model_record as run_model
from sgimd_torch.runs.build import RunParts
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.tables import EVALUATION, read_table
from sgimd_torch.spaces import Array, Box, Episode
from sgimd_torch.strategies import GoalBabbling

if TYPE_CHECKING:
    from sgimd_torch.board.writer import Board

REACH: Final = Box.cube(-1, 1, 2)  # m, what the arm and its line can reach; cells in it compare runs of any task space
GOALS: Final = 100  # the last ones are drawn
FIRST: Final = ("algorithm", "goals", "inverse", "movements", "search")  # HParams shows five before one asks for more
LEGEND: Final = {
    "time": "Seconds spent so far: on physics, by the learner and on evaluations.",
    "map/competence": "The regions, named like the curves, coloured by the mean competence of the goals they remember.",
    "map/interest": "The regions, coloured by interest, and the last goals that the learner chose.",
    "map/landed": "Where movements have landed so far, and what was demonstrated.",
    "map/error": "How far from each benchmark goal the movement for it landed at this evaluation.",
    "about/regions": "Where the regions with curves of their own lie, and how they are now.",
}


class RunBoard:
    """Shows what a run does; nothing unless ``config.board`` is true. A context manager.

    Args:
        directory: of the run; its event files stay as they are until ``begin``.
        config, parts: of the run.
        seconds: its clock.
        regions: gives those of the interest map as it is, none for a learner that has no such map.
    """

    def __init__(
        self,
        directory: RunDirectory,
        config: Config,
        parts: RunParts,
        seconds: Seconds,
        regions: Callable[[], Sequence[Region]],
    ) -> None:
        self._directory, self._config, self._parts = directory, config, parts
        self._seconds, self._regions = seconds, regions
        self._board: Board | None = None
        self._goals: deque[Array] = deque(maxlen=GOALS)
        self._demonstrated: list[Array] = []
        self._drawn_at = 0
        if not config.board:
            return
        from sgimd_torch.board.writer import Board  # loaded only for those who watch

        autonomous = parts.learner.autonomous
        tolerance = autonomous.tolerance if isinstance(autonomous, GoalBabbling) else 0.02
        legend, layout = LEGEND, None
        if parts.model is not None:
            legend, layout = {**LEGEND, **run_model.LEGEND}, run_model.LAYOUT
        self._board = Board(directory.path, REACH, tolerance=tolerance, legend=legend, layout=layout, replace=True)
        settings = {field.name: _plain(field, getattr(config, field.name)) for field in fields(config)}
        self._board.settings(settings, first=FIRST)
        self._known = read_table(directory.path / "evaluation.csv", EVALUATION) or {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._board is not None:
            self._board.close()

    def episode(self, episode: Episode) -> None:
        """Count a movement, be it lived or replayed."""
        board = self._board
        if board is None:
            return
        board.episode(episode)
        if episode.demonstration is not None:
            self._demonstrated.append(episode.demonstration.outcome)
        move = episode.move
        goal = None if move is None or move.origin == "imitate" else move.goal
        if goal is not None and not (self._goals and np.array_equal(goal, self._goals[-1])):
            self._goals.append(goal)
        replayed = board.movements <= len(self._directory.lines)
        if board.due:
            board.regions(self._regions())
            if not replayed:
                spent = self._seconds.summary().items()
                board.scalars({f"time/{name.removeprefix('seconds_')}": value for name, value in spent})
            else:
                board.recall("time")
        if replayed and board.movements in self._directory.evaluations:
            self._recall_evaluation(board)

    def model(self, curves: Mapping[str, float]) -> None:
        """A point for the curves of the forward model, which has just learnt."""
        if self._board is not None:
            self._board.scalars(curves)

    def evaluation(self, found: Evaluation | None) -> None:
        """Show an evaluation that was made just now, None if there was nothing to evaluate; and pictures, at times."""
        board = self._board
        if board is None or found is None:
            return
        goals = self._parts.benchmark.goals
        board.evaluation(goals, found.errors, found.noise_floor)
        # Drawing takes as long as a hundred movements: when they have doubled, and at the end.
        if board.movements >= 2 * self._drawn_at or board.movements == self._config.movements:
            self._drawn_at = board.movements
            self._draw(board, found)

    def begin(self) -> None:
        """The replay is over: take the place of earlier event files."""
        if self._board is not None:
            self._board.publish()

    def flush(self) -> None:
        """Hand everything to the operating system."""
        if self._board is not None:
            self._board.flush()

    def finish(self) -> None:
        """The run has come to its end."""
        if self._board is not None:
            self._board.finish()

    def _recall_evaluation(self, board: Board) -> None:
        """What a replay does not make again; of errors for single goals and pictures, what the old event file held."""
        if board.recall("map", "about"):
            self._drawn_at = board.movements
        if not board.recall("error", "grid_error"):
            row = int(np.flatnonzero(self._known["movements"] == board.movements)[0])
            names = ("mean", "median", "p90", "noise_floor")
            values = [float(self._known[column][row]) for column in EVALUATION[1:]]
            board.scalars({f"error/{name}": value for name, value in zip(names, values, strict=True)})

    def _draw(self, board: Board, found: Evaluation) -> None:
        from sgimd_torch.board.pictures import draw, where  # loaded only for those who watch

        space, regions = self._parts.environment.outcomes, self._regions()
        pictures = draw(
            regions,
            space,
            outcomes=self._parts.learner.memory.outcomes,
            goals=np.array(self._goals).reshape(-1, space.dim),
            demonstrated=np.array(self._demonstrated).reshape(-1, space.dim),
            benchmark=self._parts.benchmark.goals,
            errors=found.errors,
        )
        for name, png in pictures.items():
            board.image(f"map/{name}", png)
        if regions:
            board.text("about/regions", where(regions))


def _plain(field: Field[Any], value: object) -> bool | float | str:
    """Of one type in all runs: what may be null is text."""
    return value if isinstance(value, bool | int | float) and "None" not in str(field.type) else str(value)
