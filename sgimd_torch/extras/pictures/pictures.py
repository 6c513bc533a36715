"""The pictures on the board: T from above, coloured by error, and its regions by competence and interest.

pictures = maps_of(regions, space, contexts, goals, errors, shown); pictures["map/error"] is an array of pixels
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
from matplotlib import style
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sgimd_torch.extras.pictures.maps import colour_bar, competence_map, misses, pixels, regions_in
from sgimd_torch.extras.pictures.sections import Section, sections
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box

# Errors of the first and the last colour, as shares of T's longest side; constant, so that runs can be compared.
SCALE: Final = (0.0005, 0.5)
WIDE: Final = 2.5  # width (inches) of the axes of a picture, without the colour bar
MARGIN: Final = 0.7  # height (inches) of the space above and below the axes together
# Sizes that are readable on the page Time Series; names of a user are no formulas.
STYLE: Any = {"font.size": 10, "axes.titlesize": 10, "text.parse_math": False}


def maps_of(
    regions: Sequence[Region], space: Box, contexts: Box, goals: Array, errors: Array, shown: Sequence[Array]
) -> dict[str, NDArray[np.uint8]]:
    """Pictures ``(height, width, 4)`` by tag; if T has more than two dimensions, each picture shows several sections.

    Args:
        regions: regions of the goal model; if empty, there are no pictures of them.
        space, contexts: T and C.
        goals: ``(n, outcome_dim)`` goals of the benchmark.
        errors: ``(n,)`` errors of the goals, in the unit of T.
        shown: outcomes of demonstrations, each ``(outcome_dim,)``.
    """
    pictures: dict[str, Callable[[Axes, Section], object]] = {}
    pictures["map/error"] = lambda ax, section: _errors(ax, goals, errors, space, section, shown)
    if regions:
        corners = np.stack([region.low for region in regions]), np.stack([region.high for region in regions])
        means = np.array([region.competences.mean() if len(region.goals) else np.nan for region in regions])
        pictures["map/regions"] = lambda ax, section: competence_map(ax, *corners, means, section)
        interests = np.array([region.interest() for region in regions])
        pictures["map/interest"] = lambda ax, section: _interest(ax, *corners, interests, section)
    return {tag: _pixels(picture, sections(space, contexts)) for tag, picture in pictures.items()}


def _errors(ax: Axes, goals: Array, errors: Array, space: Box, section: Section, shown: Sequence[Array]) -> None:
    ax.set_title(f"{len(errors)} benchmark goals, mean error {space.amount(float(errors.mean()), '.3g')}")
    least, most = (share * float(space.sides.max()) for share in SCALE)
    misses(ax, goals, errors, space, section, most, "error", least=least)
    if shown:
        x, y = section.points(np.stack(shown)).T
        ax.plot(x, 0 * y if section.is_strip else y, "x", color="#d55e00", markersize=5)
    ax.autoscale()  # limits around the goals, even in a large space


def _interest(ax: Axes, lows: Array, highs: Array, interests: Array, section: Section) -> None:
    scale = Normalize(0, float(interests.max()) or 1.0)
    colour_bar(ax, regions_in(ax, lows, highs, interests, section, "magma", scale), "interest")
    section.frame(ax)


def _pixels(picture: Callable[[Axes, Section], object], maps: Sequence[Section]) -> NDArray[np.uint8]:
    """The pixels of a picture with its sections side by side, as large as TensorBoard shows it."""
    size = (4.2 * len(maps), maps[0].height(WIDE) + MARGIN)
    with style.context(STYLE, after_reset=True):
        figure = Figure(size, dpi=120, layout="compressed")
        for ax, section in zip(figure.subplots(1, len(maps), squeeze=False).flat, maps, strict=True):
            picture(ax, section)
        figure.draw_without_rendering()  # the layout needs two passes; a single pass cuts labels off
        return pixels(figure)
