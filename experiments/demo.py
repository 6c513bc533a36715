"""SGIM-D beside random exploration: both learn to fish, then one figure and one table say what came of it.

Two runs of experiments/run.py with the same seed, one process each, side by side. Both move the same simulated arm with
the same motor noise. One has curiosity and a teacher, the other moves at random. Under --out they leave:

  sgim-d/seed-000/, random/seed-000/   everything that happened (experiments/README.md explains the files)
  demo.png                             how the error falls; where the float landed; where competence is changing

Start it again after Ctrl-C or a power cut, and it goes on where it stopped; finished runs are used as they are.
"""

from __future__ import annotations

import argparse
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rundir import EVALUATION, Run, RunError, read_run
from sgimd_torch.demonstrations import SHIPPED, load_demonstrations
from sgimd_torch.plots import NAMES, Curve, error_curves, interest_map, landing_points, tile_counts
from sgimd_torch.spaces import Array, Box

ALGORITHMS = ("sgim-d", "random")
EXAMPLES = """examples:
  scripts/demo                                       the paper's 5000 movements, seed 0
  scripts/demo --movements 1000                      a first look, in less than a minute
  scripts/demo --seed 1                              another life
  scripts/demo --out runs/quiet -- --noise 0         options after -- go to experiments/run.py; --help there lists them
"""
STYLE: Any = {
    "font.size": 13,
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 2,
    "legend.fontsize": 12,
    "figure.constrained_layout.w_pad": 0.12,
    "figure.constrained_layout.h_pad": 0.12,
}
GOALS = 100  # the last ones are shown


