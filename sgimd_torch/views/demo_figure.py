"""The demo's figure and table: the results of its runs next to each other, made from their directories alone."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import LEGEND, goal_rings, plane
from sgimd_torch.figures.learning import COLOURS, NAMES, landing_points, tile_counts
from sgimd_torch.figures.results import SeedCurves, seed_curves
from sgimd_torch.runs.build import build
from sgimd_torch.runs.read import Run, config_of
from sgimd_torch.spaces import Array, Box, stream
from sgimd_torch.views.memories import remember

GOALS = np.array([[-0.6, -0.6], [-0.6, 0.6], [0.6, 0.6], [0.6, -0.6]])  # m; few random movements lead behind the arm


class Cast(NamedTuple):
    """An answer: of the float its ``path`` ``(n, 3)`` m down to the water, of the arm its ``posture`` ``(7, 3)`` m when
    the float is let go or lands."""

    path: Array
    posture: Array


def draw(runs: Mapping[str, Run]) -> Figure:
    """The figure: error curves; four goals and how each learner answers them; where the float landed in each run."""
    half_side = float(runs["sgim-d"].config["environment.task_space"])
    box, tile = runs["sgim-d"].spaces["outcomes"], 0.05 * half_side
    figure = Figure(figsize=(7 * len(runs), 12.6), layout="constrained")
    axes: dict[str, Axes] = figure.subplot_mosaic([["curves", "above", "side"], [*runs]])
    seed_curves(axes["curves"], [_curve(algorithm, run) for algorithm, run in runs.items()])
    axes["curves"].set_title("How far from its goals the float lands")
    axes["above"].set_title("Four goals and their answers, from above", pad=55)
    axes["side"].set_title("The arm casts at the goal behind it, on the left")
    _draw_casts(axes["above"], axes["side"], {algorithm: list(answers(run)) for algorithm, run in runs.items()}, box)
    landed = {algorithm: run.outcomes[np.isfinite(run.outcomes).all(axis=1)] for algorithm, run in runs.items()}
    most = max(float(tile_counts(each, box, tile).max()) for each in landed.values())
    for algorithm, run in runs.items():
        landing_points(axes[algorithm], landed[algorithm], box, demonstrated=_shown(run), side=tile, most=most)
        axes[algorithm].set_title(f"Where the float landed: {NAMES[algorithm]}", pad=32)
    config = runs["sgim-d"].config
    about = f"{config['movements']} movements each, seed {config['seed']}"
    figure.suptitle(f"A simulated arm learns to place its float: {about}", fontsize="x-large")
    return figure


def table(runs: Mapping[str, Run]) -> list[list[str]]:
    """A row for each run: errors, the last one also as a share of the random learner's, noise floor and costs; the
    first row has the heads."""
    whens = runs["sgim-d"].evaluation["movements"].astype(int).tolist()
    columns = [movements for movements in (1000, 2000, 5000) if movements in whens[:-1]] + whens[-1:]
    heads = [*(f"error {movements} (m)" for movements in columns), "of Random's", "noise floor (m)"]
    rows = [["learner", *heads, "physics (s)", "learning (s)", "evaluation (s)"]]
    for algorithm, run in runs.items():
        last = run.evaluation["mean_error"][-1]
        errors = [f"{run.at(movements):.3f}" for movements in columns]
        share, floor = last / runs["random"].evaluation["mean_error"][-1], run.at(columns[-1], "noise_floor")
        seconds = [f"{run.summary[f'seconds_{part}']:.0f}" for part in ("physics", "learner", "evaluation")]
        rows.append([NAMES[algorithm], *errors, f"{share:.2f}", f"{floor:.3f}", *seconds])
    return rows


def answers(run: Run) -> Iterator[Cast]:
    """How a learner on the fishing rod answers ``GOALS`` after its last movement; all runs have the same noise."""
    parts = build(config_of(run))
    remember(run, parts, 0, len(run.index))
    rod: Any = parts.environment
    context = (rod.contexts.low + rod.contexts.high) / 2
    for k, goal in enumerate(GOALS):
        recording = rod.record(context, parts.inverse(context, goal).theta, stream(run.config["seed"], "demo", k))
        path = np.stack([recording.float_at(time) for time in np.linspace(0, recording.landed, 100)])
        end = recording.landed if recording.let_out is None else recording.let_out
        yield Cast(path, rod.posture(recording, end))


def _draw_casts(above: Axes, beside: Axes, casts: Mapping[str, Sequence[Cast]], box: Box) -> None:
    """From above, the float's paths to all goals; from the side, the arms and the paths for the first goal."""
    beside.axhspan(-0.12, 0, color="#4f93b8", alpha=0.5, linewidth=0)  # the water
    beside.plot([0, 0], [0, 0.25], color="0.4", linewidth=7, solid_capstyle="butt")
    for algorithm, each in casts.items():
        colour, first = COLOURS[algorithm], each[0]
        ends = np.array([cast.path[-1, :2] for cast in each])
        missed = f"{NAMES[algorithm]}: misses by {100 * np.linalg.norm(ends - GOALS, axis=1).mean():.0f} cm"
        drawn = [(above, cast, [0, 1]) for cast in each] + [(beside, first, [0, 2])]
        beside.plot(*first.posture[:, [0, 2]].T, "-", color=colour, linewidth=1.5, alpha=0.7)  # with the rod
        arm = first.posture[:-1, [0, 2]]
        beside.plot(*arm.T, "o-", color=colour, linewidth=5, markersize=6, mec="white", alpha=0.9)
        for ax, cast, seen in drawn:
            ax.plot(*cast.path[:, seen].T, ":", color=colour, linewidth=1.8)
            label = missed if ax is above and cast is first else None
            ax.plot(*cast.path[-1:, seen].T, "X", color=colour, mec="white", ms=10, label=label)
    goal_rings(above, GOALS, 17)
    plane(above, box)
    above.legend(**LEGEND)
    goal_rings(beside, [[GOALS[0, 0], 0.0]], 17)
    beside.set(xlim=(box.low[0], box.high[0]), ylim=(-0.12, 1.2), aspect="equal", xlabel="x (m)", ylabel="height (m)")


def _curve(algorithm: str, run: Run) -> SeedCurves:
    when, errors = (run.evaluation[name] for name in ("movements", "mean_error"))
    return SeedCurves(algorithm, NAMES[algorithm], when, errors[None], errors, errors, errors)


def _shown(run: Run) -> Array | None:
    """``(n, 2)`` m outcomes of the demonstrations that the learner was shown, None without any."""
    return np.array([shown.outcome for shown in run.demonstrations]) if run.demonstrations else None
