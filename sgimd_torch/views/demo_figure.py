"""The demo's figure and table: the results of its runs next to each other, made from their directories alone."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

try:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
except ImportError as error:
    raise ImportError(f"the figure needs matplotlib: pip install 'sgimd-torch[plot]' ({error})") from error

from sgimd_torch.figures.learning import NAMES, interest_map, landing_points, map_after, tile_counts
from sgimd_torch.figures.results import SeedCurves, seed_curves
from sgimd_torch.runs.log import RunError
from sgimd_torch.spaces import Box
from sgimd_torch.views.report.data import Life, demonstrated

GOALS = 100  # the last ones are shown


def draw(runs: Mapping[str, Life]) -> Figure:
    """The figure: error curves, the interest map, where the float landed in each run, on one scale.

    Raises:
        RunError: a run was never evaluated.
    """
    for run in runs.values():
        if not run.evaluated:
            raise RunError(f"{run.path} was never evaluated, so there is no curve to draw; was --evaluate_at [] given?")
    sgim_d, half_side = runs["sgim-d"], float(runs["sgim-d"].config["task_space"])
    task_space = Box.cube(-half_side, half_side, 2)
    tile = 0.05 * half_side
    most = max(float(tile_counts(run.landed, task_space, tile).max()) for run in runs.values())
    figure = Figure(figsize=(7 * len(runs), 12.6), layout="constrained")
    axes: dict[str, Axes] = figure.subplot_mosaic([[*["curves"] * (len(runs) - 1), "interest"], [*runs]])
    seed_curves(axes["curves"], [_curve(algorithm, run) for algorithm, run in runs.items()])
    axes["curves"].set_title("How far from its goals the float lands")
    _draw_interest(axes["interest"], sgim_d)
    for algorithm, run in runs.items():
        ax = axes[algorithm]
        shown, _ = demonstrated([run])
        landing_points(ax, run.landed, task_space, demonstrated=shown if len(shown) else None, side=tile, most=most)
        ax.set_title(f"Where the float landed: {NAMES[algorithm]}", pad=32)
    n = " and ".join(dict.fromkeys(str(len(run.index)) for run in runs.values()))
    seed = sgim_d.config["seed"]
    figure.suptitle(f"A simulated arm learns to place its float: {n} movements each, seed {seed}")
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
    lines.append(f"After {columns[-1]} movements the error, in Random's: {ratios}.")
    return "\n".join(lines)


def _curve(algorithm: str, run: Life) -> SeedCurves:
    when, errors, floors = (run.evaluation[name] for name in ("movements", "mean_error_m", "noise_floor_m"))
    return SeedCurves(algorithm, NAMES[algorithm], when, errors[None], errors, errors, errors, floors=floors)


def _draw_interest(ax: Axes, run: Life) -> None:
    """The map at the last evaluation, and the last goals chosen before it."""
    ax.set_title(f"Where the competence of {NAMES['sgim-d']} is changing", pad=32)
    if not run.regions or not len(run.regions["movements"]):
        ax.text(0.5, 0.5, "uniform goals: no interest map", transform=ax.transAxes, ha="center")
        return
    last = map_after(run.regions, run.regions["movements"].max())
    interest_map(ax, *last, goals=run.chosen_goals()[-GOALS:])


def _shown(value: float, form: str, unit: str) -> str:
    return f"{value:{form}} {unit}" if np.isfinite(value) else "-"
