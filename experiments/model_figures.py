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
import math
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from sgimd_torch.runs.process import command, loading

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    import pandas as pd
    from matplotlib.figure import Figure
    from tqdm import tqdm

    from figures import REACH
    from sgimd_torch.figures import predictions as plots
    from sgimd_torch.figures.save import save_figure
    from sgimd_torch.files import make_folder
    from sgimd_torch.forward_model.diagnostics import LEVELS, error_by_cell, improvements, running
    from sgimd_torch.record import RunError
    from sgimd_torch.spaces import Box
    from sgimd_torch.views.model_run import ModelRun, read_model_run
    from table import TABLES, write_table

TABLE: Final = "model/table.csv"
NEWEST: Final = 1000  # predictions
LATE: Final = 2000  # movements, from which on the spread must be honest
HEAD: Final = (
    *("run", "predicted", "error (m)", "inside 50 / 80 / 95 %", f"from {LATE} on", "improved (%)"),
    *("refreshes", "ms each"),
)


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
    return dict(zip(TABLES[TABLE][1], values, strict=True))


def figure_of(model_run: ModelRun) -> Figure:
    """Where predictions went wrong, whether the spread was honest, and both over time; maps only in the plane."""
    observed, mean, refreshes = model_run.observed, model_run.mean, model_run.refreshes
    is_plane, last = observed.shape[1] == 2, slice(-NEWEST, None)
    over_time = ["error", "coverage", "held out"]
    figure = Figure(figsize=(17, 10) if is_plane else (12, 10), layout="constrained")
    rows: Any = [["map", "cells", "calibration"], over_time] if is_plane else [["calibration", "error"], over_time[1:]]
    axes = figure.subplot_mosaic(rows)
    if is_plane:
        half_side = model_run.run.config.get("environment.task_space")
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


def _printed(cells: dict[str, Any]) -> list[str]:
    def shown(value: float, form: str) -> str:
        return "-" if math.isnan(value) else f"{value:{form}}"

    inside = [
        " / ".join(shown(100 * cells[f"inside_{100 * level:.0f}_{when}"], ".0f") for level in LEVELS)
        for when in ("last", "late")
    ]
    learnt = f"{cells['refreshes']}, {cells['diverged']} diverged", shown(cells["ms_per_refresh"], ".1f")
    improved = shown(100 * cells["improved"], ".0f")
    return [cells["run"], str(cells["predicted"]), f"{cells['error']:.3f}", *inside, improved, *learnt]


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the figures, write and print the table; the exit code is 2 if a run makes no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", type=Path, nargs="+", metavar="RUN", help="a run directory: runs/sgim-d/seed-003")
    parser.add_argument("--out", type=Path, default=Path("results/model"), help="default: %(default)s")
    options = parser.parse_args(argv)
    found = {run.name: run for run in map(read_model_run, tqdm(options.runs, "reading", disable=None))}
    if len(found) < len(options.runs):
        raise RunError("two of these runs have the same name; draw them one by one, each with its own --out")
    rows = [row(run) for run in found.values()]
    make_folder(options.out)
    first = {name.split("/")[0]: name for name in reversed(found)}
    for name in tqdm(first.values(), "drawing", disable=None):
        save_figure(partial(figure_of, found[name]), options.out / name.replace("/", "-"), "png")
    write_table(options.out, "table.csv", pd.DataFrame(rows))
    lines = [HEAD, *map(_printed, rows)]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    for cells in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)).rstrip())
    print(f"figures and table.csv: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
