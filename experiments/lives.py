"""Lives that are no runs of `sgimd run`: jobs of a sweep, each of which leaves the rows of a table in a file.

    failures = sweep([Life("robots.csv", (800, "practice", 280), 1000)], Machine(2), on_end=partial(collect, results))
A life that was stopped begins again, as its movements are not recorded.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Final

from sgimd_torch.files import write_text
from table import TABLES, merge

HERE: Final = str(Path(__file__).parent)
MAKERS: Final = {
    "robots.csv": "random_robots",
    "changes.csv": "changing",
    "refinement.csv": "refinement",
    "others.csv": "other_programs",
}
"""Module of a table, with a function life(*key) -> the other columns of a row, by the last part of its key."""


@dataclass(frozen=True)
class Life:
    """A job of a sweep.

    Args:
        table: file name of the table of its rows.
        key: first columns of these rows.
        movements: number of movements.
        out: folder of all runs.
    """

    table: str
    key: tuple[Any, ...]
    movements: int
    out: Path = Path("runs")

    @property
    def title(self) -> str:
        return " ".join(map(str, self.key))

    @property
    def directory(self) -> Path:
        return self.out / self.table.removesuffix(".csv") / self.title / "life"

    @property
    def program(self) -> tuple[str, ...]:
        asked = json.dumps([self.table, self.key, str(rows_of(self).absolute())])
        return f"import sys; sys.path.insert(0, {HERE!r}); import lives; sys.exit(lives.live())", asked


def live() -> int:
    """In the process of a life: make it, and write its rows."""
    table, key, path = json.loads(sys.argv[1])
    made = import_module(MAKERS[table]).life(*key)
    rows = [dict(zip(TABLES[table][1], (*key, at, *numbers), strict=False)) for at, numbers in made.items()]
    write_text(path, json.dumps(rows))
    return 0


def rows_of(life: Life) -> Path:
    """The file of a life's rows."""
    return life.directory.with_suffix(".json")


def collect(results: Path, life: Life) -> None:
    """Merge the rows of a life that has ended into their table."""
    merge(results, life.table, json.loads(rows_of(life).read_text(encoding="utf-8")))
