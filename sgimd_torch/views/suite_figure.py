"""The table and the figure of a suite: errors relative to those of one learner, by task and number of movements.

print(table(errors)); draw(errors, Path("runs/suite/suite"))    # errors: task -> learner -> movements -> (n_seeds,)
The first learner of a task is the one that all others are compared with.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from sgimd_torch.figures.axes import over_movements
from sgimd_torch.figures.save import save_figure
from sgimd_torch.spaces import Array
from sgimd_torch.views.statistics import Interval, interquartile_mean, interval, point, rng

Curve = Mapping[int, Array]
Errors = Mapping[str, Mapping[str, Curve]]
_COLUMNS: Final = 4
_OVER_TASKS: Final = "interquartile mean"


def relative(ours: Curve, theirs: Curve, at: int) -> Interval | None:
    """Mean error of a learner over that of another; None where one of them was not evaluated.

    There is no interval with fewer than `LEAST_SEEDS`.
    """
    if at not in ours or at not in theirs:
        return None
    ratio = float(ours[at].mean() / theirs[at].mean())
    if min(len(ours[at]), len(theirs[at])) < 2:
        return point(ratio)
    return interval(lambda one, other: one.mean(axis=-1) / other.mean(axis=-1), ours[at], theirs[at], rng=rng())


def table(errors: Errors) -> str:
    """A block for each number of movements, a line for each task, and the interquartile mean over tasks."""
    reference, *others = _learners(errors)
    lines = [["movements", "task", f"error of {reference}", *others]]
    for at in sorted({at for found in errors.values() for curve in found.values() for at in curve}):
        by_learner: dict[str, list[float]] = {name: [] for name in others}
        for task, found in errors.items():
            cells = []
            for name in others:
                ratio = relative(found.get(name, {}), found.get(reference, {}), at)
                cells.append("-" if ratio is None else _cell(ratio))
                by_learner[name] += [] if ratio is None else [ratio.value]
            base = found.get(reference, {}).get(at)
            lines.append([str(at), task, "-" if base is None else f"{base.mean():.4g}", *cells])
        means = [
            f"{interquartile_mean(np.array(by_learner[name])):.2f}" if by_learner[name] else "-" for name in others
        ]
        lines.append([str(at), _OVER_TASKS, "", *means])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in lines)


def draw(errors: Errors, stem: Path) -> list[Path]:
    """Write ``stem``.png: a panel for each task; returns the file."""
    return save_figure(lambda: figure(errors), stem, "png")


def figure(errors: Errors) -> Figure:
    """Relative error against movements, a panel for each task."""
    rows = -(-len(errors) // _COLUMNS)
    columns = min(len(errors), _COLUMNS)
    made, axes = plt.subplots(rows, columns, figsize=(4 * columns, 3.4 * rows), squeeze=False, layout="constrained")
    reference, *others = _learners(errors)
    for ax, (task, found) in zip(axes.flat, errors.items(), strict=False):
        ax.axhline(1, color="0.45", linewidth=1, label=reference)
        for k, name in enumerate(others):
            ours = found.get(name, {})
            curve = {at: relative(ours, found.get(reference, {}), at) for at in sorted(ours)}
            known = {at: ratio for at, ratio in curve.items() if ratio is not None}
            low, high = [each.low for each in known.values()], [each.high for each in known.values()]
            ax.fill_between(list(known), low, high, color=f"C{k}", alpha=0.2, linewidth=0)
            ax.plot(list(known), [each.value for each in known.values()], "o-", color=f"C{k}", label=name)
        over_movements(ax, "relative error")
        ax.set(yscale="log", title=task)
    for ax in axes.flat[len(errors) :]:
        ax.axis("off")
    axes.flat[0].legend()
    plt.close(made)
    return made


def _learners(errors: Errors) -> list[str]:
    return list(dict.fromkeys(name for found in errors.values() for name in found))


def _cell(ratio: Interval) -> str:
    spans = ratio.high > ratio.low
    return f"{ratio.value:.2f}" + (f" [{ratio.low:.2f}, {ratio.high:.2f}]" if spans else "")
