"""The table of results: one row for each evaluation of a run by one inverse model, read and written with pandas.

    table = read_table(Path("results")); table[table.experiment == "learners"]
    merge(Path("results"), "results.csv", result_rows("learners", config, run))
A row made again from a run is the row that was there, byte for byte. Small tables beside it have the rest.
"""

from __future__ import annotations

import fcntl
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from sgimd_torch.asking.teachers import middle
from sgimd_torch.evaluation import Benchmark
from sgimd_torch.files import make_folder, write_text
from sgimd_torch.runs.build import task_of
from sgimd_torch.runs.config import OWN, Config
from sgimd_torch.runs.read import Run
from sgimd_torch.runs.tasks import benchmark_of, demonstrations_of
from sgimd_torch.spaces import Array
from variants import ALIKE, ANSWERS

Row = dict[str, Any]
FILE: Final = "results.csv"
_ASKED: Final = ("requests", "shown", "late", "late_own", "strong", "weak")
# The columns of each table, and how many of them make its key, which no two rows share.
TABLES: Final[dict[str, tuple[int, tuple[str, ...]]]] = {
    FILE: (6, ("experiment", "variant", "task", "seed", "movements", "answer", "error", "floor")),
    "explored.csv": (2, ("variant", "seed", "tiles", "goals", "near")),
    "asked.csv": (3, ("variant", "seed", "teacher", *_ASKED)),
    "rivals.csv": (4, ("rival", "setting", "seed", "movements", "linear", "process")),
}
TYPES: Final = {  # of columns, in every table; all others have numbers, whose empty fields are NaN
    **dict.fromkeys(("experiment", "variant", "task", "answer", "teacher", "rival", "setting"), "str"),
    **dict.fromkeys(("seed", "movements", "tiles", *_ASKED), "int64"),
    **dict.fromkeys(("goals", "near"), "Int64"),  # may be empty
}
LATE: Final = 1000  # movements; from then on a learner should know whom to ask
CORNER: Final = -1.0  # m, where the tiles of the rod's benchmark begin in x and y
NEAR: Final = 1.5  # m from the base: goals farther away cannot be reached


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
    numbers = table.select_dtypes("number").astype(float)
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


def result_rows(experiment: str, config: Config, run: Run) -> list[Row]:
    """A row of results.csv for each evaluation of a finished run by each of the answers that pages read.

    The answer of the learner's own inverse model goes by the name of that model.
    """
    rows: list[Row] = []
    for answer, found in run.answers.items():
        name = own_answer(config) if answer == OWN else answer
        if name in ANSWERS.get(experiment, ALIKE):
            evaluations = (found[column].tolist() for column in ("movements", "mean_error", "noise_floor"))
            for movements, error, floor in zip(*evaluations, strict=True):
                values = (
                    experiment,
                    config.variant,
                    task_name(config),
                    config.seed,
                    int(movements),
                    name,
                    error,
                    floor,
                )
                rows.append(dict(zip(TABLES[FILE][1], values, strict=True)))
    return rows


def own_answer(config: Config) -> str:
    """The name of the inverse model by which a learner answers; that of practice is `process`, of its effects alone."""
    return str(config.values.get("inverse", "process")).replace("among-effects", "process")


def answers_of(experiment: str, config: Config) -> tuple[str, ...]:
    """Who answers in the evaluations of a run: its own inverse model first, then the others that pages read.

    A forward model and eq. (9) answer only for the learners that learn with them.
    """
    others = {"process", "linear", "nearest"}.intersection(ANSWERS.get(experiment, ALIKE)) - {own_answer(config)}
    return (OWN, *sorted(others))


def task_name(config: Config) -> str:
    """The robot's word, and what is not as usual about it: ``fishing-rod task_space=100``."""
    usual = Config.from_settings({"environment": config["environment"]}).values
    options = {name.removeprefix("environment."): value for name, value in config.values.items()
               if name.startswith("environment.") and value != usual[name]}  # fmt: skip
    return " ".join([config["environment"], *(f"{name}={value:g}" for name, value in options.items())])


def explored_rows(config: Config, run: Run) -> list[Row]:
    """The row of explored.csv: tiles of the benchmark that were reached, the goals that a learner chose for itself, and
    how many of them can be reached."""
    goals = run.chosen_goals()
    benchmark = benchmark_of(task_of(Config()), config.benchmark)[0]
    tiles, near = tiles_reached(run.outcomes, benchmark), int((np.linalg.norm(goals, axis=1) <= NEAR).sum())
    return [{"variant": config.variant, "seed": config.seed, "tiles": tiles, "goals": len(goals), "near": near}]


def asked_rows(config: Config, run: Run) -> list[Row]:
    """A row for each teacher that could be asked: how often, and where; none for a learner that does not ask.

    ``late``: from movement 1000 on, ``late_own``: of these in the teacher's half (if teachers have one); ``strong`` and
    ``weak``: where the first context is in the outer and in the inner third of its range.
    """
    if config.teaching != "teachers":
        return []
    task = task_of(config)
    dim, contexts = task.environment.contexts.dim, task.environment.contexts
    nothing: Any = dict.fromkeys(("index", "reply", "teacher", "wanted_0", f"wanted_{dim}"), ())
    asked = pd.DataFrame(run.requests or nothing)
    low_half = asked[f"wanted_{dim}"] < middle(demonstrations_of(task, config.demonstrations)[0])
    border = (2 * (asked["wanted_0"] - contexts.low[0]) / contexts.sides[0] - 1).abs() if dim else 0 * asked["index"]
    late = asked["index"] >= LATE
    rows: list[Row] = []
    for teacher in config.teachers or ("all",):
        own = low_half if teacher == "low-half" else ~low_half
        mine, shown, near = asked["teacher"] == teacher, asked["reply"] == "shown", (border < 1 / 3) & bool(dim)
        counted = (mine, mine & shown, mine & late, mine & late & own, mine & (border > 2 / 3), mine & near)
        values = (config.variant, config.seed, teacher, *(int(each.sum()) for each in counted))
        rows.append(dict(zip(TABLES["asked.csv"][1], values, strict=True)))
    return rows


ROWS: Final = {"explored.csv": explored_rows, "asked.csv": asked_rows}


def tiles_reached(outcomes: Array, benchmark: Benchmark) -> int:
    """How many of the benchmark's tiles, one for each of its goals, hold one or more of the ``outcomes``.

    Args:
        outcomes: ``(n, 2)`` m, NaN where the robot was at rest.
        benchmark: the rod's; its tiles were laid out from ``CORNER``, whatever its T.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    reached, wanted = (
        {tuple(tile) for tile in np.floor((points - CORNER) / benchmark.side).tolist()}
        for points in (landed, benchmark.goals)
    )
    return len(reached & wanted)
