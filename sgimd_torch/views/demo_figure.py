"""The demo's figure: the results of its runs next to each other, made from their directories alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import over_movements
from sgimd_torch.figures.learning import COLOURS, NAMES, landing_points, misses, tile_counts
from sgimd_torch.figures.sections import sections
from sgimd_torch.runs.read import Run
from sgimd_torch.spaces import Array


def draw(runs: Mapping[str, Run]) -> Figure:
    """The figure: error curves, where the float landed in each run, and how far each goal is missed at its end."""
    box = runs["sgim-d"].spaces["outcomes"]
    (plane,) = sections(box)
    tile = box.sides[0] / 40
    figure = Figure(figsize=(6 * len(runs), 15), layout="constrained")
    grid = figure.add_gridspec(3, len(runs), height_ratios=[2, 3, 3])
    curves = figure.add_subplot(grid[0, :])
    for algorithm, run in runs.items():
        when, errors = run.evaluation["movements"], run.evaluation["mean_error"]
        curves.plot(when, errors, "o-", color=COLOURS[algorithm], markersize=4, label=NAMES[algorithm])
    over_movements(curves, box.in_unit("mean distance to benchmark goals"))
    curves.set_ylim(bottom=0)
    curves.legend(loc="lower left")
    curves.set_title("How far from its goals the float lands")
    landed = {algorithm: run.outcomes[np.isfinite(run.outcomes).all(axis=1)] for algorithm, run in runs.items()}
    most = max(float(tile_counts(each, box, tile).max()) for each in landed.values())
    last = {algorithm: run.missed_by(int(run.evaluation["movements"][-1]))[0] for algorithm, run in runs.items()}
    farthest = max(float(np.quantile(errors, 0.95)) for errors in last.values())
    for column, (algorithm, run) in enumerate(runs.items()):
        ax = figure.add_subplot(grid[1, column])
        landing_points(ax, landed[algorithm], box, plane, demonstrated=_shown(run), side=tile, most=most)
        ax.set_title(f"Where the float landed: {NAMES[algorithm]}", pad=32)
        ax = figure.add_subplot(grid[2, column])
        misses(ax, run.benchmark, last[algorithm], box, plane, farthest)
        ax.set_title(f"{NAMES[algorithm]} misses its goals by {box.amount(float(last[algorithm].mean()), '.3f')}")
    config = runs["sgim-d"].config
    about = f"{config['movements']} movements each, seed {config['seed']}"
    figure.suptitle(f"A simulated arm learns to place its float: {about}", fontsize="x-large")
    return figure


def _shown(run: Run) -> Array | None:
    """``(n, 2)`` m outcomes of the demonstrations that the learner was shown, None without any."""
    return np.array([shown.outcome for shown in run.demonstrations]) if run.demonstrations else None
