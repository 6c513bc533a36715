"""The demo's figure and table: the results of its runs next to each other, made from their directories alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError(f"the figure needs matplotlib: pip install 'sgimd-torch[plot]' ({error})") from error

from sgimd_torch.figures.learning import NAMES, landing_points, tile_counts
from sgimd_torch.figures.results import SeedCurves, seed_curves
from sgimd_torch.runs.log import RunError
from sgimd_torch.spaces import Box
from sgimd_torch.views.demo_cast import answers, from_above, from_the_side
from sgimd_torch.views.report.data import Life, demonstrated


def draw(runs: Mapping[str, Life]) -> Figure:
    """The figure: error curves; four goals and how each learner answers them; where the float landed in each run.

    Raises:
        RunError: a run was never evaluated.
    """
    for run in runs.values():
        if not run.evaluated:
            raise RunError(f"{run.path} was never evaluated, so there is no curve to draw; was --evaluate_at [] given?")
    sgim_d, half_side = runs["sgim-d"], float(runs["sgim-d"].config["environment.task_space"])
    task_space = Box.cube(-half_side, half_side, 2)
    tile = 0.05 * half_side
    most = max(float(tile_counts(run.landed, task_space, tile).max()) for run in runs.values())
    figure = Figure(figsize=(7 * len(runs), 12.6), layout="constrained")
    axes: dict[str, Axes] = figure.subplot_mosaic([["curves", "above", "side"], [*runs]])
    seed_curves(axes["curves"], [_curve(algorithm, run) for algorithm, run in runs.items()])
    axes["curves"].set_title("How far from its goals the float lands")
    casts = {algorithm: answers(run.path) for algorithm, run in runs.items()}
    from_above(axes["above"], casts, task_space)
    axes["above"].set_title("Four goals and their answers, from above", pad=55)
    from_the_side(axes["side"], casts, task_space)
    axes["side"].set_title("The arm casts at the goal behind it, on the left")
    for algorithm, run in runs.items():
        ax = axes[algorithm]
        shown, _ = demonstrated([run])
        landing_points(ax, run.landed, task_space, demonstrated=shown if len(shown) else None, side=tile, most=most)
        ax.set_title(f"Where the float landed: {NAMES[algorithm]}", pad=32)
    n = " and ".join(dict.fromkeys(str(len(run.index)) for run in runs.values()))
    seed = sgim_d.config["seed"]
    figure.suptitle(f"A simulated arm learns to place its float: {n} movements each, seed {seed}", fontsize="x-large")
    return figure


def table(runs: Mapping[str, Life]) -> str:
    """Errors and costs of the runs, and the ratios of the last errors."""
    evaluated = runs["sgim-d"].evaluation["movements"].astype(int).tolist()
    columns = [movements for movements in (1000, 2000, 5000) if movements in evaluated[:-1]] + evaluated[-1:]
    heads = [*(f"error {movements}" for movements in columns), "noise floor", "physics", "learning", "evaluation"]
    width = max(len(NAMES[algorithm]) for algorithm in runs)
    lines = [" " * width + "".join(f"{head:>13}" for head in heads)]
    for algorithm, run in runs.items():
        cells = [_shown(run.at(movements), ".3f", "m") for movements in columns]
        cells.append(_shown(run.evaluation["noise_floor_m"][-1], ".3f", "m"))
        cells += [_shown(run.seconds(part), ".0f", "s") for part in ("physics", "learner", "evaluation")]
        lines.append(f"{NAMES[algorithm]:{width}}" + "".join(f"{cell:>13}" for cell in cells))
    last = {algorithm: run.evaluation["mean_error_m"][-1] for algorithm, run in runs.items()}
    ratios = " and ".join(
        f"{NAMES[algorithm]} {error / last['random']:.2f}" for algorithm, error in last.items() if algorithm != "random"
    )
    lines.append(f"Error after {columns[-1]} movements, as a share of Random's: {ratios}.")
    return "\n".join(lines)


def _curve(algorithm: str, run: Life) -> SeedCurves:
    when, errors = (run.evaluation[name] for name in ("movements", "mean_error_m"))
    return SeedCurves(algorithm, NAMES[algorithm], when, errors[None], errors, errors, errors)


def _shown(value: float, form: str, unit: str) -> str:
    return f"{value:{form}} {unit}" if np.isfinite(value) else "-"
