"""The table of results: one row for each evaluation of a run by one inverse model, read and written with pandas.

    table = read_table(Path("results")); table[table.experiment == "learners"]
    merge(Path("results"), "results.csv", result_rows("learners", config, run))
A row made again from a run is the row that was there, byte for byte. Small tables beside it have the rest.
"""

from __future__ import annotations

import fcntl
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from scipy.spatial import KDTree

from sgimd_torch.catalogue import ROD
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.files import make_folder, write_text
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.config import OWN, Config
from sgimd_torch.runs.read import Run, find_runs, read_run
from sgimd_torch.runs.tasks import benchmark_of, demonstrations_of
from sgimd_torch.spaces import Array
from sgimd_torch.teachers.answering import middle
from variants import ARMS, teacher_of

Row = dict[str, Any]
FILE: Final = "results.csv"
ERROR, FLOOR, MET = "mean_error", "noise_floor", "goals_met"  # columns of a run's record
_ASKED: Final = ("requests", "shown", "late", "late_own", "strong", "weak")
# The columns of each table, and how many of them make its key, which no two rows share.
TABLES: Final[dict[str, tuple[int, tuple[str, ...]]]] = {
    FILE: (
        5,
        (
            *("experiment", "variant", "seed", "movements", "answer", "own", "environment", "teacher", "task_space"),
            *("error", "floor", "tiles", "claimed", "met"),
        ),
    ),
    "goals.csv": (2, ("variant", "seed", "n_goals", "n_near")),
    "asked.csv": (3, ("variant", "seed", "teacher", *_ASKED)),
    "contexts.csv": (3, ("variant", "seed", "low", "high", "error")),
    "said.csv": (1, ("claim", "number", "verdict")),
    "rivals.csv": (4, ("rival", "setting", "seed", "movements", "linear", "process")),
}
TYPES: Final = {  # of columns, in every table; all others have numbers, whose empty fields are NaN
    **dict.fromkeys(("experiment", "variant", "answer", "environment", "teacher", "rival", "setting"), "str"),
    **dict.fromkeys(("claim", "number", "verdict"), "str"),
    **dict.fromkeys(("seed", "movements", "own", "tiles", "n_goals", "n_near", *_ASKED), "int64"),
    **dict.fromkeys(("claimed", "met"), "Int64"),  # may be empty
}
LATE: Final = 1000  # movements; from then on a learner should know whom to ask
CORNER = -1.0  # m, where the tiles of a benchmark begin in x and y: the corner of T, of rod and arms
NEAR = 1.5  # m from the base: goals farther away cannot be reached


class ResultsError(ValueError):
    """A table of results that is missing or damaged."""


def read_table(folder: Path, name: str = FILE) -> pd.DataFrame:
    """A table of the folder; empty without a file.

    Raises:
        ResultsError: it is another table, or a row of it makes no sense.
        OSError: it cannot be read.
    """
    path, (n_key, columns) = folder / name, TABLES[name]
    types = {column: TYPES.get(column, "float64") for column in columns}
    if not path.exists():
        return pd.DataFrame({column: pd.Series(dtype=kind) for column, kind in types.items()})
    exact = {
        column: lambda text: float(text or "nan") for column, kind in types.items() if kind in ("float64", "Int64")
    }
    others = {column: kind for column, kind in types.items() if column not in exact}
    try:
        if (header := path.read_text(encoding="utf-8").partition("\n")[0]) != ",".join(columns):
            raise ValueError(f"it must begin with {','.join(columns)}, got {header[:100]!r}; is it another table?")
        table = pd.read_csv(path, dtype=others, converters=exact, keep_default_na=False).astype(types)
    except ValueError as error:
        raise ResultsError(f"{path} cannot be read: {error}") from error
    numbers = table.drop(columns=["low", "high"], errors="ignore").select_dtypes("number").astype(float)
    wrong = table.duplicated([*columns[:n_key]]) | (table[columns[0]] == "") | (numbers < 0).any(axis=1)
    wrong |= np.isinf(numbers).any(axis=1) | (numbers["error"].isna() if "error" in numbers else False)
    if wrong.any():
        raise ResultsError(f"{path}, line {int(wrong.to_numpy().argmax()) + 2} makes no sense; was it edited?")
    return table


