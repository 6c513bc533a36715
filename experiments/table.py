"""The table of results: one row for each evaluation of a run by one inverse model, read and written with pandas.

    table = read_table(Path("results")); table[table.variant == "sgim-d"]
    merge(Path("results"), "results.csv", result_rows(config, run))
A row that is made again from the same run is equal, byte for byte. explored.csv and asked.csv have further numbers.
Most tables tell by which learning a row was made, see `LEARNING`. The first new row of a variant or learner removes its
rows of other learning.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd
from filelock import FileLock

from sgimd_torch.evaluation import Benchmark
from sgimd_torch.extras.asking.teachers import middle
from sgimd_torch.files import checksum, make_folder, write_text
from sgimd_torch.options.config import OWN, Config
from sgimd_torch.runs.plan import task_of
from sgimd_torch.runs.read import Run
from sgimd_torch.spaces import Array
from sgimd_torch.tasks import benchmark_of
from sgimd_torch.tasks.taught import demonstrations_of

Row = dict[str, Any]
REFERENCE: Final = Path(__file__).parents[1] / "tests" / "helpers" / "reference.npz"
LEARNING: Final = checksum(REFERENCE)
"""Name of the learning of this library: checksum of the numbers that tests/learner/test_reference.py compares."""
FILE: Final = "results.csv"
ALIKE: Final = "process"  # inverse model that answers for every learner
_RATIO: Final = ("ratio", "low", "high")
_ASKED: Final = ("requests", "shown", "late", "late_own")
# Of each table: the number of columns that form its key, and all columns, the key first. Keys of rows are unique.
TABLES: Final[dict[str, tuple[int, tuple[str, ...]]]] = {
    FILE: (4, ("variant", "seed", "movements", "answer", "error", "floor", "learning")),
    "explored.csv": (2, ("variant", "seed", "tiles", "goals", "near", "learning")),
    "asked.csv": (3, ("variant", "seed", "teacher", *_ASKED, "learning")),
    "robots.csv": (4, ("number", "learner", "seed", "movements", "error", "noticed", "learning")),
    "model_files.csv": (3, ("file", "outcome", "options", "version", "told", "words", "practice", "random", *_RATIO)),
    "refinement.csv": (
        3,
        ("robot", "seed", "search", "movements", "seconds", "error", "movements_then", "seconds_then", "error_then"),
    ),
    "others.csv": (4, ("robot", "learner", "seed", "movements", "error", "ours", "ms", "ms_answer", "learning")),
    "changes.csv": (5, ("robot", "change", "learner", "seed", "movements", "error", "noticed", "learning")),
}
TYPES: Final = {  # types of columns; all other columns have floats, and an empty field is NaN
    **dict.fromkeys(("number", "seed", "movements", "movements_then", "tiles", *_ASKED), "int64"),
    **dict.fromkeys(("variant", "answer", "teacher", "learner", "learning"), "str"),
    **dict.fromkeys(("robot", "change", "search", "file", "outcome", "options", "version", "told", "words"), "str"),
    **dict.fromkeys(("goals", "near", "noticed"), "Int64"),  # with empty fields
}
LATE: Final = 1000  # number of movements after which requests count as late: the learner should know whom to ask
CORNER: Final = -1.0  # m, least x and y of the tiles of the rod's benchmark
NEAR: Final = 1.5  # m, distance from the base; goals farther away cannot be reached


class ResultsError(ValueError):
    """A table of results that is missing or damaged."""


def read_table(folder: Path, name: str = FILE) -> pd.DataFrame:
    """The table of this name in the folder; an empty table if there is no such file.

    Raises:
        ResultsError: the file is another table, or one of its rows is damaged.
        OSError: the file cannot be read.
    """
    path, (n_key, columns) = folder / name, TABLES[name]
    types = {column: TYPES.get(column, "float64") for column in columns}
    if not path.exists():
        return pd.DataFrame({column: pd.Series(dtype=kind) for column, kind in types.items()})
    # Python's float() reads the numbers, because the parser of pandas may change the last digit.
    exact = {column: _number for column, kind in types.items() if kind in ("float64", "Int64")}
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
    """Add rows to a table in the order of their keys; a new row replaces an old row with the same key.

    In a table with the column ``learning``, new rows have `LEARNING`, and replace the rows of other learning that have
    the same variant or learner.

    Raises:
        ResultsError: see ``read_table``.
        OSError: the table cannot be written and stays unchanged.
    """
    make_folder(folder)
    n_key, columns = TABLES[name]
    with FileLock(folder / ".lock"):  # waits until no other process changes a table of this folder
        table = read_table(folder, name)
        if rows:
            new = pd.DataFrame(rows, columns=[*columns])
            if "learning" in columns:
                group = "variant" if "variant" in columns else "learner"
                table = table[(table["learning"] == LEARNING) | ~table[group].isin(new[group])]
                new["learning"] = LEARNING
            table = pd.concat([table, new.astype(table.dtypes.to_dict())])
        key = [*columns[:n_key]]
        write_table(folder, name, table.drop_duplicates(key, keep="last").sort_values(key))


def write_table(folder: Path, name: str, table: pd.DataFrame) -> None:
    """Replace a table. ``read_table`` gets equal numbers; NaN is an empty field."""
    write_text(folder / name, table.to_csv(index=False, lineterminator="\n"))


def result_rows(config: Config, run: Run) -> list[Row]:
    """Rows of results.csv: one for each evaluation of a finished run by each of its `answers_of`.

    For the learner's own inverse model, the column ``answer`` has its name in the catalogue.
    """
    rows: list[Row] = []
    key = {"variant": config.variant, "seed": config.seed}
    for inverse, evaluation in run.evaluations.items():
        name = own_answer(config) if inverse == OWN else inverse
        evaluations = (evaluation[column].tolist() for column in ("movements", "mean_error", "noise_floor"))
        for movements, error, floor in zip(*evaluations, strict=True):
            rows.append({**key, "movements": movements, "answer": name, "error": error, "floor": floor})
    return rows


def own_answer(config: Config) -> str:
    """The name of a learner's inverse model in the catalogue; practice has `process`, fitted to effective movements."""
    return str(config.values.get("inverse", "process")).replace("among-effects", "process")


