"""The pictures on the board: T from above, coloured by error and by competence.

pictures = maps_of(regions, space, goals, errors); pictures["map/competence"] is an array of pixels
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from sgimd_torch.board.curves import branches
from sgimd_torch.extras.pictures.maps import competence_map, misses, pixels
from sgimd_torch.extras.pictures.sections import Section, sections
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box

# Errors of the first and the last colour, as shares of T's longest side; constant, so that runs can be compared.
SCALE: Final = (0.0005, 0.5)
NARROW: Final = 0.2  # share of the width of the map; the name of a narrower region is turned by 90 degrees
WIDE: Final = 2.5  # width (inches) of the axes of a picture, without the colour bar
MARGIN: Final = 0.7  # height (inches) of the space above and below the axes together
# Sizes that are readable on the page Time Series; names of a user are no formulas.
STYLE: Any = {"font.size": 10, "axes.titlesize": 10, "text.parse_math": False}


def maps_of(
    regions: Sequence[Region], space: Box, contexts: Box, goals: Array, errors: Array
) -> dict[str, NDArray[np.uint8]]:
    """Pictures ``(height, width, 4)`` by tag; if T has more than two dimensions, each picture shows several sections.

    Args:
        regions: regions of the goal model; if empty, there is no picture of them.
        space, contexts: T and C.
        goals: ``(n, outcome_dim)`` goals of the benchmark.
        errors: ``(n,)`` errors of the goals, in the unit of T.
    """
    pictures: dict[str, Callable[[Axes, Section], object]] = {}
    pictures["map/error"] = lambda ax, section: _errors(ax, goals, errors, space, section)
    if regions:
        pictures["map/competence"] = lambda ax, section: _competence(ax, regions, section)
    return {tag: _pixels(picture, sections(space, contexts)) for tag, picture in pictures.items()}


def _errors(ax: Axes, goals: Array, errors: Array, space: Box, section: Section) -> None:
    ax.set_title(f"{len(errors)} benchmark goals, mean error {space.amount(float(errors.mean()), '.3g')}")
    least, most = (share * float(space.sides.max()) for share in SCALE)
    misses(ax, goals, errors, space, section, most, "error", least=least)
    ax.autoscale()  # limits around the goals, even in a large space


def _competence(ax: Axes, regions: Sequence[Region], section: Section) -> None:
    """The regions, coloured by competence; regions that have curves are framed and named."""
    lows, highs = np.stack([region.low for region in regions]), np.stack([region.high for region in regions])
    means = [region.competences.mean() if len(region.goals) else np.nan for region in regions]
    competence_map(ax, lows, highs, np.array(means), section)
    lows, highs, met = section.cut(lows, highs)
    rows = {regions[k]: row for row, k in enumerate(np.flatnonzero(met).tolist())}
    named, sides = branches(list(rows)), np.ptp([lows.min(axis=0), highs.max(axis=0)], axis=0)
    for path, leaves in named.items():
        if {f"{path}0", f"{path}1"} & named.keys():
            continue  # the parts of this region have names of their own
        among = [rows[region] for region in leaves]
        low, high = lows[among].min(axis=0), highs[among].max(axis=0)
        ax.add_patch(Rectangle((low[0], low[1]), *(high - low), fill=False, edgecolor="black", linewidth=1.6))
        width, height = (high - low) / sides
        x, y = (low + high) / 2
        text = ax.text(x, y, path, ha="center", va="center", fontweight="bold")
        text.set_rotation(90 if width < min(NARROW, height) else 0)
        text.set_bbox({"facecolor": "white", "alpha": 0.9, "edgecolor": "none", "pad": 1.2})


def _pixels(picture: Callable[[Axes, Section], object], maps: Sequence[Section]) -> NDArray[np.uint8]:
    """The pixels of a picture with its sections side by side, as large as TensorBoard shows it."""
    size = (4.2 * len(maps), maps[0].height(WIDE) + MARGIN)
    with style.context(STYLE, after_reset=True):
        figure = Figure(size, dpi=120, layout="compressed")
        for ax, section in zip(figure.subplots(1, len(maps), squeeze=False).flat, maps, strict=True):
            picture(ax, section)
        figure.draw_without_rendering()  # the layout needs two passes; a single pass cuts labels off
        return pixels(figure)
