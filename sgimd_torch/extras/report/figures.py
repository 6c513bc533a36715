"""The figures of a report: small images, readable at a width of 400 pixels.

A `Variant` is all runs of one configuration, over seeds; a `Section` is a picture of T in two of its dimensions.
source = curves(variants, colours_of(variants))    # a png as a data URL, for <img src=...>
"""

from __future__ import annotations

import io
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from typing import Any, Concatenate, Final, ParamSpec

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sgimd_torch.extras.pictures.maps import misses as draw_misses
from sgimd_torch.extras.pictures.sections import LEGEND, Section, alike, sections
from sgimd_torch.extras.report.maps import curve_in_band, interest_map, landing_points, limits, over_movements
from sgimd_torch.extras.report.save import STYLE as FILE_STYLE
from sgimd_torch.extras.table.names import COLOURS
from sgimd_torch.extras.table.statistics import interquartile_mean
from sgimd_torch.extras.table.variants import Variant
from sgimd_torch.runs.read import Run
from sgimd_torch.spaces import Array, Box, rounded

P = ParamSpec("P")
TILES: Final = 50  # largest number of tiles along the longer side of a map
GOALS: Final = 100  # number of latest goals in an interest map
MOST_CURVES: Final = 8  # largest number of curves in one figure
WIDE: Final = 4.3  # inches, width of the axes of a map, without colour bar
MARGIN: Final = 1.2  # inches, height above and below the axes
STYLE: Final[Any] = {
    **FILE_STYLE,
    "font.size": 11,
    "axes.titlesize": 11,
    "axes.formatter.useoffset": False,
    "legend.fontsize": 10,
}
# Colours for further variants of an algorithm, from Okabe & Ito and P. Tol; no algorithm of the paper has one of them.
_FURTHER: Final = ("#e69f00", "#56b4e9", "#000000", "#882255", "#999933", "#aa4499", "#44aa99", "#661100")


def png(draw: Callable[Concatenate[Figure, P], None]) -> Callable[P, str]:
    """Turn a function that draws on a figure into a function that returns the figure as a png, in a data URL."""

    @wraps(draw)
    def address(*args: P.args, **kwargs: P.kwargs) -> str:
        content = io.BytesIO()
        with style.context(STYLE, after_reset=True):
            figure = Figure(figsize=(6, 5.2), layout="constrained")
            draw(figure, *args, **kwargs)
            figure.savefig(content, format="png", dpi=120, pil_kwargs={"optimize": True})
        return f"data:image/png;base64,{b64encode(content.getvalue()).decode()}"

    return address


def colours_of(variants: Sequence[Variant]) -> dict[str, str]:
    """Colours by name of the variant: one variant of each algorithm has the algorithm's colour, others have new ones.

    The algorithm's colour goes to the variant named like the algorithm, or else to the first variant by name. The first
    ``MOST_CURVES`` variants, whose curves share a figure, have different colours.
    """
    ordered = sorted(variants, key=lambda variant: (variant.name != variant.algorithm, variant.name))
    firsts = {variant.algorithm: variant.name for variant in reversed(ordered)}
    colour_of = {name: COLOURS[algorithm] for algorithm, name in firsts.items() if algorithm in COLOURS}
    free = [colour for colour in _FURTHER if colour not in colour_of.values()]
    others = [variant.name for variant in ordered if variant.name not in colour_of]
    colour_of |= {name: free[k % len(free)] for k, name in enumerate(others)}
    return colour_of | (colours_of(variants[:MOST_CURVES]) if len(variants) > MOST_CURVES else {})


def error_curves(figure: Figure, variants: Sequence[Variant], colours: Mapping[str, str]) -> None:
    """Error against movements: interquartile means over seeds with intervals, or points if there are too few seeds.

    Variants whose errors have different units have axes of their own. A figure of a single variant also shows the noise
    floor, and a thin line for each seed.
    """
    units = list(dict.fromkeys(variant.space.unit for variant in variants))
    if len(variants) > 1:
        figure.set_size_inches(6.8, 4.5 * len(units))
    for ax, unit in zip(figure.subplots(len(units), squeeze=False).flat, units, strict=True):
        draw_curves(ax, [variant for variant in variants if variant.space.unit == unit], colours)
    if len(variants) == 1:
        (variant,) = variants
        if len(variant.used) > 1:
            ax.plot(variant.evaluated_at, variant.errors.T, color=colours[variant.name], linewidth=0.7, alpha=0.4)
        floor = variant.floors.mean(axis=0)
        ax.plot(variant.evaluated_at, floor, "_--", color="black", linewidth=1.2, markersize=8, label="noise floor")
    for ax in figure.axes:
        ax.set_ylim(bottom=0)
        ax.legend(**LEGEND)


def draw_curves(ax: Axes, variants: Sequence[Variant], colours: Mapping[str, str]) -> None:
    """Draw the error curves of all variants; a variant with few seeds has a point for each seed, and no band."""
    for variant in variants:
        n, colour = len(variant.used), colours[variant.name]
        if n > 1 and variant.few:
            when = np.broadcast_to(variant.evaluated_at, variant.errors.shape)
            ax.scatter(when, variant.errors, s=12, color=colour, alpha=0.6, linewidths=0)
        label = f"{_curve_name(variant.label)} ({_seeds(n)})"
        curve_in_band(ax, variant.evaluated_at, variant.curve, colour, label)
    over_movements(ax, variants[0].space.in_unit("mean distance to benchmark goals"))


