"""The table and the figure of a suite: errors relative to those of one learner, by task and number of movements.

errors = errors_of(configs, titled); print_table(table(errors)); draw(errors, Path("runs/suite/suite"))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import over_movements
from sgimd_torch.figures.save import save_figure
from sgimd_torch.runs.config import Config
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, interquartile_mean, interval, point, rng, show

Key = tuple[str, str, int]
"""A task, a learner, and a number of movements."""
_COLUMNS: Final = 4


def errors_of(configs: Sequence[Config], titled: Callable[[str], str]) -> dict[Key, Array]:
    """Mean errors ``(n_seeds,)`` of finished runs; ``titled`` gives a task its name."""
    found: dict[Key, list[float]] = {}
    for config in configs:
        run = read_run(config.directory).evaluation
        for movements, error in zip(run["movements"].tolist(), run["mean_error"].tolist(), strict=True):
            found.setdefault((titled(config.out.name), config.variant, int(movements)), []).append(error)
    return {key: np.array(values) for key, values in found.items()}


def relative(errors: Mapping[Key, Array]) -> dict[Key, Interval]:
    """Mean error of each learner over that of the first, where both were evaluated.

    There is no interval with fewer than `LEAST_SEEDS`.
    """
    first = next(iter(errors))[1]
    found = {}
    for (task, learner, movements), ours in errors.items():
        theirs = errors.get((task, first, movements))
        if theirs is None or learner == first:
            continue
        if min(len(ours), len(theirs)) < 2:
            ratio = point(float(ours.mean() / theirs.mean()))
        else:
            ratio = interval(lambda one, other: one.mean(axis=-1) / other.mean(axis=-1), ours, theirs, rng=rng())
        found[task, learner, movements] = ratio
    return found


def table(errors: Mapping[Key, Array]) -> list[list[str]]:
    """A row for each task at each number of movements, then the interquartile mean over tasks; the first are heads."""
    ratios = relative(errors)
    tasks, (first, *others), times = (list(dict.fromkeys(values)) for values in zip(*errors, strict=True))
    rows = [["movements", "task", f"error of {first}", *others]]
    for movements in sorted(times):
        for task in tasks:
            base = errors.get((task, first, movements))
            found = [ratios.get((task, name, movements)) for name in others]
            cells = ["-" if ratio is None else show(ratio) for ratio in found]
            rows.append([str(movements), task, "-" if base is None else f"{base.mean():.4g}", *cells])
        over_tasks = [[r.value for (_, n, m), r in ratios.items() if (n, m) == (name, movements)] for name in others]
        means = [f"{interquartile_mean(np.array(values)):.2f}" if values else "-" for values in over_tasks]
        rows.append([str(movements), "interquartile mean", "", *means])
    return rows


def draw(errors: Mapping[Key, Array], stem: Path) -> list[Path]:
    """Write ``stem``.png: a panel for each task; returns the file."""
    return save_figure(lambda: figure(errors), stem, "png")


def figure(errors: Mapping[Key, Array]) -> Figure:
    """Relative error against movements, a panel for each task."""
    ratios = relative(errors)
    tasks, (first, *others) = (list(dict.fromkeys(key[k] for key in errors)) for k in (0, 1))
    rows, columns = -(-len(tasks) // _COLUMNS), min(len(tasks), _COLUMNS)
    made, axes = plt.subplots(rows, columns, figsize=(4 * columns, 3.4 * rows), squeeze=False, layout="constrained")
    for ax, task in zip(axes.flat, tasks, strict=False):
        ax.axhline(1, color="0.45", linewidth=1, label=first)
        for k, name in enumerate(others):
            curve = sorted((m, ratio) for (t, n, m), ratio in ratios.items() if (t, n) == (task, name))
            when, found = [movements for movements, _ in curve], [ratio for _, ratio in curve]
            spread = [ratio.low for ratio in found], [ratio.high for ratio in found]
            ax.fill_between(when, *spread, color=f"C{k}", alpha=0.2, linewidth=0)
            ax.plot(when, [ratio.value for ratio in found], "o-", color=f"C{k}", label=name)
        over_movements(ax, "relative error")
        ax.set(yscale="log", title=task)
    for ax in axes.flat[len(tasks) :]:
        ax.axis("off")
    axes.flat[0].legend(loc="upper right")
    plt.close(made)
    return made
