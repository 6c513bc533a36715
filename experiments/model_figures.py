"""Was the forward model right, and did it know where it was wrong? A figure for each variant, one table.

Only predictions made before the model learnt from their exemplars count. The figure, of a variant's first
run, shows where the last predictions were wrong, whether the spread was honest, and how both changed with time. The
table has a row for each run; table.csv has its numbers unrounded.

  predicted   exemplars predicted before the model learnt from them
  error       distance (m) from prediction to outcome, mean over the last 1000
  inside      share of outcomes inside the regions of 50 / 80 / 95 %: of the last 1000, then from 2000 movements on
  improved    share of the goals with several movements where a later one came nearer than the first
  refreshes   how often the model learnt, and how many of these refreshes diverged; ms is the mean time of one

Example:
  python experiments/model_figures.py runs/model/seed-??? --out results/model
"""

from __future__ import annotations

import argparse
import csv
import io
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from sgimd_torch.runs.process import command, loading

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray
    from tqdm import tqdm

    from figures import REACH
    from read_results import MODEL_HEADER
    from sgimd_torch.figures import predictions as plots
    from sgimd_torch.figures.save import save_figure
    from sgimd_torch.files import make_folder, write_text
    from sgimd_torch.forward_model.diagnostics import LEVELS, coverage, error_by_cell, improvements, running
    from sgimd_torch.runs.log import RunError
    from sgimd_torch.runs.read import Run, read_run
    from sgimd_torch.runs.tables import WHOLE, small_table
    from sgimd_torch.spaces import Array, Box

NEWEST: Final = 1000  # predictions
LATE: Final = 2000  # movements, from which on the spread must be honest
HEAD: Final = (
    *("run", "predicted", "error (m)", "inside 50 / 80 / 95 %", f"from {LATE} on", "improved (%)"),
    *("refreshes", "ms each"),
)


@dataclass(frozen=True, eq=False)
class ModelRun:
    """What the forward model of one run predicted.

    ``movements`` ``(n,)``: executed before each of the predicted ones; ``observed``, ``mean`` and ``spread``
    ``(n, outcome_dim)`` m; ``refreshes`` ``(n_refreshes,)`` for each of its columns.
    """

    run: Run
    movements: NDArray[np.int64]
    observed: Array
    mean: Array
    spread: Array
    refreshes: dict[str, np.ndarray]

    @property
    def name(self) -> str:
        """Such as "sgim-d/seed-003"."""
        return "/".join(self.run.path.resolve().parts[-2:])

    def inside(self, chosen: slice | NDArray[np.bool_], levels: ArrayLike = LEVELS) -> Array:
        """Coverage ``(n_levels,)`` of the ``chosen`` predictions; NaN if there are none."""
        observed, mean, spread = (values[chosen] for values in (self.observed, self.mean, self.spread))
        return coverage(observed, mean, spread, levels) if len(observed) else np.full(np.shape(levels), np.nan)


def read_model_run(path: Path) -> ModelRun:
    """A run with a forward model, finished or not; predictions of movements that its log lacks are left out.

    Raises:
        RunError: it has no model, has predicted nothing yet, or its files are damaged or do not belong together.
    """
    run, file = read_run(path), path / "predictions.csv"
    if run.predictions is None:
        raise RunError(f"{path} has no {file.name}: it ran without a forward model; see --inverse model of sgimd run")
    exemplars, *values = _checked(run, file.name, run.predictions).values()
    lived = np.flatnonzero(np.isfinite(run.outcomes).all(axis=1))
    rows = exemplars[exemplars < len(lived)]
    if not len(rows):
        raise RunError(f"{file} holds no prediction of a movement yet; the model learns from 50 before its first")
    if (np.diff(exemplars) <= 0).any():
        raise RunError(f"{file} must name exemplars by whole numbers that increase; was it edited?")
    observed, mean, epistemic, aleatoric = np.split(np.stack(values, axis=1)[: len(rows)], 4, axis=1)
    differ = (observed != run.outcomes[lived[rows]]).any(axis=1)
    if differ.any():
        raise RunError(f"{file}: exemplar {rows[differ][0]} is another one in episodes.csv; is it another run's file?")
    spread = np.hypot(epistemic, aleatoric)
    if not (spread > 0).all():
        raise RunError(f"{file}: exemplar {rows[(spread <= 0).any(axis=1)][0]} has a spread of 0; was it edited?")
    if run.refreshes is None:
        raise RunError(f"{path}/refreshes.csv is missing; was it deleted?")
    refreshes = _checked(run, "refreshes.csv", run.refreshes)
    if not len(refreshes["diverged"]) or not np.isin(refreshes["diverged"], (0, 1)).all():
        raise RunError(f"{path}/refreshes.csv must hold a refresh, and 0 or 1 for diverged; was it cut or edited?")
    return ModelRun(run, lived[rows], observed, mean, spread, refreshes)


