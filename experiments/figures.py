"""Draw the figures of the pages of results from results/results.csv. The inverse model is `process` in all of them.

  learning    error against movements, of learners with and without a teacher      (README, LEARNING)
  paper       the paper's five learners, in its task space and in the larger one    (RESULTS)
  gain        error after each step from random movements to practice               (GAIN)
  curiosity   error with goals by interest, divided by the error with uniform goals (CURIOSITY)
  shares      random robots on which each learner is best, and that practice harms    (ANY_ROBOT)
  profile     random robots on which an error is within a factor of the smallest     (ANY_ROBOT)
  kinds       error over that of random movements, by family and by noise            (ANY_ROBOT)
  changes     error after a change, divided by the error of starting anew             (CHANGES)
  simulator   error on a real arm, begun with a simulator or with nothing             (CHANGES)
  models      error of practice over that of random movements, by model file          (ANY_ROBOT)

Points are interquartile means over seeds, with 95 % intervals. If a figure has no data, a message says so.

Example:
  python experiments/figures.py
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Final

from sgimd_torch.runs.messages import say
from sgimd_torch.runs.program import command
from sgimd_torch.runs.signals import loading

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from claimed import WHOLE
    from evidence import LAST, Evidence, NotRun
    from page_tables import GAIN
    from robot_figures import FIGURES as OF_ROBOTS
    from sgimd_torch.extras.report.maps import curve_in_band
    from sgimd_torch.extras.report.save import save_figure
    from sgimd_torch.extras.table.names import COLOURS, NAMES
    from sgimd_torch.extras.table.statistics import Interval, bootstrap_rng, iqm_interval
    from sgimd_torch.files import make_folder

ERROR: Final = "mean distance to the goals (m)"
LEARNERS: Final = ("random", "sagg-riac", "observation", "imitation", "sgim-d")  # learners of the paper


def learning(evidence: Evidence) -> Figure:
    """Error against movements on the rod."""
    figure = Figure(figsize=(8, 4.4), layout="constrained")
    ax = figure.subplots()
    names = ("random", "sagg-riac", "sgim-d", "practice", "practice-wide", "practice-taught")
    curves(ax, evidence, {name: name for name in names})
    return figure


def paper(evidence: Evidence) -> Figure:
    """Error against movements of the paper's five learners, and of three of them in the larger space."""
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    small, large = figure.subplots(1, 2, sharey=True)
    curves(small, evidence, {name: name for name in LEARNERS})
    curves(large, evidence, {"random": "random", "sagg-riac": "sagg-riac-large", "sgim-d": "sgim-d-large"})
    small.set_title("the paper's task space")
    large.set(title="10⁴ times larger", ylabel="")
    return figure


def gain(evidence: Evidence) -> Figure:
    """The error after 1000 movements on the rod, at each step of GAIN."""
    return _rows({step: partial(evidence.error, name, 1000) for step, name in GAIN.items()}, ERROR)


def curiosity(evidence: Evidence) -> Figure:
    """The error with goals by interest divided by the error with uniform goals."""
    pairs = {
        "SGIM-D, T 10⁴ times larger, 5000": ("sgim-d-large", "sgim-d-uniform-large", LAST),
        "... by the paper's eq. (3), 5000": ("sgim-d-absolute-large", "sgim-d-uniform-large", LAST),
        "SGIM-D, 5000": ("sgim-d", "sgim-d-uniform", LAST),
        "practice, 5000": ("practice-interest", "practice", LAST),  # nearly all of T is within reach
    }
    numbers = {label: partial(evidence.ratio, *pair) for label, pair in pairs.items()}
    figure = _rows(numbers, "error with interest / with uniform goals", form=".2f")
    (ax,) = figure.axes
    ax.axvline(1, color="black", linewidth=1, zorder=0)
    ax.set_xscale("log")
    ax.set_xticks((0.5, 0.7, 1, 1.5, 2, 3), ("0.5", "0.7", "1", "1.5", "2", "3"))
    ax.set_xticks([], minor=True)
    return figure


