"""The board of a run: what TensorBoard shows of it. Steps are movements.

A resumed run tells everything again from its record, so the board is written anew and holds each point once.
    board = BoardListener(folder, parts, seconds); board.episode(episode, replayed=False); board.flush(); board.close()
``tensorboard --logdir RUNS`` shows it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, Protocol

from sgimd_torch.board.curves import Behaviour, Competent, of_regions
from sgimd_torch.board.events import EventFile
from sgimd_torch.board.legend import LEGEND, charts
from sgimd_torch.board.pictures import draw
from sgimd_torch.environments.protocol import Environment
from sgimd_torch.evaluation import Benchmark, Evaluation
from sgimd_torch.spaces import Episode

EVERY: Final = 50  # movements from one point of a curve to the next


class Watched(Protocol):
    """The parts of a run that a board looks at."""

    @property
    def config(self) -> Any: ...
    @property
    def environment(self) -> Environment: ...
    @property
    def learner(self) -> Any: ...
    @property
    def benchmark(self) -> Benchmark: ...


class BoardListener:
    """Shows what a run does.

    Args:
        folder: of the run; its event files stay as they are until ``begin``.
        parts: of the run.
        seconds: gives the seconds spent so far, by what they were spent on.
        curves: gives what a forward model has learnt from the last movement, by tag.
    """

    def __init__(
        self,
        folder: Path,
        parts: Watched,
        seconds: Callable[[], Mapping[str, float]],
        curves: Callable[[], Mapping[str, float]] = dict,
    ) -> None:
        self._parts, self._seconds, self._curves, self._file = parts, seconds, curves, EventFile(folder)
        self._movements = self._drawn_at = 0
        self._page: dict[str, dict[str, str]] = {}
        self._behaviour = Behaviour(getattr(parts.learner.autonomous, "tolerance", 0.02))
        self._competent = Competent(parts.benchmark.goals, parts.benchmark.side / 2, parts.environment.outcomes)
        rows = "\n".join(f"| {name} | {value} |" for name, value in parts.config.settings.items())
        self._file.text(0, "about/settings", f"| option | value |\n|---|---|\n{rows}")
        rows = "\n".join(f"| **{tag if '/' in tag else f'{tag}/…'}** | {what} |" for tag, what in LEGEND.items())
        self._file.text(
            0,
            "about/legend",
            f"Steps are movements; distances are in the unit of T.\n\n| tag | what it shows |\n|---|---|\n{rows}",
        )

    def episode(self, episode: Episode, replayed: bool) -> None:
        """Count a movement; every 50th gives the curves a point. When a recorded one was made, nobody knows."""
        self._movements = episode.index + 1
        self._behaviour.episode(episode)
        if self._movements % EVERY == 0:
            self._scalars({**self._behaviour.curves(), **of_regions(self._parts.learner.regions)})
            if not replayed:
                self._scalars({f"time/{name.removeprefix('seconds_')}": s for name, s in self._seconds().items()})
        self._scalars(self._curves())

    def evaluated(self, movements: int, found: Mapping[str, Evaluation]) -> None:
        """Show an evaluation by each answer, "own" among them; of the others only the mean error. Pictures take as long
        as 100 movements, so they are drawn when the number of movements has doubled, and at the end."""
        own = found["own"]
        others = {f"answers/{answer}": each.mean_error for answer, each in found.items() if answer != "own"}
        self._scalars({**self._competent.curves(own), **others})
        if movements >= 2 * self._drawn_at or movements == self._parts.config.movements:
            self._drawn_at = movements
            self._draw(own)

    def begin(self) -> None:
        """The replay is over: replace earlier event files."""
        self._file.begin()

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._file.flush()

    def close(self) -> None:
        """The run has ended, or was stopped."""
        self._file.close()

    def _scalars(self, values: Mapping[str, float]) -> None:
        self._file.scalars(self._movements, values)
        page = charts(self._file.tags, self._parts.environment.outcomes.amount(self._competent.near, ".2g"))
        if page != self._page:  # a chart appears with its first point
            self._page = page
            self._file.layout(page)

    def _draw(self, found: Evaluation) -> None:
        parts, space, regions = self._parts, self._parts.environment.outcomes, self._parts.learner.regions
        for tag, png in draw(regions, space, parts.benchmark.goals, found.errors).items():
            self._file.image(self._movements, tag, png)