def merge(folder: Path, name: str, rows: Sequence[Row]) -> None:
    """Add rows to a table, or put them in the place of those with the same key; then all are sorted by their keys.

    Raises:
        ResultsError: see ``read_table``.
        OSError: it cannot be written; then it is unchanged.
    """
    make_folder(folder)
    n_key, columns = TABLES[name]
    with open(folder / ".lock", "w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)  # until no other process changes a table of this folder
        table = read_table(folder, name)
        if rows:
            table = pd.concat([table, pd.DataFrame(rows, columns=[*columns]).astype(table.dtypes.to_dict())])
        key = [*columns[:n_key]]
        write_table(folder, name, table.drop_duplicates(key, keep="last").sort_values(key))


def write_table(folder: Path, name: str, table: pd.DataFrame) -> None:
    """Replace a table. Numbers read back exactly; NaN is left empty."""
    write_text(folder / name, table.to_csv(index=False, lineterminator="\n"))


def read_seeds(folder: Path, variant: str) -> list[Run]:
    """All runs of a variant in a folder of run directories, finished or not; there may be none.

    Raises:
        RunError: one is damaged.
    """
    if not (folder / variant).is_dir():
        return []
    return [read_run(path) for paths in find_runs(folder / variant).values() for path in paths]


def result_rows(experiment: str, config: Config, run: Run) -> list[Row]:
    """A row of results.csv for each evaluation of a finished run and each of its answers.

    The answer of the learner's own inverse model goes by the name of that model, with 1 in the column ``own``.
    """
    benchmark, low = _benchmark(config["environment"], config.benchmark)
    corner = CORNER if config["environment"] in (ROD, *ARMS) else low
    run_of = (experiment, config.variant, config.seed)
    place = (config["environment"], teacher_of(config), config.values.get("environment.task_space", 1.0))
    rows: dict[tuple[int, str], Row] = {}
    for answer, found in sorted(run.answers.items(), key=lambda each: each[0] == OWN):  # own last: it has the floor
        name = own_answer(config) if answer == OWN else answer
        columns = (found["movements"].astype(int), found[ERROR], found[FLOOR], found[MET])
        for movements, error, floor, met in zip(*(column.tolist() for column in columns), strict=True):
            landed = run.outcomes[:movements]
            reached = tiles_reached(landed, benchmark, corner), goals_claimed(landed, benchmark)
            values = (
                *run_of,
                movements,
                name,
                int(answer == OWN),
                *place,
                error,
                floor,
                *reached,
                None if np.isnan(met) else int(met),
            )
            rows[movements, name] = dict(zip(TABLES[FILE][1], values, strict=True))
    return [*rows.values()]


def own_answer(config: Config) -> str:
    """The name of the inverse model by which a learner answers."""
    return str(config.values.get("inverse", "process"))


def goal_rows(config: Config, run: Run) -> list[Row]:
    """The row of goals.csv: how many goals a learner chose for itself, and how many of them can be reached; none for a
    learner without goals."""
    goals = run.chosen_goals()
    near = int((np.linalg.norm(goals, axis=1) <= NEAR).sum())
    return (
        [{"variant": config.variant, "seed": config.seed, "n_goals": len(goals), "n_near": near}] if len(goals) else []
    )


def asked_rows(config: Config, run: Run) -> list[Row]:
    """A row for each teacher that could be asked: how often, and where; none for a learner that does not ask.

    ``late``: from movement 1000 on, ``late_own``: of these in the teacher's half (if teachers have one); ``strong`` and
    ``weak``: where the first context is in the outer and in the inner third of its range.
    """
    if "teachers" not in config:
        return []
    task = task_of(config)
    dim, contexts = task.environment.contexts.dim, task.environment.contexts
    nothing: Any = dict.fromkeys(("index", "reply", "teacher", "wanted_0", f"wanted_{dim}"), ())
    asked = pd.DataFrame(run.requests or nothing)
    low_half = asked[f"wanted_{dim}"] < middle(demonstrations_of(task, config.demonstrations)[0])
    border = (2 * (asked["wanted_0"] - contexts.low[0]) / contexts.sides[0] - 1).abs() if dim else 0 * asked["index"]
    late = asked["index"] >= LATE
    rows: list[Row] = []
    for teacher in config["teachers"]:
        own = low_half if teacher == "low-half" else ~low_half
        mine, shown, near = asked["teacher"] == teacher, asked["reply"] == "shown", (border < 1 / 3) & bool(dim)
        counted = (mine, mine & shown, mine & late, mine & late & own, mine & (border > 2 / 3), mine & near)
        values = (config.variant, config.seed, teacher, *(int(each.sum()) for each in counted))
        rows.append(dict(zip(TABLES["asked.csv"][1], values, strict=True)))
    return rows


def context_rows(config: Config, run: Run) -> list[Row]:
    """A row for each third of C that had goals in the last evaluation; none where there is no context, or several."""
    if run.contexts.shape[1] != 1:
        return []
    errors, space = pd.DataFrame(run.errors), run.spaces["contexts"]
    errors = errors[(errors["movements"] == errors["movements"].max()) & (errors["answer"] == OWN)]
    edges = np.linspace(space.low[0], space.high[0], 4)
    means = errors["error"].groupby(np.clip(np.searchsorted(edges, errors["context_0"], "right") - 1, 0, 2)).mean()
    return [
        {"variant": config.variant, "seed": config.seed, "low": edges[k], "high": edges[k + 1], "error": error}
        for k, error in means.items()
    ]


ROWS: Final = {"goals.csv": goal_rows, "asked.csv": asked_rows, "contexts.csv": context_rows}


def tiles_reached(outcomes: Array, benchmark: Benchmark, corner: Array | float = CORNER) -> int:
    """How many of the benchmark's tiles, one for each of its goals, hold one or more of the ``outcomes``.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: its tiles were laid out from ``corner``, those of rod and arms from -1 m, whatever their T.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    reached, wanted = (
        {tuple(tile) for tile in np.floor((points - corner) / benchmark.side).tolist()}
        for points in (landed, benchmark.goals)
    )
    return len(reached & wanted)


def goals_claimed(outcomes: Array, benchmark: Benchmark) -> int:
    """How many of the benchmark's goals have one or more of the ``outcomes`` within half a tile's side.

    These are claims: noise may have carried a movement there once. Goals that are met were reached in an evaluation.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: its goals.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    if not len(landed):
        return 0
    distances, _ = KDTree(landed).query(benchmark.goals)
    return int((distances <= benchmark.side / 2).sum())


@cache
def _benchmark(environment: str, path: Path | None) -> tuple[Benchmark, Array]:
    """With the lower corner of T."""
    task = task_of(Config(parts={"environment": environment}))
    return benchmark_of(task, path)[0], task.environment.outcomes.low
