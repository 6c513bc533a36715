"""The figures of the paper's results, from results/results.csv and, for figures of movements, from run directories.

All errors are those of ``LocallyLinear``'s answers, so that learners are compared by what they have explored.

Each is written as png and svg. A figure without its data is left out, and a message says what is missing.

  errors         error against movements, five learners           (fig. a of the paper's results)
  demonstrators  the same with each of three demonstrators         (b)
  landing        where the float landed, tiles reached             (c, needs RUNS)
  trajectories   what the demonstrators show, joint by joint       (d)
  large_space    error where the task space is 10^4 times larger   (e)
  goals          the goals chosen there                            (f, needs RUNS)
  variants       what each change of SGIM-D, and each rival, makes
  swimmer        error on a robot of gymnasium, by who explored and who answered

Example:
  python experiments/figures.py --results results --runs runs --out results/figures
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from sgimd_torch.runs.process import command, loading

with loading():  # Ctrl-C shows no traceback
    import numpy as np
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from judging import LAST, LEARNERS, NotRun, Results
    from sgimd_torch.catalogue import label
    from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
    from sgimd_torch.environments.fishing_rod import JOINTS
    from sgimd_torch.figures import movements as plots_of_movements
    from sgimd_torch.figures.learning import COLOURS, NAMES, count_bar, landing_points, tile_counts
    from sgimd_torch.figures.results import Difference, SeedCurves, forest, goal_distances, goal_histogram, seed_curves
    from sgimd_torch.figures.save import save_figure
    from sgimd_torch.files import make_folder
    from sgimd_torch.runs.config import OWN
    from sgimd_torch.runs.read import Run
    from sgimd_torch.spaces import Array, Box
    from sgimd_torch.views.statistics import Interval, iqm_interval, paired_differences, rng
    from table import read_seeds
    from variants import EXPERIMENTS, PAPER, SWIMMERS, shipped

BAND = "thick: interquartile mean, band: its 95 % interval, thin: seeds"
DEMONSTRATORS = {
    1: "Demonstrator 1: naive\n(movements of SAGG-RIAC, at random)",
    2: "Demonstrator 2: careful\n(the most reliable of them)",
    3: "Demonstrator 3: structured\n(simulated person)",
}
PANELS = {
    "ablations": "One part of SGIM-D changed",
    "baselines": "Other learners",
    "teaching": "Taught otherwise",
    "letter": "The paper to the letter",
    "ladder": "From there to our defaults, step by step",
}
SWIMMER_ANSWERS = {
    "nearest": "the nearest neighbour",
    "linear": "LocallyLinear",
    "process": "LocalProcess",
    "model-alone": "the forward model",
}
MOVING = (("random", "sagg-riac"), ("imitation", "sgim-d"))  # the paper's learners that execute movements
REACH = 1.5  # m; the float hardly ever lands farther from the base


@dataclass(frozen=True, eq=False)
class Data:
    """The data of figures: the results, and the folder of run directories."""

    results: Results
    folder: Path

    def curves(self, variant: str, algorithm: str, label: str, *, dashed: bool = False) -> SeedCurves:
        """Error curves up to the paper's 5000 movements; raises ``NotRun`` if no seed has a whole one."""
        movements, errors = self.results.curves(variant)
        if not errors.size:
            raise NotRun(f"whole curves of {variant}")
        centre, low, high = np.array([_interval(column) for column in errors.T]).T
        return SeedCurves(algorithm, label, movements, errors, centre, low, high, dashed)

    def last(self, variant: str, values: str) -> Array:
        """``(n_seeds,)`` "floor" or "tiles" after the paper's 5000 movements; empty for a variant that was not run."""
        return np.array([*self.results.by(OWN).some(variant, LAST, values).values()])

    def runs(self, variant: str) -> list[Run]:
        """All seeds; raises ``NotRun`` if there is none, ``RunError`` if one is damaged."""
        if runs := read_seeds(self.folder, variant):
            return runs
        raise NotRun(f"run directories {self.folder}/{variant}/seed-*")


