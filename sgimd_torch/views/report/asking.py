"""Learners that ask, in a report: who was asked when, what for, and what it brought; a table and two figures.

table = requests_of(variants); source = over_time(life); source = over_goals(life)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from sgimd_torch.figures.axes import LEGEND, colour_bar, colours, limits, over_movements
from sgimd_torch.figures.learning import map_after, regions_in
from sgimd_torch.figures.sections import of_regions, sections
from sgimd_torch.goals.strategic import AUTONOMOUS
from sgimd_torch.runs.read import points_of
from sgimd_torch.spaces import Array
from sgimd_torch.views.report.data import Life, Variant
from sgimd_torch.views.report.figures import png
from sgimd_torch.views.report.record import Table

LATE: Final = 1000  # movements; from then on a learner should know whom to ask
PARTS: Final = 20  # of a life, each with its shares
_REPLIES: Final = ("shown", "again", "nothing", "failed", "timed out")
_ALONE: Final = "#d9d9d9"
HEAD: Final = (
    *("requests", *_REPLIES, "shown this far from the goal (m), median"),
    *("a demonstration raised the competence at the goal by", f"requests from movement {LATE} on"),
)


def asks(life: Life) -> bool:
    """Whether it has asked anybody, and its movements are there."""
    return life.requests is not None and len(life.requests["index"]) > 0 and len(life.index) > 0


def requests_of(variants: Sequence[Variant]) -> Table:
    """A row for each teacher of each variant whose learners asked; numbers of requests are means over runs."""
    rows = []
    for variant in variants:
        tables = [life.requests for life in variant.used or variant.lives if life.requests is not None]
        for teacher in dict.fromkeys(name for each in tables for name in each["teacher"].tolist()):
            rows.append((f"{variant.label}: {teacher}", _row(tables, teacher)))
    return Table(list(HEAD), rows)


def strategies(life: Life) -> NDArray[np.str_]:
    """``(n,)`` by which strategy each movement was made: what it does with what was shown, rests for it included."""
    assert life.requests is not None
    found, asked = np.full(len(life.index), AUTONOMOUS, dtype=object), life.requests
    own, ends = (life.origin != "imitate") & (life.origin != ""), np.append(asked["index"][1:], len(life.index))
    for begin, end, strategy, reply, got in zip(
        asked["index"],
        ends,
        asked["strategy"],
        asked["reply"],
        points_of(asked, "got", life.outcomes.shape[1]),
        strict=True,
    ):
        if reply == "shown":
            span = slice(begin, end)
            alone = own[span] & (life.goals[span] != got).any(axis=1)
            n = int(alone.argmax()) if alone.any() else end - begin
            found[begin : begin + n] = strategy
    return found.astype(np.str_)


@png
def over_time(figure: Figure, life: Life) -> None:
    """Shares of the movements by strategy, and what each demonstration brought."""
    figure.set_size_inches(6.4, 6.4)
    assert life.requests is not None
    above, below = figure.subplots(2, 1, sharex=True)
    used, asked = strategies(life), life.requests
    coloured = colours(asked["strategy"])
    edges = np.linspace(0, len(used), min(PARTS, len(used)) + 1)
    parts = [used[int(low) : int(high)] for low, high in pairwise(edges)]
    bottom = np.zeros(len(parts))
    for strategy, colour in {**coloured, AUTONOMOUS: _ALONE}.items():
        shares = np.array([100 * np.mean(part == strategy) for part in parts])
        above.bar(edges[:-1], shares, np.diff(edges), bottom, align="edge", color=colour, label=strategy)
        bottom += shares
    over_movements(above, "share of movements (%)")
    above.set(xlabel="", ylim=(0, 100))
    above.legend(**LEGEND)
    for strategy, colour in coloured.items():
        mine = (asked["strategy"] == strategy) & (asked["reply"] == "shown")
        below.plot(asked["index"][mine], asked["brought"][mine], "o", color=colour, markersize=4, alpha=0.7)
    over_movements(below, "competence raised at the goal by")
    below.set_ylim(bottom=0)


@png
def over_goals(figure: Figure, life: Life) -> None:
    """Where the goals lie that were asked for, by strategy; and in which share of its goals each region was asked."""
    assert life.requests is not None
    asked, dim = life.requests, life.outcomes.shape[1]
    wanted, ax = points_of(asked, "wanted", dim), figure.subplots()
    if life.has_map and life.regions is not None:
        lows, highs, _ = map_after(life.regions, life.regions["movements"].max())
        section = of_regions(lows, highs, dim)[0]
        own = life.goals[strategies(life) == AUTONOMOUS]
        shares = [_share(wanted, own, low[-dim:], high[-dim:]) for low, high in zip(lows, highs, strict=True)]
        drawn = regions_in(ax, lows, highs, np.ma.masked_invalid(shares), "Greys", (0, 100), section)
        colour_bar([ax], drawn, "goals in this region that it asked for (%)")
    else:
        section = sections(limits(wanted))[0]
    for strategy, colour in colours(asked["strategy"]).items():
        x, y = section.points(wanted[asked["strategy"] == strategy]).T
        ax.plot(x, y, "o", color=colour, markersize=4, markeredgecolor="white", markeredgewidth=0.5, label=strategy)
    section.frame(ax)


def _share(asked: Array, own: Array, low: Array, high: Array) -> float:
    """Of the goals between two corners, NaN without any."""
    there = [int(((goals >= low) & (goals <= high)).all(axis=1).sum()) for goals in (asked, own)]
    return 100 * there[0] / sum(there) if sum(there) else np.nan


def _row(tables: Sequence[Mapping[str, np.ndarray]], teacher: str) -> list[str]:
    columns = {name: np.concatenate([each[name] for each in tables]) for name in tables[0]}
    mine = columns["teacher"] == teacher
    shown = mine & (columns["reply"] == "shown")
    replies = [mine & (columns["reply"] == reply) for reply in _REPLIES]
    counts = [f"{each.sum() / len(tables):.3g}" for each in (mine, *replies)]
    apart, brought = (columns[name][shown & np.isfinite(columns[name])] for name in ("apart_m", "brought"))
    late = (mine & (columns["index"] >= LATE)).sum() / len(tables)
    return [
        *counts,
        f"{np.median(apart):.3f}" if len(apart) else "–",
        f"{brought.mean():.3f}" if len(brought) else "–",
        f"{late:.3g}",
    ]
