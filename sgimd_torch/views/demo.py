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
import sys
import time
from pathlib import Path
from types import FrameType

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

from sgimd_torch.catalogue import ROD
from sgimd_torch.figures.learning import NAMES
from sgimd_torch.runs.children import ChildFailed, learn
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.log import make_folder
from sgimd_torch.runs.process import say, with_streams
from sgimd_torch.runs.read import read_run
from sgimd_torch.views.demo_figure import draw, table

ALGORITHMS = ("sgim-d", "random")
EXAMPLES = """examples:
  scripts/demo                                       the paper's 5000 movements, seed 0
  scripts/demo --movements 1000                      a first look, in less than a minute
  scripts/demo --seed 1                              another life
  scripts/demo --out runs/quiet -- --noise 0         options after -- go to experiments/run.py; --help there lists them
"""


def main() -> int:
    """Learn, draw, tell; the exit status."""
    options = _options()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, _interrupt)
    figure_path = options.out / "demo.png"
    began = time.monotonic()
    try:
        make_folder(options.out)
        say(f"SGIM-D and Random, {options.movements} movements each, seed {options.seed}: {options.out}")
        directories = learn(ALGORITHMS, options.seed, options.movements, options.out, options.run_options)
        runs = {algorithm: read_run(path) for algorithm, path in directories.items()}
        partial = figure_path.with_name("demo.png.part")
        draw(runs).savefig(partial, format="png", dpi=100)
        partial.replace(figure_path)
    except KeyboardInterrupt:
        say("Stopped; what was learnt is on disk. The same command goes on from here.")
        return 130
    except ChildFailed as failure:
        say(str(failure))
        return failure.code
    except (OSError, ValueError) as error:
        say(f"demo: {error}")
        return 2
    print(f"\nMean distance to the benchmark goals (m) after so many movements, and seconds spent\n\n{table(runs)}\n")
    print(f"Figure    {figure_path}")
    for algorithm, path in directories.items():
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
    for word in options.run_options:
        name = word.partition("=")[0]
        if name in ("--seed", "--movements", "--out"):
            parser.error(f"{name} is the demo's own; it goes before --")
        if name in ("--algorithm", "--name"):
            parser.error(f"{name} is not free here: the demo compares sgim-d and random by their own names")
    config, _ = parse(options.run_options)  # refuses what run.py would
    if config.environment != ROD:
        parser.error("--environment is not free here: the demo shows the fishing rod")
    if config.evaluate_at == ():
        parser.error("--evaluate_at [] leaves nothing to draw; choose some movements, or leave it out")
    return options


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


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
    sys.exit(with_streams(main))