def errors(data: Data) -> Figure:
    """(a): the five learners."""
    figure = _figure(8, 5.6)
    ax = figure.subplots()
    lines = seed_curves(ax, [data.curves(name, name, NAMES[name]) for name in LEARNERS])
    for name in LEARNERS:
        floors = data.last(name, "floor")
        if len(floors):
            ax.plot(LAST, _interval(floors).value, "_", color=COLOURS[name], markersize=20, markeredgewidth=2.5)
    bar = Line2D([], [], color="black", marker="_", linestyle="", markersize=14, markeredgewidth=2.5)
    ax.legend(
        [*lines, bar], [*(str(line.get_label()) for line in lines), f"noise floor of each at {LAST}"], loc="upper right"
    )
    ax.set_title(f"Five learners ({BAND})", fontsize=11)
    return figure


def demonstrators(data: Data) -> Figure:
    """(b): one panel for each demonstrator, and SAGG-RIAC, which has none, in all of them."""
    panels = {}
    for teacher in DEMONSTRATORS:
        suffix = "" if teacher == 3 else f"-teacher-{teacher}"
        names = [name for name in ("observation", "imitation", "sgim-d") if data.results.known([name + suffix])]
        if names:
            panels[teacher] = [data.curves(name + suffix, name, NAMES[name]) for name in names]
    if not panels:
        raise NotRun("any taught learner")
    figure = _figure(1 + 4.6 * len(panels), 5.4)
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    alone = [data.curves("sagg-riac", "sagg-riac", f"{NAMES['sagg-riac']}, not taught")]
    for ax, (teacher, curves) in zip(axes, panels.items(), strict=True):
        seed_curves(ax, curves + alone)
        ax.set_title(DEMONSTRATORS[teacher])
        ax.label_outer()
    figure.suptitle(BAND, fontsize=11)
    return figure


def landing(data: Data) -> Figure:
    """(c): where the float landed, all seeds together on one scale, and the number of tiles reached."""
    runs = {name: data.runs(name) for row in MOVING for name in row}
    pooled = {name: np.concatenate([run.outcomes for run in found]) for name, found in runs.items()}
    landed = {name: outcomes[np.isfinite(outcomes[:, 0])] for name, outcomes in pooled.items()}
    box = Box.cube(-REACH, REACH, 2)
    most = max(float(tile_counts(outcomes, box).max()) for outcomes in landed.values())
    figure = _figure(14, 9)
    axes = figure.subplot_mosaic([[*row, "tiles"] for row in MOVING], width_ratios=[1, 1, 0.9])
    for name, outcomes in landed.items():
        shown = _demonstrated(runs[name]) if name == "sgim-d" else None
        mesh = landing_points(axes[name], outcomes, box, demonstrated=shown, most=most, colour_bar=False)
        mesh.set_rasterized(True)  # thousands of tiles, in an svg
        axes[name].set_title(f"{NAMES[name]} ({len(runs[name])} seeds)", pad=28)
    count_bar([axes[name] for name in landed], mesh, "movements on a tile of 5 cm, all seeds together")
    _tiles_reached(axes["tiles"], data)
    return figure


def trajectories(data: Data) -> Figure:
    """(d): what the demonstrators show, joint by joint; a row for each whose recordings exist."""
    shown = {each: load_demonstrations(path) for each in DEMONSTRATORS if (path := shipped(each)).exists()}
    if not shown:
        raise NotRun("recordings of any demonstrator")
    figure = _figure(2.4 * len(JOINTS), 2.6 * len(shown))
    grid = figure.subplots(len(shown), len(JOINTS), sharex=True, sharey="col", squeeze=False)
    for axes, (teacher, demonstrations) in zip(grid, shown.items(), strict=True):
        plots_of_movements.trajectories(axes, demonstrations, names=[joint.replace("_", " ") for joint in JOINTS])
        axes[0].set_ylabel(f"{DEMONSTRATORS[teacher].splitlines()[0]}\nangle (rad)")
        for ax in axes[1:]:
            ax.set_ylabel("")
        for line in (line for ax in axes for line in ax.lines):
            line.set_rasterized(True)  # thousands of points would make an SVG of megabytes
    for ax in grid[:-1].flat:
        ax.set_xlabel("")
    for ax in grid[1:].flat:
        ax.set_title("")
    return figure


