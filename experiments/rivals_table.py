"""The search for settings of the rivals: which setting of each was the best on tuning seeds.

    for each in means(Table(Path("results/rivals.csv"), COLUMNS, KEY), ["cma-mae"], 5000)["cma-mae"]: print(each)
tune_rivals.py makes the rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np

from read_results import LAST
from tables import Table

COLUMNS: Final = ("rival", "setting", "seed", "movements", "linear_error_m", "process_error_m")
KEY: Final = ("rival", "setting", "seed", "movements")
DEFAULT: Final = "default"
EARLY: Final = 1000


def in_words(setting: Mapping[str, Any]) -> str:
    """A setting as a field of the table: ``sd=0.2``; ``default`` for none."""
    return " ".join(f"{name}={value}" for name, value in setting.items()) or DEFAULT


class Mean(NamedTuple):
    """Of a setting over its ``seeds``: the errors (m) by both yardsticks."""

    setting: str
    linear: float
    process: float
    seeds: int


def means(table: Table, names: Sequence[str], last: int) -> dict[str, list[Mean]]:
    """Rival -> its settings after the ``last`` movements, the best by both yardsticks together first."""
    errors: dict[str, dict[str, list[list[float]]]] = {name: {} for name in names}
    for name, setting, _, movements, *found in table.rows().values():
        if name in errors and movements == str(last):
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
    """A row for each setting of each rival, the best first, the default bold: seeds, errors (m) early and late."""
    table = Table(path, COLUMNS, KEY)
    names = list(dict.fromkeys(rival for rival, *_ in table.rows().values()))
    early, late = means(table, names, EARLY), means(table, names, LAST)
    rows = []
    for name in names:
        before = {each.setting: each for each in early[name]}
        for setting, linear, process, seeds in late[name]:
            shown = f"**{setting}**" if setting == DEFAULT else f"`{setting}`"
            first = before[setting]
            errors = (first.linear, first.process, linear, process)
            rows.append([f"`{name}`", shown, str(seeds), *(f"{error:.4f}" for error in errors)])
    return rows
