"""The search for settings of the rivals: which setting of each was the best on tuning seeds.

    for each in means(Table(Path("results/rivals.csv"), COLUMNS, KEY), ["cma-mae"], 5000)["cma-mae"]: print(each)
tune_rivals.py makes the rows.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from read_results import LAST
from tables import Table

COLUMNS: Final = ("rival", "setting", "seed", "movements", "linear_error_m", "process_error_m")
KEY: Final = ("rival", "setting", "seed", "movements")
DEFAULT: Final = "default"
EARLY: Final = 1000
FIRST_ROUND: Final = frozenset((1000, 1001))  # seeds of all settings


def in_words(setting: Mapping[str, Any]) -> str:
    """A setting as a field of the table: ``sd=0.2``; ``default`` for none."""
    return " ".join(f"{name}={value}" for name, value in setting.items()) or DEFAULT


class Mean(NamedTuple):
    """Of a setting over its ``seeds``: the errors (m) by both yardsticks."""

    setting: str
    linear: float
    process: float
    seeds: int


def means(table: Table, names: Sequence[str], last: int, but: Collection[int] = ()) -> dict[str, list[Mean]]:
    """Rival -> its settings after the ``last`` movements, of all seeds ``but`` some; the best first."""
    errors: dict[str, dict[str, list[list[float]]]] = {name: {} for name in names}
    for name, setting, seed, movements, *found in table.rows().values():
        if name in errors and movements == str(last) and int(seed) not in but:
            errors[name].setdefault(setting, []).append([float(each) for each in found])
    return {
        name: sorted(
            (
                Mean._make((setting, *np.mean(found, axis=0).tolist(), len(found)))
                for setting, found in settings.items()
            ),
            key=lambda each: each.linear + each.process,
        )
        for name, settings in errors.items()
    }


def rivals_rows(path: Path) -> list[list[str]]:
    """A row for each setting of each rival, the best of the first round first, the default bold: its errors (m) early
    and late in the first round, and late on the seeds that the best got afterwards."""
    table = Table(path, COLUMNS, KEY)
    keys = table.rows()
    names = list(dict.fromkeys(rival for rival, *_ in keys))
    later = {int(seed) for _, _, seed, _ in keys} - FIRST_ROUND
    rounds = [means(table, names, *of) for of in ((EARLY, later), (LAST, later), (LAST, FIRST_ROUND))]
    return [
        [
            f"`{name}`",
            f"**{setting}**" if setting == DEFAULT else f"`{setting}`",
            *(cell for found in rounds for cell in _in_metres(found[name], setting)),
        ]
        for name in names
        for setting, *_ in rounds[1][name]
    ]


def _in_metres(found: Sequence[Mean], setting: str) -> list[str]:
    each = next((each for each in found if each.setting == setting), None)
    return ["-", "-"] if each is None else [f"{each.linear:.4f}", f"{each.process:.4f}"]