def large_space(data: Data) -> Figure:
    """(e): the learners in a T 100 times wider, and in the usual T."""
    figure = _figure(8, 5.6)
    ax = figure.subplots()
    small, large = "T = [−1, 1]²", "T = [−100, 100]²"
    seed_curves(
        ax,
        [
            data.curves("random", "random", f"{NAMES['random']}, any T"),
            data.curves("sagg-riac-large", "sagg-riac", f"{NAMES['sagg-riac']}, {large}", dashed=True),
            data.curves("sagg-riac", "sagg-riac", f"{NAMES['sagg-riac']}, {small}"),
            data.curves("sgim-d-large", "sgim-d", f"{NAMES['sgim-d']}, {large}", dashed=True),
            data.curves("sgim-d", "sgim-d", f"{NAMES['sgim-d']}, {small}"),
        ],
    )
    ax.set_title(f"A task space 10⁴ times larger ({BAND})", fontsize=11)
    return figure


def goals(data: Data) -> Figure:
    """(f): goals that learners chose themselves in the large task space, and their distance from the base."""
    runs = {name: data.runs(f"{name}-large") for name in ("sagg-riac", "sgim-d")}
    chosen = {name: [run.chosen_goals() for run in found] for name, found in runs.items()}
    half_side = max(float(run.config["environment.task_space"]) for found in runs.values() for run in found)
    box, side = Box.cube(-half_side, half_side, 2), half_side / 20
    pooled = {name: np.concatenate(seeds) for name, seeds in chosen.items()}
    most = max(float(tile_counts(each, box, side).max()) for each in pooled.values())
    figure = _figure(15, 4.9)
    axes = figure.subplots(1, 3)
    for ax, (name, each) in zip(axes, pooled.items(), strict=False):
        mesh = goal_histogram(ax, each, box, side=side, most=most)
        mesh.set_rasterized(True)
        ax.set_title(f"{NAMES[name]}: {len(each)} goals ({len(chosen[name])} seeds)")
    count_bar(axes[:2], mesh, f"goals on a tile of {side:g} m")
    goal_distances(axes[2], chosen, reach=REACH)
    axes[2].set_title("How far they lie")
    return figure


def variants(data: Data) -> Figure:
    """The error when SGIM-D is changed, taught differently or replaced; one panel for each experiment."""
    panels: dict[str, list[Difference]] = {}
    for experiment in PANELS:
        for name in EXPERIMENTS[experiment]:
            if len(data.results.some(name)) > 1:
                seeds = paired_differences(*data.results.pairs(name, "sgim-d"))
                row = Difference(name, seeds, *data.results.difference(name, "sgim-d"))
                panels.setdefault(experiment, []).append(row)
    if not panels:
        raise NotRun("any variant of SGIM-D")
    rows = [len(panel) for panel in panels.values()]
    figure = _figure(8.5, 1.4 + 0.36 * sum(rows) + 0.5 * len(rows))
    axes = figure.subplots(len(rows), 1, sharex=True, squeeze=False, height_ratios=rows)[:, 0]
    for ax, (experiment, panel) in zip(axes, panels.items(), strict=True):
        forest(ax, panel, reference="SGIM-D", space=Box.cube(-1, 1, 2, unit="m"))
        ax.set_title(PANELS[experiment], loc="left")
        ax.label_outer()
    figure.suptitle(
        f"Error after {LAST} movements: ← better than SGIM-D | worse →\n"
        "interquartile mean with 95 % interval, full where it excludes 0; ticks are seeds",
        fontsize=11,
    )
    return figure


