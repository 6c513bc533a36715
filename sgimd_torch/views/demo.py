"""Three learners learn to fish, then one figure and one table show the results.

Three runs with the same seed, two at a time. All move the same simulated arm with the same motor noise. One moves at
random. SGIM-D has curiosity and a teacher. The third, practice-taught, is this library's best: it is shown everything
at the start, then it practises, one movement for each goal. They write to --out:

  random/seed-000/ and so on   everything that happened (docs/runs.md explains the files)
  demo.png                     how the error falls; how each answers four goals; where the float landed

Start it again after Ctrl-C or a power cut, and it goes on where it stopped; finished runs are used as they are.

  sgimd demo                                       the paper's 5000 movements, seed 0
  sgimd demo --movements 1000                      a first look, in less than a minute
  sgimd demo --seed 1                              another seed
  sgimd demo --out runs/quiet -- --environment.noise 0   options after -- go to all runs; sgimd run --help lists them
"""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Final

from sgimd_torch.catalogue import ROD, label
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.engines.local import Local
from sgimd_torch.runs.engines.loop import sweep
from sgimd_torch.runs.process import loading, say

ALGORITHMS: Final = {
    "random": "moves at random",
    "sgim-d": "chooses goals where its competence changes, and is shown a movement now and then",
    "practice-taught": "is shown all movements at the start, then practises, one movement for each goal",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the learners, draw the figure, print the table; returns the exit code."""
    options = _options(argv)
    place = [f"--seed={options.seed}", f"--movements={options.movements}", f"--out={options.out}"]
    place += [
        "--evaluated-by=own",
        f"--floor-at={options.movements}",
    ]  # measuring the noise takes longer than all the rest
    configs = {algorithm: parse([*place, f"--algorithm={algorithm}", *options.more])[0] for algorithm in ALGORITHMS}
    base = configs["sgim-d"]
    if base["environment"] != ROD:
        raise ValueError("--environment cannot be given here: the demo shows the fishing rod")
    if not base.evaluations:
        raise ValueError("--evaluate-at [] leaves nothing to draw; choose some movements, or omit it")
    with loading():
        from sgimd_torch.figures.save import save_figure  # after --help
        from sgimd_torch.views.demo_figure import draw, table
        from sgimd_torch.views.report.data import read_life
    began = time.monotonic()
    say(f"{len(configs)} learners, {base.movements} movements each, seed {base.seed}, two at a time: {base.out}")
    for algorithm, does in ALGORITHMS.items():
        say(f"{label(algorithm)} {does}")
    with Local(processes=2) as engine:
        sweep([configs[algorithm] for algorithm in reversed(ALGORITHMS)], engine, keep_going=False)  # longest first
    say("drawing where the float landed, and how each learner answers four goals")
    runs = {algorithm: read_life(config.directory) for algorithm, config in configs.items()}
    (figure,) = save_figure(partial(draw, runs), options.out / "demo", "png")
    print(f"\nMean distance to the benchmark goals (m) after so many movements, and seconds spent\n\n{table(runs)}\n")
    print(f"Figure    {figure}")
    for run in runs.values():
        print(f"Run       {run.path}/ (episodes.csv, evaluation.csv, summary.json ...)")
    print(f"Time      {time.monotonic() - began:.0f} s\n\nNext, try\n{_next_steps(options, base.directory)}")
    return 0


def parser() -> argparse.ArgumentParser:
    """The options of ``sgimd demo``."""
    parser = argparse.ArgumentParser(
        prog="sgimd demo",
        usage="%(prog)s [options] [-- OPTIONS OF sgimd run]",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--seed", type=int, default=0, help="of all runs (default: %(default)s)")
    parser.add_argument(
        "--movements", type=int, default=5000, help="of each run; more than last time extends it (default: %(default)s)"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/demo"), help="directory (default: %(default)s)")
    parser.add_argument("more", nargs="*", help=argparse.SUPPRESS)
    return parser


def _options(argv: Sequence[str] | None) -> argparse.Namespace:
    options = parser().parse_args(argv)
    for word in options.more:
        name = word.partition("=")[0]
        if name in ("--seed", "--movements", "--out"):
            raise ValueError(f"{name} is the demo's own; it goes before --")
        if name in ("--algorithm", "--name"):
            raise ValueError(f"{name} cannot be given here: the demo compares learners by their own names")
    return options


def _next_steps(options: argparse.Namespace, film: Path) -> str:
    sgimd = ["sgimd"] if shutil.which("sgimd") else [sys.executable, "-m", "sgimd_torch"]
    run = ["run", "--seed", str(options.seed), "--out", str(options.out), "--movements", str(options.movements)]
    steps = {
        "a film of how SGIM-D learns": ["film", str(film), "--time-lapse"],
        "one page: curves, maps, where it is curious": ["report", str(options.out)],
        "the same without a teacher": [*run, *options.more, "--algorithm", "practice"],
    }
    return "\n".join(f"  {shlex.join([*sgimd, *words])}    # {why}" for why, words in steps.items())
