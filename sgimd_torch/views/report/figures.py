"""The figures of a report, as small images that can still be read in a column of 400 pixels.

png = image(curve(variant, others))
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from PIL import Image

from sgimd_torch.figures.learning import COLOURS, interest_map, landing_points
from sgimd_torch.figures.movements import interest_over_time
from sgimd_torch.figures.results import Difference, forest
from sgimd_torch.spaces import Box
from sgimd_torch.views.report.data import Life, Variant, demonstrated
from sgimd_torch.views.statistics import difference_interval, paired_differences, rng

REACH: Final = 1.5  # m; the float hardly ever lands farther from the base
MOST_CURVES: Final = 8
STYLE: Final[Any] = {
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.useoffset": False,
    "lines.linewidth": 2,
    "legend.fontsize": 10,
}
_LINES: Final = ("-", (0, (5, 2)), (0, (1, 1.4)), (0, (6, 2, 1, 2)))  # variants of one algorithm
_MARKERS: Final = "osD^vPX*"
_COLOURS_OF_PNG: Final = 256  # a palette; enough for maps on one colour scale and smooth letters


def image(figure: Figure) -> bytes:
    """A png with enough pixels for dense screens; the same figure gives the same bytes.

    With few colours it is smaller than an svg of the same figure, also where that holds only lines and words.
    """
    pixels, png = io.BytesIO(), io.BytesIO()
    with rc_context(STYLE):
        figure.savefig(pixels, format="png", dpi=140)
    with Image.open(pixels) as full:
        few = full.convert("RGB").quantize(_COLOURS_OF_PNG, dither=Image.Dither.NONE)
        few.save(png, "png", optimize=True)
    return png.getvalue()


def curves(variants: Sequence[Variant]) -> Figure:
    """Error against movements: interquartile means over seeds with their intervals."""
    with rc_context(STYLE):
        figure = Figure(figsize=(6.8, 4.5), layout="constrained")
        ax = figure.subplots()
        before: dict[str, int] = {}
        for variant in variants:
            nth = before[variant.algorithm] = before.get(variant.algorithm, -1) + 1
            _curve(ax, variant, line=_LINES[nth % len(_LINES)], marker=_MARKERS[nth % len(_MARKERS)])
        _error_axis(ax)
        ax.legend(handles=_labelled(ax), ncols=1 + (len(variants) > 4))
    return figure


def curve(variant: Variant, others: Sequence[Variant]) -> Figure:
    """One variant's curve, its seeds thin, all others in grey behind."""
    with rc_context(STYLE):
        figure = Figure(figsize=(6, 5.2), layout="constrained")
        ax = figure.subplots()
        for other in others:
            ax.plot(other.evaluated, other.curve[0], color="0.8", linewidth=1.2)
        colour = _colour(variant)
        if len(variant.used) > 1:
            ax.plot(variant.evaluated, variant.errors.T, color=colour, linewidth=0.7, alpha=0.4)
        _curve(ax, variant)
        floors = np.array([[life.at(m, "noise_floor_m") for m in variant.evaluated.tolist()] for life in variant.used])
        measured = np.isfinite(floors).all(axis=0)
        where = variant.evaluated[measured]
        style = "--" if len(where) > 1 else "_"
        ax.plot(where, floors[:, measured].mean(axis=0), style, color="black", linewidth=1.2, markersize=14)
        handles = [*_labelled(ax), Line2D([], [], color="black", linestyle="--", linewidth=1.2, label="noise floor")]
        if others:
            handles.append(Line2D([], [], color="0.8", label="other variants"))
            ax.set_xlim(right=1.05 * variant.last)
        _error_axis(ax)
        ax.legend(handles=handles)
    return figure


def one_curve(life: Life) -> Figure:
    """Of one run: mean, median and 90th percentile of the distances to the benchmark's goals."""
    with rc_context(STYLE):
        figure = Figure(figsize=(6, 5.2), layout="constrained")
        ax = figure.subplots()
        columns, colour = life.evaluation, COLOURS.get(str(life.config["algorithm"]), "black")
        when = columns["movements"]
        ax.fill_between(when, columns["median_error_m"], columns["p90_error_m"], color=colour, alpha=0.12, linewidth=0)
        ax.plot(when, columns["p90_error_m"], "^:", color=colour, linewidth=1.2, markersize=4, label="90th percentile")
        ax.plot(when, columns["mean_error_m"], "o-", color=colour, markersize=5, label="mean")
        ax.plot(when, columns["median_error_m"], "v:", color=colour, linewidth=1.2, markersize=4, label="median")
        measured = np.isfinite(columns["noise_floor_m"])
        style = "--" if measured.sum() > 1 else "_"
        ax.plot(when[measured], columns["noise_floor_m"][measured], style, color="black", linewidth=1.2, markersize=14)
        floor = Line2D([], [], color="black", linestyle="--", linewidth=1.2, label="noise floor")
        _error_axis(ax)
        ax.set_ylabel("distance to benchmark goals (m)")
        ax.legend(handles=[*_labelled(ax), floor])
    return figure


