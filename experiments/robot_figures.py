"""Figures of the pages ANY_ROBOT and CHANGES, from robots.csv and changes.csv; figures.py draws them.

figure = shares(Evidence.of(Path("results")))
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from changing import ANEW, ARM, BEGUN, CHANGES, GOES_ON, ROBOTS, SIMULATOR, WRONG, after
from evidence import Evidence
from random_robots import COUNTS, FAMILIES, LEARNERS, NOISES, RANDOM, kind
from robots import COMPARED, after_change, best, clearly_harmed, errors, over_anew, share
from sgimd_torch.extras.table.names import COLOURS, NAMES
from sgimd_torch.extras.table.statistics import Interval, bootstrap_rng, iqm_interval
from sgimd_torch.spaces import Array

FACTORS: Final = np.geomspace(1, 8, 43)  # of a performance profile
KINDS_AT: Final = 250
BEGINNINGS: Final = {ANEW: "nothing", GOES_ON: "the simulator", WRONG: "a mirrored simulator"}


def shares(evidence: Evidence) -> Figure:
    """Share of random robots on which each learner is best, and which are clearly harmed, against movements."""
    figure, panels = _panels("learner is best", "clearly worse than random")
    for name in LEARNERS:
        by_count = [best(evidence, name, at) for at in COUNTS]
        _drawn(panels[0], COUNTS, by_count, COLOURS[name], NAMES[name], "o-")
    for column, name in (("harmed", "practice"), ("equal", RANDOM)):
        by_count = [clearly_harmed(evidence, at, column) for at in COUNTS]
        _drawn(panels[1], COUNTS, by_count, COLOURS[name], NAMES[name], "o-")
    panels[1].text(COUNTS[-1], 0.9, "random: with other seeds", ha="right")
    for ax in panels:
        ax.set(xscale="log", xlabel="movements executed", ylim=(0, 1))
        _ticks(ax, COUNTS)
    _legend(figure, panels[0])
    return figure


def profile(evidence: Evidence) -> Figure:
    """Performance profiles: share of random robots on which an error is within a factor of the smallest one."""
    figure, panels = _panels("after 250 movements", "after 1000 movements")
    for ax, at in zip(panels, (250, 1000), strict=True):
        table = errors(evidence, at)
        ratios = table.div(table.min(axis=1), axis=0)
        for name in LEARNERS:
            within = [share(ratios[name] <= factor) for factor in FACTORS]
            _drawn(ax, FACTORS, within, COLOURS[name], NAMES[name], "-")
        ax.set(xscale="log", xlabel="error / smallest error, at most", ylim=(0, 1), xlim=(1, FACTORS[-1]))
        _ticks(ax, (1, 2, 4, 8))
    _legend(figure, panels[0])
    return figure


def kinds(evidence: Evidence) -> Figure:
    """Errors over those of random movements, by family and by noise of the random robots."""
    table = errors(evidence, KINDS_AT)
    ratios = np.log(table.div(table[RANDOM], axis=0))
    of = [kind(int(number))[:2] for number in table.index]
    rows = {**{f"{name} noise" if name != "none" else "no noise": (1, name) for name in NOISES[::-1]},
            **{name: (0, name) for name in FAMILIES[::-1]}}  # fmt: skip
    figure = Figure(figsize=(7.5, 5.6), layout="constrained")
    ax = figure.subplots()
    for name in COMPARED:
        means = [np.exp(ratios[name][[names[place] == word for names in of]].mean()) for place, word in rows.values()]
        ax.plot(means, range(len(rows)), "o", color=COLOURS[name], markersize=8, label=NAMES[name])
    ax.axvline(1, color="black", linewidth=1, zorder=0)
    ax.axhline(len(NOISES) - 0.5, color="0.7", linewidth=1, zorder=0)
    ax.set_yticks(range(len(rows)), [*rows])
    ax.set(xscale="log", xlabel=f"error / error of random movements, after {KINDS_AT}")
    _ticks(ax, (0.2, 0.3, 0.5, 0.7, 1, 1.4, 2))
    ax.grid(alpha=0.3)
    _legend(figure, ax)
    return figure


def changes(evidence: Evidence) -> Figure:
    """Errors after a change over those of a learner that starts anew: a panel for each robot, numbers in cells."""
    figure = Figure(figsize=(7.5, 4), layout="constrained")
    panels = figure.subplots(1, len(ROBOTS), sharey=True)
    for ax, robot in zip(panels, ROBOTS, strict=True):
        times = after(robot)
        cells = np.array(
            [[over_anew(evidence, robot, change, at, level=None).value for at in times] for change in CHANGES]
        )
        ax.pcolormesh(cells, cmap="RdBu_r", norm=LogNorm(0.1, 10), edgecolors="white", linewidth=2)
        for (row, column), ratio in np.ndenumerate(cells):
            colour = "black" if 0.25 < ratio < 4 else "white"
            ax.text(column + 0.5, row + 0.5, f"{ratio:.2f}", ha="center", va="center", color=colour)
        ax.set_xticks(np.arange(len(times)) + 0.5, map(str, times))
        ax.set_yticks(np.arange(len(CHANGES)) + 0.5, [change.replace("-0", " 0") for change in CHANGES])
        ax.set(title=robot, ylim=(len(CHANGES), 0))
        ax.tick_params(length=0)
        ax.spines[:].set_visible(False)
    figure.supxlabel("movements after the change")
    return figure


def simulator(evidence: Evidence) -> Figure:
    """Error on the arm as it was built, of learners that begin with what a simulator showed or with nothing."""
    figure = Figure(figsize=(7.5, 4), layout="constrained")
    ax = figure.subplots()
    for (learner, name), colour in zip(BEGINNINGS.items(), ("random", "practice", "sagg-riac"), strict=True):
        by_seed = [after_change(evidence, ARM, SIMULATOR, learner, at).to_numpy() for at in BEGUN]
        means = [iqm_interval(errors, rng=bootstrap_rng()) for errors in by_seed]
        _drawn(ax, BEGUN, means, COLOURS[colour], f"begun with {name}", "o-")
    ax.set(xscale="log", yscale="log", xlabel="movements on the real arm", ylabel="mean distance to the goals (m)")
    _ticks(ax, BEGUN)
    ax.set_yticks((0.03, 0.05, 0.1, 0.2, 0.3), ("0.03", "0.05", "0.1", "0.2", "0.3"))
    ax.set_yticks([], minor=True)
    ax.legend(frameon=False)
    ax.grid(alpha=0.3)
    return figure


FIGURES: Final = {figure.__name__: figure for figure in (shares, profile, kinds, changes, simulator)}


def _panels(*titles: str) -> tuple[Figure, Array]:
    figure = Figure(figsize=(7.5, 4.2), layout="constrained")
    panels = figure.subplots(1, 2, sharey=True)
    for ax, title in zip(panels, titles, strict=True):
        ax.set_title(title)
        ax.grid(alpha=0.3)
    panels[0].set_ylabel("share of the robots")
    return figure, panels


def _drawn(ax: Axes, x: ArrayLike, intervals: Sequence[Interval], colour: str, name: str, form: str) -> None:
    """Draw a curve, with its intervals as a band; earlier curves lie above later ones."""
    middle, low, high = np.array(intervals).T
    ax.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0)
    ax.plot(x, middle, form, color=colour, markersize=5, label=name, zorder=3 - 0.1 * len(ax.lines))


def _ticks(ax: Axes, places: tuple[float, ...]) -> None:
    ax.set_xticks(places, [f"{tick:g}" for tick in places])
    ax.set_xticks([], minor=True)


def _legend(figure: Figure, ax: Axes) -> None:
    figure.legend(*ax.get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