def models(evidence: Evidence) -> Figure:
    """The error of practice divided by that of random movements, on each model file that is told to be right."""
    rows = evidence.models.dropna(subset="ratio").sort_values("ratio").to_dict("records")
    numbers = {
        f"{row['file'].partition('/')[0]} {Path(row['file']).parent.name}/{Path(row['file']).name} {row['outcome']}": (
            partial(Interval, row["ratio"], row["low"], row["high"])
        )
        for row in rows
    }
    figure = _rows(numbers, "error of practice / of random movements, after 500", form=".2f")
    (ax,) = figure.axes
    ax.axvline(1, color="black", linewidth=1, zorder=0)
    return figure


FIGURES: Final[dict[str, Callable[[Evidence], Figure]]] = {
    **{figure.__name__: figure for figure in (learning, paper, gain, curiosity, models)},
    **OF_ROBOTS,
}


def curves(ax: Axes, evidence: Evidence, variants: Mapping[str, str]) -> None:
    """Draw errors against movements, with intervals as bands; ``variants`` has a variant for each algorithm.

    The axis of movements is logarithmic, because learners differ most in the first movements.
    """
    ends: dict[str, float] = {}
    for algorithm, name in variants.items():
        curve = evidence.curve(name)
        movements = curve.columns
        centre, low, high = np.array([iqm_interval(curve[at], rng=bootstrap_rng()) for at in movements]).T
        curve_in_band(ax, movements, (centre, low, high), COLOURS[algorithm], NAMES[algorithm])
        ends[algorithm] = centre[-1]
    ax.set(xscale="log", xlabel="movements executed", ylabel=ERROR)
    ax.set_xlim(right=3.2 * LAST)
    ax.set_ylim(bottom=0)
    ax.set_xticks(WHOLE, map(str, WHOLE))
    ax.set_xticks([], minor=True)
    ax.grid(alpha=0.3)
    height, gap = -np.inf, 0.06 * ax.get_ylim()[1]
    for algorithm, end in sorted(ends.items(), key=lambda item: item[1]):
        height = max(end, height + gap)  # so that names do not overlap
        ax.text(1.1 * LAST, height, NAMES[algorithm], color=COLOURS[algorithm], va="center")


def _rows(numbers: Mapping[str, Callable[[], Interval]], label: str, form: str = ".3f") -> Figure:
    """A figure with a row, a point with its interval, for each of the ``numbers`` that has runs."""
    intervals: dict[str, Interval] = {}
    for name, number in numbers.items():
        try:
            intervals[name] = number()
        except NotRun as missing:
            say(f"left out; not run: {missing}")
    if not intervals:
        raise NotRun("any row of this figure")
    figure = Figure(figsize=(9, 1 + 0.34 * len(intervals)), layout="constrained")
    ax = figure.subplots()
    for height, measured in enumerate(intervals.values()):
        ax.plot([measured.low, measured.high], [height, height], color="black")
        ax.plot(measured.value, height, "o", color="black", markersize=6)
        ax.annotate(
            f"{measured.value:{form}}",
            (measured.value, height),
            (0, 6),
            textcoords="offset points",
            ha="center",
            size=9,
        )
    ax.set_yticks(range(len(intervals)), [name.replace("`", "") for name in intervals])
    ax.set(xlabel=label, ylim=(len(intervals) - 0.4, -0.8))
    ax.grid(axis="x", alpha=0.3)
    return figure


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the figures whose runs are in the tables; the exit code is 2 if a table is damaged."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of tables (default: %(default)s)")
    parser.add_argument(
        "--out", type=Path, default=Path("results/figures"), help="folder of the figures (default: %(default)s)"
    )
    parser.add_argument("--only", choices=FIGURES, help="figure to draw (default: all)")
    options = parser.parse_args(argv)
    evidence = Evidence.of(options.results)
    make_folder(options.out)
    for name in FIGURES if options.only is None else [options.only]:
        try:
            save_figure(partial(FIGURES[name], evidence), path := options.out / f"{name}.svg")
            print(path)
        except NotRun as missing:
            say(f"{name} is left out; not run: {missing}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
