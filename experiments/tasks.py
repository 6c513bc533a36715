"""One run of a comparison: how it is started, and the rows that it leaves in the tables of results.

tasks = tasks_of(["learners"], [], range(10), Path("runs")); child = tasks[0].start(); tasks[0].harvest(tables)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from read_results import GOALS_HEADER, HEADER
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import SHIPPED, Benchmark, load_benchmark
from sgimd_torch.runs.children import Child
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.log import RunError, make_folder
from sgimd_torch.runs.read import Run, read_run
from sgimd_torch.runs.tasks import arm_benchmark
from sgimd_torch.spaces import Array
from tables import Key, Table
from variants import EXPERIMENTS, FEW, FORWARD_MODEL, HALF, PAPER, TABLES, teacher_of

# Columns of the tables, and which of them tell one row from another.
RESULTS: Final = (HEADER, ("variant", "seed", "movements"))
GOALS: Final = (GOALS_HEADER, ("variant", "seed"))
GOALS_TABLE: Final = "goals.csv"
COLUMNS: Final = {PAPER: RESULTS, FORWARD_MODEL: RESULTS, GOALS_TABLE: GOALS}
CORNER = -1.0  # m, where the tiles of a benchmark begin in x and y: T's, be it the paper's or an arm's
NEAR = 1.5  # m from the base: goals farther away cannot be reached
# These measure the noise floor: as much work as all the rest.
FLOORS = ("learners", "teachers", "long", "letter", "forward-model")
FLOOR_AT = (5000, 10_000)


@dataclass(frozen=True)
class Task:
    """One run: a variant of an experiment and a seed."""

    experiment: str
    config: Config

    @property
    def title(self) -> str:
        """For people."""
        return f"{self.config.variant} seed {self.config.seed}"

    @property
    def table(self) -> str:
        """Which table its evaluations go to."""
        return TABLES.get(self.experiment, PAPER)

    @property
    def tables(self) -> list[str]:
        """All that it leaves rows in."""
        return [self.table, *([GOALS_TABLE] if self.experiment == "large-space" else [])]

    @property
    def last_row(self) -> Key:
        """Key of the last row in its ``table``; who has it has them all."""
        return self.config.variant, str(self.config.seed), str(self.config.movements)

    @property
    def work(self) -> float:
        """Movements that the robot makes in this run, evaluations included."""
        evaluations, floor_at = self.config.evaluations, self.config.floor_at
        floors = [movements for movements in evaluations if floor_at is None or movements in floor_at]
        own = 0 if self.config.algorithm == "observation" else self.config.movements
        n_goals = len(_benchmark(self.config.environment, self.config.benchmark).goals)
        return own + n_goals * (len(evaluations) + self.config.repeats * len(floors))

    def start(self) -> Child:
        """In a process of its own, which goes on with what is there.

        Raises:
            RunError, OSError: there is no place to write.
        """
        directory = self.config.directory
        make_folder(directory.parent)
        return Child(self.title, directory, self.config.movements, directory.with_suffix(".log"), self.options())

    def options(self) -> list[str]:
        """The command line of run.py that makes this run."""
        given = {field.name: getattr(self.config, field.name) for field in fields(Config)}
        changed = [field.name for field in fields(Config) if given[field.name] != field.default]
        return [f"--{name}={_word(given[name])}" for name in changed]

    def harvest(self, tables: Mapping[str, Table]) -> None:
        """Write the rows of the finished run.

        Args:
            tables: those that ``tables`` names.

        Raises:
            RunError: its files are damaged, or it was not evaluated at its end.
            OSError: a table cannot be written.
        """
        run = read_run(self.config.directory)
        if self.config.movements not in run.evaluation["movements"]:
            raise RunError(f"{run.path} has no evaluation after {self.config.movements} movements, though it ended")
        if self.experiment == "large-space":
            tables[GOALS_TABLE].append([goal_row(self, run)])
        tables[self.table].append(result_rows(self, run))  # last: it is what counts as done


def tasks_of(experiments: Sequence[str], only: Sequence[str], seeds: range, out: Path) -> list[Task]:
    """All runs that are wanted, seed by seed, so that every variant has its first ones early.

    Args:
        experiments: names in ``EXPERIMENTS``.
        only: of their variants only these; empty for all.
        seeds: of each.
        out: where runs go; the subsets of ``make_subsets`` lie in ``out/demonstrations``.
    """
    tasks = []
    for seed in seeds:
        for experiment in experiments:
            for variant, line in EXPERIMENTS[experiment].items():
                if only and variant not in only:
                    continue
                changes = dict(line)
                if changes.get("demonstrations") in (Path(FEW), Path(HALF)):
                    changes["demonstrations"] = out / "demonstrations" / changes["demonstrations"]
                floor_at = FLOOR_AT if experiment in FLOORS else ()
                whole = {"seed": seed, "out": out, "name": variant, "floor_at": floor_at, **changes}
                tasks.append(Task(experiment, Config(**whole)))
    return tasks


def result_rows(task: Task, run: Run) -> list[list[object]]:
    """A row of ``RESULTS`` for each evaluation of a finished run."""
    config, benchmark = task.config, _benchmark(task.config.environment, task.config.benchmark)
    evaluations = zip(*(run.evaluation[name] for name in ("movements", "mean_error_m", "noise_floor_m")), strict=True)
    return [
        [
            *(task.experiment, config.variant, teacher_of(config), config.task_space, config.seed),
            *(int(movements), float(error), float(floor)),
            tiles_reached(run.outcomes[: int(movements)], benchmark),
        ]
        for movements, error, floor in evaluations
    ]


def goal_row(task: Task, run: Run) -> list[object]:
    """A row of ``GOALS``: how many goals a learner chose for itself, and how many of them near enough to be reached."""
    goals = run.chosen_goals()
    return [task.config.variant, task.config.seed, len(goals), int((np.linalg.norm(goals, axis=1) <= NEAR).sum())]


def tiles_reached(outcomes: Array, benchmark: Benchmark) -> int:
    """How many of the benchmark's tiles, one for each of its goals, hold one of the ``outcomes`` or more.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: its tiles were laid out from ``CORNER``, whatever T these goals came from.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    reached, wanted = (
        {tuple(tile) for tile in np.floor((points - CORNER) / benchmark.side).tolist()}
        for points in (landed, benchmark.goals)
    )
    return len(reached & wanted)


@cache
def _benchmark(environment: str, path: Path | None) -> Benchmark:
    if path is None and environment.startswith("planar-arm-"):
        return arm_benchmark(PlanarArm(int(environment[11:])))
    return load_benchmark(path or SHIPPED)


def _word(value: object) -> str:
    """As the command line of run.py has it."""
    if isinstance(value, tuple):
        return f"[{','.join(map(str, value))}]"
    return "null" if value is None else str(value)