curves = png(error_curves)


def has_own_goals(variant: Variant) -> bool:
    """Whether a learner chose goals of its own; one that moves at random does not."""
    return bool(np.isfinite(variant.own_goals.missed).any())


@png
def own_goals(figure: Figure, variant: Variant) -> None:
    """Results at the learner's own goals against movements, for runs without evaluations: distance missed, and shares.

    They are interquartile means over seeds, with a thin line for each seed.
    """
    own, colour = variant.own_goals, COLOURS.get(variant.algorithm, "#0072b2")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    for ax, values, ink, dashes, label in (
        (upper, own.missed, colour, "-", "missed"),
        (lower, own.met, colour, "-", "goals met"),
        (lower, own.failed, "black", "--", "movements failed"),
    ):
        if len(values) > 1:
            ax.plot(own.movements, values.T, dashes, color=ink, linewidth=0.7, alpha=0.4)
        ax.plot(own.movements, interquartile_mean(values.T), dashes, color=ink, label=label)
    over_movements(lower, "share")
    upper.set_ylabel(variant.space.in_unit("distance to own goals"))
    upper.grid(alpha=0.3)
    upper.set_ylim(bottom=0)
    lower.set_ylim(bottom=0)
    lower.legend(**LEGEND)


def figure_of_curves(variants: Sequence[Variant]) -> Figure:
    """A figure of the error curves of all variants."""
    figure = Figure(layout="constrained")
    error_curves(figure, variants, colours_of(variants))
    return figure


def planes_of(variants: Sequence[Variant]) -> dict[str, Box]:
    """The part of T that maps show, by environment; it contains the outcomes of all variants in this environment."""
    corners_of: dict[str, list[Array]] = {}
    for variant in variants:
        if len(variant.landed):
            box = limits(variant.landed, variant.space)
            corners_of.setdefault(variant.environment, []).extend([box.low, box.high])
    spaces = {variant.environment: variant.space for variant in variants}
    return {
        name: replace(spaces[name], low=np.min(corners, axis=0), high=np.max(corners, axis=0))
        for name, corners in corners_of.items()
    }


@png
def landing(figure: Figure, variant: Variant, plane: Box) -> None:
    """Outcomes of movements and of demonstrations on a part of T; points outside this part are marked at its edge."""
    panels = sections(plane)
    for ax, section in zip(_panels(figure, panels), panels, strict=True):
        sides = section.box.sides
        longest = float(sides[0] if section.is_strip or not alike(sides) else sides.max())
        side = rounded(longest / TILES)
        landing_points(ax, variant.landed, plane, section, demonstrated=variant.demonstrated, side=side)


@png
def misses(figure: Figure, variant: Variant, *, expected: bool = False) -> None:
    """Goals of the last evaluation, coloured by their errors, or in the same colours by those that were expected."""
    goals, errors, expected_errors = variant.misses
    panels, drawn = sections(variant.space), (expected_errors, "expected error") if expected else (errors, "error")
    most = max(float(np.nanquantile([errors, expected_errors], 0.95)), 1e-12)
    for ax, section in zip(_panels(figure, panels), panels, strict=True):
        draw_misses(ax, goals, drawn[0], variant.space, section, most, drawn[1])


def sections_of_regions(lows: Array, highs: Array, space: Box, contexts: Box) -> list[Section]:
    """The pictures of the part of T (``space``) that regions with corners ``(n, context_dim + outcome_dim)`` cover."""
    low, high = lows.min(axis=0)[-space.dim :], highs.max(axis=0)[-space.dim :]
    return sections(replace(space, low=low, high=high), contexts)


def has_regions(run: Run) -> bool:
    """Whether the goal model of the run has regions to draw."""
    return run.regions is not None and len(run.regions["movements"]) > 0


@png
def regions(figure: Figure, run: Run) -> None:
    """The regions of T at the last evaluation, coloured by interest, with the latest goals."""
    assert run.regions is not None
    last = run.regions["movements"] == run.regions["movements"].max()
    dims = range(sum(name.startswith("low_") for name in run.regions))
    lows, highs = (np.stack([run.regions[f"{side}_{k}"][last] for k in dims], axis=1) for side in ("low", "high"))
    panels = sections_of_regions(lows, highs, run.spaces["outcomes"], run.spaces["contexts"])
    for ax, section in zip(_panels(figure, panels), panels, strict=True):
        interest_map(ax, lows, highs, run.regions["interest"][last], section, goals=run.chosen_goals()[-GOALS:])


def _panels(figure: Figure, maps: Sequence[Section]) -> list[Axes]:
    """Axes below each other, one for each section of T, each with the aspect ratio of its section."""
    heights = [section.height(WIDE) for section in maps]
    figure.set_size_inches(6, sum(heights) + MARGIN * len(maps))
    return list(figure.subplots(len(maps), 1, squeeze=False, height_ratios=heights).flat)


def _curve_name(name: str) -> str:
    """A name as a matplotlib label: shortened, and not hidden (by a leading _)."""
    short = name if len(name) <= 32 else f"{name[:30]}…"
    return f"{' ' * short.startswith('_')}{short}"


def _seeds(n: int) -> str:
    return f"{n} seed{'s' * (n != 1)}"