class ChildFailed(RuntimeError):
    """A run ended with an error; ``code`` is its exit status."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code


class Child:
    """One run in a process of its own. Its messages go to a log, its progress is read off the files that it writes."""

    def __init__(self, algorithm: str, options: argparse.Namespace) -> None:
        self.algorithm = algorithm
        self.movements: int = options.movements
        self.directory: Path = options.out / algorithm / f"seed-{options.seed:03d}"
        self.log: Path = options.out / f"{algorithm}.log"
        self._episodes = self.directory / "episodes.csv"
        self._read = self._lines = 0
        self._began, self._already = time.monotonic(), self.done()
        command = [sys.executable, str(Path(__file__).with_name("run.py")), "--algorithm", algorithm]
        command += ["--seed", str(options.seed), "--movements", str(options.movements), "--out", str(options.out)]
        threads = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
        with self.log.open("wb") as log:
            self.process = subprocess.Popen(
                [*command, "--resume", *options.run_options],
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env={**os.environ, **threads},
                process_group=0,  # Ctrl-C comes to us, and we pass it on
            )

    def done(self) -> int:
        """Movements on disk; reads only what was added since the last look."""
        try:
            with self._episodes.open("rb") as file:
                file.seek(self._read)
                added = file.read()
        except FileNotFoundError:
            return 0
        self._read += len(added)
        self._lines += added.count(b"\n")
        return min(self.movements, max(0, self._lines - 1))  # the first line names the columns

    def seconds_left(self) -> float:
        """At the pace so far, pauses for evaluations included."""
        left, fresh = self.movements - self.done(), self.done() - self._already
        if left == 0:
            return 0.0
        return left * (time.monotonic() - self._began) / fresh if fresh > 0 else np.nan

    def status(self) -> str:
        """For the progress line."""
        done, error = self.done(), _last_error(self.directory / "evaluation.csv")
        shown = f", error {error:.3f} m" if error is not None else ""
        state = "done" if self.process.poll() == 0 else f"{done}/{self.movements}"
        return f"{NAMES[self.algorithm]} {state}{shown}"

    def check(self) -> None:
        """Notice a failure.

        Raises:
            ChildFailed: with the last words of its log.
        """
        code = self.process.poll()
        if not code:
            return
        said = self.log.read_text(errors="replace").strip()
        words = said[said.rfind("error: ") :] if "error: " in said else said.rpartition("\n")[2] or "it said nothing"
        if code < 0:
            words = f"stopped by {signal.Signals(-code).name}; start the demo again and it goes on"
        outlook = f"Its whole log: {self.log}. To begin afresh, delete {self.directory} or choose another --out."
        raise ChildFailed(f"{NAMES[self.algorithm]} failed: {words}\n{outlook}", code if code > 0 else 1)

    def interrupt(self) -> None:
        """As Ctrl-C does: it writes what it has, and ends."""
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)

    def end(self) -> None:
        """Wait for it; killed, it would lose a second of its life at most."""
        try:
            self.process.wait(timeout=20)
        except subprocess.TimeoutExpired:
            self.process.kill()


def learn(options: argparse.Namespace) -> list[Path]:
    """Let both live, showing their progress in one line; the run directories.

    Raises:
        ChildFailed: one of them did; the other is stopped.
        KeyboardInterrupt: Ctrl-C; both are stopped.
    """
    children: list[Child] = []
    live = sys.stderr.isatty()
    next_report = time.monotonic()
    try:
        for algorithm in ALGORITHMS:
            children.append(Child(algorithm, options))
        while True:
            running = any(child.process.poll() is None for child in children)
            for child in children:
                child.check()
            if live or not running or time.monotonic() >= next_report:
                _report("   ".join([*(child.status() for child in children), _time_left(children)]), live)
                next_report += 15
            if not running:
                return [child.directory for child in children]
            time.sleep(0.3)
    finally:
        if live:
            print(file=sys.stderr)
        for child in children:
            child.interrupt()
        for child in children:
            child.end()


def draw(runs: dict[str, Run]) -> Figure:
    """The figure: error curves, the interest map, where the float landed in each run, on one scale.

    Raises:
        RunError: a run was never evaluated.
    """
    for run in runs.values():
        if not len(run.evaluation["movements"]):
            raise RunError(f"{run.path} was never evaluated, so there is no curve to draw; was --evaluate_at [] given?")
    sgim_d, half_side = runs["sgim-d"], float(runs["sgim-d"].config["task_space"])
    task_space = Box.cube(-half_side, half_side, 2)
    tile = 0.05 * half_side
    outcomes = {algorithm: run.outcomes[np.isfinite(run.outcomes[:, 0])] for algorithm, run in runs.items()}
    most = max(float(tile_counts(landed, task_space, tile).max()) for landed in outcomes.values())
    with rc_context(STYLE):
        figure = Figure(figsize=(14, 12.6), layout="constrained")
        (curves, interest), landed_axes = figure.subplots(2, 2)
        error_curves(curves, {algorithm: [_curve(run)] for algorithm, run in runs.items()})
        curves.set_title("How far from its goals the float lands")
        _draw_interest(interest, sgim_d)
        for ax, (algorithm, landed) in zip(landed_axes, outcomes.items(), strict=True):
            shown = _demonstrated(runs[algorithm])
            landing_points(ax, landed, task_space, demonstrated=shown, side=tile, most=most)
            ax.set_title(f"Where the float landed: {NAMES[algorithm]}", pad=32)
        n = " and ".join(dict.fromkeys(str(len(run.index)) for run in runs.values()))
        seed = sgim_d.config["seed"]
        figure.suptitle(
            f"A simulated arm learns to place its float: SGIM-D and Random, {n} movements each, seed {seed}"
        )
    return figure


def table(runs: dict[str, Run]) -> str:
    """Errors and costs of the runs, and the ratio of the last errors."""
    evaluated = runs["sgim-d"].evaluation["movements"].astype(int).tolist()
    columns = [movements for movements in (1000, 2000, 5000) if movements in evaluated[:-1]] + evaluated[-1:]
    heads = [*(f"error {movements}" for movements in columns), "noise floor", "physics", "learning", "evaluation"]
    lines = [f"{'':10}" + "".join(f"{head:>13}" for head in heads)]
    for algorithm, run in runs.items():
        errors = dict(zip(run.evaluation["movements"].astype(int), run.evaluation["mean_error_m"], strict=True))
        cells = [_metres(errors.get(movements)) for movements in columns]
        cells.append(_metres(run.evaluation["noise_floor_m"][-1]))
        cells += [_seconds(run.summary.get(f"seconds_{part}")) for part in ("physics", "learner", "evaluation")]
        lines.append(f"{NAMES[algorithm]:10}" + "".join(f"{cell:>13}" for cell in cells))
    last = {algorithm: run.evaluation["mean_error_m"][-1] for algorithm, run in runs.items()}
    ratio = last["sgim-d"] / last["random"]
    lines.append(f"After {columns[-1]} movements SGIM-D's error is {ratio:.2f} times Random's.")
    return "\n".join(lines)


def main() -> int:
    """Learn, draw, tell; the exit status."""
    options = _options()
    signal.signal(signal.SIGTERM, _interrupt)
    figure_path = options.out / "demo.png"
    began = time.monotonic()
    try:
        options.out.mkdir(parents=True, exist_ok=True)
        print(
            f"SGIM-D and Random, {options.movements} movements each, seed {options.seed}: {options.out}",
            file=sys.stderr,
        )
        directories = learn(options)
        runs = {algorithm: read_run(path) for algorithm, path in zip(ALGORITHMS, directories, strict=True)}
        partial = figure_path.with_name("demo.png.part")
        draw(runs).savefig(partial, format="png", dpi=100)
        partial.replace(figure_path)
    except KeyboardInterrupt:
        print("Stopped; what was learnt is on disk. The same command goes on from here.", file=sys.stderr)
        return 130
    except ChildFailed as failure:
        print(failure, file=sys.stderr)
        return failure.code
    except (OSError, ValueError) as error:
        print(f"demo: {error}", file=sys.stderr)
        return 2
    print(f"\nMean distance to the benchmark goals (m) after so many movements, and seconds spent\n\n{table(runs)}\n")
    print(f"Figure    {figure_path}")
    for algorithm, path in zip(ALGORITHMS, directories, strict=True):
        print(f"{NAMES[algorithm]:10}{path}/ (episodes.csv, evaluation.csv, summary.json ...)")
    print(f"Time      {time.monotonic() - began:.0f} s\n\nNext, try\n{_next_steps(options)}")
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="scripts/demo",
        usage="%(prog)s [options] [-- OPTIONS OF experiments/run.py]",
        description=__doc__,
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, default=0, help="of both runs, at least 0 (default: %(default)s)")
    parser.add_argument(
        "--movements", type=int, default=5000, help="of each run; more than last time extends it (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/demo"), help="directory (default: %(default)s)")
    parser.add_argument("run_options", nargs="*", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.seed < 0 or options.movements < 1:
        parser.error(f"--seed must be at least 0 and --movements 1, got {options.seed} and {options.movements}")
    return options


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def _last_error(path: Path) -> float | None:
    """Of an evaluation.csv, which is replaced whole at every evaluation."""
    try:
        last = path.read_text().splitlines()[-1].split(",")
        return float(last[EVALUATION.index("mean_error_m")])
    except (FileNotFoundError, IndexError, ValueError):  # not there, or the names of the columns only
        return None


def _time_left(children: list[Child]) -> str:
    if all(child.process.poll() == 0 for child in children):
        return "finished"
    left = np.array([child.seconds_left() for child in children if child.process.poll() is None])
    if not np.isfinite(left).all():
        return ""
    return f"{left.max() // 60:.0f}:{left.max() % 60:02.0f} left" if left.max() else "finishing"


def _report(line: str, live: bool) -> None:
    width = (os.get_terminal_size(sys.stderr.fileno()).columns or 80) if live else 0
    start, end = ("\r\x1b[K", "") if live else ("", "\n")
    print(start + (line[: width - 1] if live else line), end=end, file=sys.stderr, flush=True)


def _curve(run: Run) -> Curve:
    return Curve(*(run.evaluation[name] for name in ("movements", "mean_error_m", "noise_floor_m")))


def _demonstrated(run: Run) -> Array | None:
    """``(n, 2)`` m, the outcomes that the teacher showed in this run."""
    rows = np.unique(run.demonstration[run.demonstration >= 0])
    if not len(rows):
        return None
    demonstrations = load_demonstrations(run.config["demonstrations"] or SHIPPED)
    return np.stack([demonstrations[row].outcome for row in rows])


def _draw_interest(ax: Axes, run: Run) -> None:
    """The map as it was at the last evaluation, and the goals aimed at before it."""
    ax.set_title(f"Where the competence of {NAMES['sgim-d']} is changing", pad=32)
    if run.regions is None or not len(run.regions["movements"]):
        ax.text(0.5, 0.5, "uniform goals: no interest map", transform=ax.transAxes, ha="center")
        return
    last = run.regions["movements"] == run.regions["movements"].max()
    lows, highs = (
        np.stack([run.regions[f"{corner}_{k}"][last] for k in range(2)], axis=1) for corner in ("low", "high")
    )
    own = run.goals[np.isfinite(run.goals[:, 0]) & (run.origin != "imitate")]
    new = np.append(True, (np.diff(own, axis=0) != 0).any(axis=1))[: len(own)]  # one goal takes several movements
    interest_map(ax, lows, highs, run.regions["interest"][last], goals=own[new][-GOALS:])


def _metres(value: float | None) -> str:
    return f"{value:.3f} m" if value is not None and np.isfinite(value) else "-"


def _seconds(value: float | None) -> str:
    return f"{value:.0f} s" if value is not None else "-"


def _next_steps(options: argparse.Namespace) -> str:
    python, script, here = Path(sys.executable), Path(__file__).with_name("run.py"), Path.cwd()
    names = [str(path.relative_to(here) if path.is_relative_to(here) else path) for path in (python, script)]
    place, more = ["--seed", str(options.seed), "--out", str(options.out)], list(options.run_options)
    longer = ["scripts/demo", *place, "--movements", str(2 * options.movements), *(["--", *more] if more else [])]
    run = [*names, *place, "--movements", str(options.movements), *more]
    return (
        f"  {shlex.join(longer)}    # both live on\n"
        f"  {shlex.join([*run, '--algorithm', 'sagg-riac'])}    # without a teacher\n"
        f"  {shlex.join([*run, '--goals', 'uniform', '--name', 'uniform-goals'])}    # without curiosity"
    )


if __name__ == "__main__":
    sys.exit(main())