def answers_of(config: Config) -> tuple[str, ...]:
    """Names of the inverse models in the evaluations of a run: its own, and `process`, which answers for all."""
    return (OWN,) if own_answer(config) == ALIKE else (OWN, ALIKE)


def explored_rows(config: Config, run: Run) -> list[Row]:
    """The row of explored.csv: numbers of benchmark tiles reached, of goals chosen by the learner, and of goals among
    them that can be reached."""
    goals = run.chosen_goals()
    benchmark = benchmark_of(task_of(Config()), config.benchmark)[0]
    tiles, near = tiles_reached(run.outcomes, benchmark), int((np.linalg.norm(goals, axis=1) <= NEAR).sum())
    return [{"variant": config.variant, "seed": config.seed, "tiles": tiles, "goals": len(goals), "near": near}]


def asked_rows(config: Config, run: Run) -> list[Row]:
    """Rows of asked.csv: requests to each teacher that could be asked; none for a learner that does not ask.

    ``late`` counts requests from movement 1000 on, ``late_own`` late requests in the teacher's half of T.
    """
    if config.teaching != "teachers":
        return []
    task = task_of(config)
    dim = task.environment.contexts.dim
    nothing: Any = dict.fromkeys(("index", "reply", "teacher", f"wanted_{dim}"), ())
    asked = pd.DataFrame(run.requests or nothing)
    late = asked["index"] >= LATE
    low_half = asked[f"wanted_{dim}"] < middle(demonstrations_of(task, config.demonstrations)[0])
    counted = pd.DataFrame(
        {
            "requests": asked["index"] >= 0,
            "shown": asked["reply"] == "shown",
            "late": late,
            "late_own": late & (low_half == (asked["teacher"] == "low-half")),
        }
    )
    teachers = config["teachers"] or ("all",)
    counts = counted.groupby(asked["teacher"]).sum().reindex(teachers, fill_value=0).astype(int)
    key = {"variant": config.variant, "seed": config.seed}
    return [{**key, "teacher": word.rpartition(":")[2], **row} for word, row in counts.to_dict("index").items()]


ROWS: Final = {"explored.csv": explored_rows, "asked.csv": asked_rows}


def _number(text: str) -> float:
    return float(text or "nan")


def tiles_reached(outcomes: Array, benchmark: Benchmark) -> int:
    """The number of benchmark tiles that contain one or more ``outcomes``; each goal has a tile.

    Args:
        outcomes: ``(n, 2)`` m, NaN if the robot was at rest.
        benchmark: benchmark of the rod, whose tiles begin at ``CORNER`` in every T.
    """
    landed = outcomes[np.isfinite(outcomes).all(axis=1)]
    reached, wanted = (
        {tuple(tile) for tile in np.floor((points - CORNER) / benchmark.side).tolist()}
        for points in (landed, benchmark.goals)
    )
    return len(reached & wanted)
