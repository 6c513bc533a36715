"""The pictures on the board: T from above, coloured by error and by competence.

pictures = draw(regions, space, benchmark, errors); pictures["map/competence"] is a png, by its tag
"""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from sgimd_torch.board.curves import DEPTH, branches
from sgimd_torch.figures.learning import competence_map, misses
from sgimd_torch.figures.sections import Section, sections
from sgimd_torch.goals.regions import Region
from sgimd_torch.spaces import Array, Box

# Fixed scales, so that pictures of different times and runs can be compared; values beyond look like the end.
WORST = -0.25
SHARE = 0.15  # of the longest side of T: the error at the end of the colours
NARROW = 0.2  # of the picture's width; the name of a narrower region stands upright
THIN = 0.1  # of the picture's side; narrower than a name
WIDE = 2.5  # inches, of the axes of a picture; beside them is the colour bar
MARGIN = 0.9  # inches, above and below them together
STYLE: Any = {"font.size": 8, "axes.titlesize": 8}


def draw(regions: Sequence[Region], space: Box, benchmark: Array, errors: Array) -> dict[str, bytes]:
    """The pictures, as png, by tag.

    Args:
        regions: of the goal model; no picture of them if there are none.
        space: T; of more than two dimensions, a picture shows pairs next to each other.
        benchmark, errors: ``(n, outcome_dim)`` its goals, and ``(n,)`` how far from each its answer landed.
    """
    pictures: dict[str, Callable[[Axes, Section], object]] = {}
    pictures["map/error"] = lambda ax, section: _errors(ax, benchmark, errors, space, section)
    if regions:
        pictures["map/competence"] = lambda ax, section: _competence(ax, regions, section)
    return {name: _png(picture, sections(space)) for name, picture in pictures.items()}


def _competence(ax: Axes, regions: Sequence[Region], section: Section) -> None:
    means = [region.competences.mean() if len(region.goals) else np.nan for region in regions]
    competence_map(ax, *_boxes(regions), np.array(means), section, worst=WORST)
    _name(ax, regions, section)


def _errors(ax: Axes, benchmark: Array, errors: Array, space: Box, section: Section) -> None:
    ax.set_title(f"{len(errors)} benchmark goals, mean error {space.amount(float(errors.mean()), '.3f')}")
    misses(ax, benchmark, errors, space, section, SHARE * float(space.sides.max()))
    ax.autoscale()  # where the goals are, even in a large space


def _name(ax: Axes, regions: Sequence[Region], section: Section) -> None:
    """Frame and name the regions of the curves."""
    lows, highs, met = section.cut(*_boxes(regions))
    rows = {regions[k]: row for row, k in enumerate(np.flatnonzero(met).tolist())}
    named, (lowest, highest) = branches(list(rows), DEPTH), (lows.min(axis=0), highs.max(axis=0))
    frontier = [path for path in named if not {f"{path}0", f"{path}1"} & named.keys()]
    for k, path in enumerate(frontier):
        among = [rows[region] for region in named[path]]
        low, high = lows[among].min(axis=0), highs[among].max(axis=0)
        ax.add_patch(Rectangle((low[0], low[1]), *(high - low), fill=False, edgecolor="black", linewidth=1.6))
        size = (high - low) / (highest - lowest)
        upright = size[0] < NARROW and size[1] > size[0]
        place = np.full(2, 0.5)
        if size.min() < THIN:  # names of neighbours must not cover each other
            place[int(size.argmax())] = (0.25, 0.75)[k % 2]
        x, y = low + place * (high - low)
        text = ax.text(x, y, path, ha="center", va="center", fontweight="bold", rotation=90 if upright else 0)
        text.set_bbox({"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.2})


def _boxes(regions: Sequence[Region]) -> tuple[Array, Array]:
    return np.stack([region.low for region in regions]), np.stack([region.high for region in regions])


def _png(picture: Callable[[Axes, Section], object], shown: Sequence[Section]) -> bytes:
    """A png, as large as TensorBoard shows it; the sections next to each other."""
    n, height = len(shown), shown[0].height(WIDE) + MARGIN
    with rc_context(STYLE):
        figure = Figure(figsize=(4.0 * n, height), dpi=90)
        axes = figure.subplots(1, n, squeeze=False)
        edge = MARGIN / 2 / height
        figure.subplots_adjust(left=0.15 / n, bottom=edge, right=1 - 0.08 / n, top=1 - edge, wspace=0.4)
        for ax, section in zip(axes.flat, shown, strict=True):
            picture(ax, section)
        content = io.BytesIO()
        figure.savefig(content, format="png", pil_kwargs={"compress_level": 3})
    return content.getvalue()