def swimmer(data: Data) -> Figure:
    """A robot that nobody here wrote: the same movements, answered in four ways; practice has no model."""
    figure = _figure(16, 4.6)
    axes = figure.subplots(1, len(SWIMMER_ANSWERS), sharey=True)
    for ax, (answer, title) in zip(axes, SWIMMER_ANSWERS.items(), strict=True):
        answered = replace(data, results=data.results.by(answer))
        explored = [*SWIMMERS, *(["practice"] if answer != "model-alone" else [])]
        seed_curves(ax, [answered.curves(f"{name}-swimmer", name, label(name)) for name in explored])
        ax.set_title(f"answered by {title}", fontsize=11)
        ax.label_outer()
    axes[0].set_ylim(0, 1.05 * max(line.get_ydata().max() for ax in axes for line in ax.lines))
    figure.suptitle(f"Swimmer-v5 ({BAND})", fontsize=11)
    return figure


FIGURES: dict[str, Callable[[Data], Figure]] = {
    figure.__name__: figure
    for figure in (errors, demonstrators, landing, trajectories, large_space, goals, variants, swimmer)
}


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


def _interval(values: Array) -> Interval:
    """For a single seed: that seed."""
    return iqm_interval(values, rng=rng()) if len(values) > 1 else Interval(values[0], values[0], values[0])


def _tiles_reached(ax: Axes, data: Data) -> None:
    reached = {name: tiles for name in LEARNERS if len(tiles := data.last(name, "tiles"))}
    for place, (name, tiles) in enumerate(reached.items()):
        found = _interval(tiles)
        ax.plot(tiles, np.full(len(tiles), place), "|", color=COLOURS[name], alpha=0.5, markersize=12)
        ax.plot([found.low, found.high], [place, place], color=COLOURS[name])
        ax.plot(found.value, place, "o", color=COLOURS[name], markersize=7)
    ax.set_yticks(range(len(reached)), [NAMES[name] for name in reached])
    ax.set(xlabel="benchmark tiles reached", ylim=(len(reached) - 0.5, -0.5))
    ax.set_xlim(left=0)
    ax.grid(axis="x", alpha=0.3)
    ax.set_title(f"Tiles after {LAST} movements")


def _demonstrated(runs: Sequence[Run]) -> Array:
    """``(n, 2)`` m, the outcomes that a teacher showed in any of these runs."""
    shown = {(run.config["demonstrations"] or SHIPPED, row) for run in runs for row in run.demonstration.tolist()}
    shown = {(path, row) for path, row in shown if row >= 0}
    files = {path: load_demonstrations(path) for path, _ in shown}
    return np.array([files[path][row].outcome for path, row in sorted(shown)]).reshape(-1, 2)


def main(argv: Sequence[str] | None = None) -> int:
    """Draw what can be drawn; the exit code is 2 if the results make no sense."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of tables (default: %(default)s)")
    parser.add_argument("--runs", type=Path, default=Path("runs"), help="run directories (default: %(default)s)")
    parser.add_argument("--out", type=Path, default=Path("results/figures"), help="default: %(default)s")
    parser.add_argument("--only", choices=FIGURES, help="only this figure")
    options = parser.parse_args(argv)
    data = Data(Results.of(options.results, (*PAPER, "swimmer")).by("linear"), options.runs)
    make_folder(options.out)
    for name in FIGURES if options.only is None else [options.only]:
        try:
            png, _ = save_figure(partial(FIGURES[name], data), options.out / name, "png", "svg")
            print(png)
        except NotRun as missing:
            print(f"{name} is left out; not run: {missing}")
    return 0


if __name__ == "__main__":
    sys.exit(command(main))