def row(model_run: ModelRun) -> dict[str, Any]:
    """Its row of the table, by column; NaN if there is nothing to measure."""
    errors = np.linalg.norm(model_run.observed - model_run.mean, axis=1)
    run, refreshes = model_run.run, len(model_run.refreshes["diverged"])
    seconds = run.summary.get("seconds_model")
    inside = (model_run.inside(slice(-NEWEST, None)), model_run.inside(model_run.movements >= LATE))
    values = (
        model_run.name,
        len(errors),
        float(errors[-NEWEST:].mean()),
        *np.concatenate(inside).tolist(),
        improvements(run.goals, run.outcomes, run.origin).share,
        refreshes,
        int(model_run.refreshes["diverged"].sum()),
        1e3 * seconds / refreshes if isinstance(seconds, int | float) else math.nan,
    )
    return dict(zip(MODEL_HEADER, values, strict=True))


def figure_of(model_run: ModelRun) -> Figure:
    """Where predictions went wrong, whether the spread was honest, and both over time; maps only in the plane."""
    observed, mean, refreshes = model_run.observed, model_run.mean, model_run.refreshes
    is_plane, last = observed.shape[1] == 2, slice(-NEWEST, None)
    over_time = ["error", "coverage", "held out"]
    figure = Figure(figsize=(17, 10) if is_plane else (12, 10), layout="constrained")
    rows: Any = [["map", "cells", "calibration"], over_time] if is_plane else [["calibration", "error"], over_time[1:]]
    axes = figure.subplot_mosaic(rows)
    if is_plane:
        half_side = model_run.run.config.get("task_space")
        reach = min(half_side, REACH) if isinstance(half_side, int | float) else REACH
        box = Box.cube(-reach, reach, 2)
        plots.predictions(axes["map"], observed[last], mean[last], box)
        plots.error_map(axes["cells"], error_by_cell(observed[last], mean[last], box), box)
        axes["map"].set_title(f"From prediction to outcome, last {len(observed[last])}", pad=26)
        axes["cells"].set_title("Their mean error, and number, by cell", pad=26)
    levels = np.arange(1, 20) / 20
    shown = {f"last {len(observed[last])}": model_run.inside(last, levels)}
    if (late := model_run.movements >= LATE).any():
        shown[f"from {LATE} movements on"] = model_run.inside(late, levels)
    plots.calibration(axes["calibration"], levels, shown)
    windows = running(observed, mean, model_run.spread)
    ends = (model_run.movements[windows.last] + 1).astype(np.float64)
    plots.error_over_time(axes["error"], ends, windows.errors)
    plots.coverage_over_time(axes["coverage"], ends, windows.coverages[:, LEVELS.index(0.8)])
    diverged = refreshes["diverged"] > 0
    plots.held_out_over_time(axes["held out"], refreshes["movements"], refreshes["held_out"], diverged)
    figure.suptitle(f"{model_run.name}: {len(observed)} predictions, each made before the model learnt from it")
    return figure


def _checked(run: Run, name: str, table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The ``table`` of a model as it is.

    Raises:
        RunError: it is damaged, or has other outcomes.
    """
    path, bad = run.path / name, run.damage.get(name, 1)
    names = small_table(path, run.outcomes.shape[1]).names
    if name not in run.damage and tuple(table) == names:
        return table
    line = path.read_text(errors="replace").split("\n")[bad - 1][:60]
    if bad == 1:
        raise RunError(f"{path} must begin with {','.join(names)}, got {line}; was it edited?")
    whole = ", ".join(column for column in names if column in WHOLE)
    wanted = f"{len(names)} numbers" + ("" if name in run.unchecked else " and their checksum")
    raise RunError(f"{path}, line {bad}: needs {wanted}, got {line!r} (whole ones for {whole}); was it edited?")


def _printed(cells: dict[str, Any]) -> list[str]:
    def shown(value: float, form: str) -> str:
        return "-" if math.isnan(value) else f"{value:{form}}"

    inside = [
        " / ".join(shown(100 * cells[f"inside_{100 * level:.0f}_{when}"], ".0f") for level in LEVELS)
        for when in ("last", "late")
    ]
    learnt = f"{cells['refreshes']}, {cells['diverged']} diverged", shown(cells["ms_per_refresh"], ".1f")
    improved = shown(100 * cells["improved"], ".0f")
    return [cells["run"], str(cells["predicted"]), f"{cells['error_m']:.3f}", *inside, improved, *learnt]


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the figures, write and print the table; the exit code is 2 if a run makes no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="a run directory: runs/sgim-d/seed-003")
    parser.add_argument("--out", type=Path, default=Path("results/model"), help="default: %(default)s")
    options = parser.parse_args(argv)
    found = {run.name: run for run in map(read_model_run, tqdm(options.runs, "reading", disable=None))}
    if len(found) < len(options.runs):
        raise RunError("two of these runs have the same name; draw them one by one, each with its own --out")
    make_folder(options.out)
    first = {name.split("/")[0]: name for name in reversed(found)}
    for name in tqdm(first.values(), "drawing", disable=None):
        save_figure(partial(figure_of, found[name]), options.out / name.replace("/", "-"), "png")
    rows = [row(run) for run in found.values()]
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows([MODEL_HEADER, *(each.values() for each in rows)])
    write_text(options.out / "table.csv", table.getvalue())
    lines = [HEAD, *map(_printed, rows)]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    for cells in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
    print(f"figures and table.csv: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