def differences(variants: Sequence[Variant], reference: Variant) -> Figure | None:
    """How much larger the last error is than the reference's, seed by seed; None without another one to compare."""
    theirs = _by_seed(reference)
    rows = []
    for variant in variants:
        ours = _by_seed(variant)
        seeds = [seed for seed in ours if seed in theirs]
        if variant is reference or variant.last != reference.last or len(seeds) < 2:
            continue
        pair = {seed: ours[seed] for seed in seeds}, {seed: theirs[seed] for seed in seeds}
        rows.append(
            Difference(_plain(variant.label), paired_differences(*pair), *difference_interval(*pair, rng=rng()))
        )
    if not rows:
        return None
    with rc_context(STYLE):
        figure = Figure(figsize=(6.8, 1.1 + 0.36 * len(rows)), layout="constrained")
        forest(figure.subplots(), rows, reference=_plain(reference.label))
    return figure


def landing(variant: Variant) -> tuple[Figure, str]:
    """Where the float landed, all seeds together, and what there is to say about the demonstrations."""
    shown, missing = demonstrated(variant.lives)
    landed = np.concatenate([life.landed for life in variant.lives])
    with rc_context(STYLE):
        figure = Figure(figsize=(6, 5.2), layout="constrained")
        landing_points(
            figure.subplots(), landed, Box.cube(-REACH, REACH, 2), demonstrated=shown if len(shown) else None
        )
    return figure, missing


def interest(life: Life) -> Figure:
    """The interest map at the last evaluation, with the goals chosen before it."""
    assert life.regions is not None
    last = life.regions["movements"] == life.regions["movements"].max()
    lows, highs = (
        np.stack([life.regions[f"{corner}_{k}"][last] for k in range(2)], axis=1) for corner in ("low", "high")
    )
    with rc_context(STYLE):
        figure = Figure(figsize=(6, 5.2), layout="constrained")
        interest_map(figure.subplots(), lows, highs, life.regions["interest"][last], goals=life.goals)
    return figure


def splitting(life: Life) -> Figure:
    """Four interest maps of one life."""
    assert life.regions is not None
    n = min(4, len(np.unique(life.regions["movements"])))
    with rc_context(STYLE):
        figure = Figure(figsize=(6, 5.2), layout="constrained")
        axes = figure.subplots(1 + (n > 2), min(2, n), squeeze=False)
        interest_over_time(axes.flat, life.regions)
        for ax in axes.flat:  # the maps are small
            ax.set_title(ax.get_title().replace(": ", ":\n"), fontsize=10)
            ax.tick_params(labelsize=9)
            ax.label_outer()
    return figure


def has_plane_map(life: Life) -> bool:
    """Whether there is an interest map to draw."""
    return life.regions is not None and "low_1" in life.regions and "low_2" not in life.regions


def _curve(ax: Axes, variant: Variant, *, line: Any = "-", marker: str = "o") -> None:
    centre, low, high = variant.curve
    n, colour = len(variant.used), _colour(variant)
    label = f"{_plain(variant.label)} ({n} seed{'s' * (n > 1)})"
    if n > 1:
        ax.fill_between(variant.evaluated, low, high, color=colour, alpha=0.2, linewidth=0)
    ax.plot(variant.evaluated, centre, color=colour, linestyle=line, marker=marker, markersize=4.5, label=label)


def _error_axis(ax: Axes) -> None:
    ax.set(xlabel="movements executed", ylabel="mean distance to benchmark goals (m)")
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    ax.grid(alpha=0.3)


def _labelled(ax: Axes) -> list[Line2D]:
    return [line for line in ax.lines if not str(line.get_label()).startswith("_")]


def _colour(variant: Variant) -> str:
    return COLOURS.get(variant.algorithm, "black")


def _by_seed(variant: Variant) -> dict[int, float]:
    return {life.seed: life.at(variant.last) for life in variant.used}


def _plain(name: str) -> str:
    """A name as a label: no formula, not hidden, not endless."""
    short = name if len(name) <= 32 else f"{name[:30]}…"
    return f"{' ' * short.startswith('_')}{short}".replace("$", r"\$")
