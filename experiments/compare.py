"""Run experiments: every variant for several seeds, one process a core, and what came of them in tables.

Which variants there are: variants.py. Each run is one of run.py, in OUT/VARIANT/seed-000. When it ends, its evaluations
go to RESULTS/paper.csv, a line each, those of forward-model and planar-arm-* to RESULTS/forward_model.csv; of the large
task space the goals that it chose are counted in RESULTS/goals.csv. A variant of two experiments lives only once.
Start the command again after Ctrl-C or a power cut, or with more seeds: what is in the tables is not run again, and a
run that was stopped goes on. A run that fails is reported and the others go on.

Exit status: 0 all runs are in the tables, 1 some failed, 2 the request is wrong, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

import argparse
import difflib
import os
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType

if __name__ == "__main__":  # Ctrl-C while the libraries below are loading
    signal.signal(signal.SIGINT, lambda *_: os._exit(130))

from overview import Overview
from sgimd_torch.runs.children import Child, ChildFailed, in_use
from sgimd_torch.runs.log import RunError
from sgimd_torch.runs.process import say, with_streams
from tables import Table, read_keys
from tasks import COLUMNS, Task, tasks_of
from variants import EXPERIMENTS, make_subsets

EXAMPLES = f"""experiments: {", ".join(EXPERIMENTS)}

examples:
  python experiments/compare.py                                   everything, 10 seeds each: some hours on two cores
  python experiments/compare.py learners large-space --seeds 3
  python experiments/compare.py forward-model planar-arm-7 planar-arm-50
  python experiments/compare.py ablations --only uniform-goals grid
  python experiments/compare.py --dry-run                         what is still to be done
"""


def carry_out(tasks: Sequence[Task], done: int, processes: int, tables: Mapping[str, Table]) -> list[str]:
    """Run the ``tasks``, some at once, and harvest each into its ``tables`` as it ends; what failed, with its reason.

    A run that a killed compare.py left behind is waited for, then harvested like the others.

    Raises:
        KeyboardInterrupt: Ctrl-C; the runs that were under way are stopped and will go on next time.
        OSError: a table cannot be written; likewise.
    """
    overview, failures = Overview(tasks, done), []
    waiting = list(tasks)
    running: dict[Child, Task] = {}

    def failed(error: Exception) -> None:
        failures.append(str(error))
        overview.tell(str(error), *(["The others go on."] if waiting or running else []))

    def ours(task: Task) -> bool:
        """Whether that run is under way here, for another experiment."""
        return task.config.directory in (other.config.directory for other in running.values())

    try:
        while waiting or running:
            free = (task for task in list(waiting) if not ours(task) and not in_use(task.config.directory))
            while len(running) < processes and (task := next(free, None)):
                waiting.remove(task)
                try:
                    child = task.start()
                except (RunError, OSError) as error:
                    overview.cannot_start(task)
                    failed(error)
                    continue
                running[child] = task
                overview.started(task, child)
            idle = len(running) < processes
            for child in [child for child in running if child.process.poll() is not None]:
                task = running.pop(child)
                try:
                    child.check()
                    task.harvest(tables)
                except (ChildFailed, RunError) as error:
                    if in_use(task.config.directory):  # the run of an earlier start, which had not shown itself yet
                        waiting.append(task)
                        overview.again(child)
                        continue
                    overview.ended(child, failed=True)
                    failed(error)
                else:
                    overview.ended(child, failed=False)
            overview.show(elsewhere=sum(not ours(task) for task in waiting) if idle else 0)
            time.sleep(0.3)
    finally:
        for child in running:
            child.interrupt()
        for child in running:
            child.end()
    return failures


def main() -> int:
    """Find what is missing, run it, write it; the exit status."""
    options = _options()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, _interrupt)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    begun = False
    try:
        tasks = tasks_of(options.experiments, options.only, seeds, options.out)
        paths = {name: options.results / name for task in tasks for name in task.tables}
        finished = {name: read_keys(path, *COLUMNS[name])[0] for name, path in paths.items()}
        left = [task for task in tasks if task.last_row not in finished[task.table]]
        where = " and ".join(str(paths[name]) for name in dict.fromkeys(task.table for task in tasks))
        say(f"{len(tasks)} runs, {len(tasks) - len(left)} of them in {where} already")
        if options.dry_run:
            print("".join(f"{task.experiment}: {task.title}\n" for task in left), end="")
            return 0
        _make_results(options.results)
        make_subsets(options.out / "demonstrations")
        tables = {name: Table(path, *COLUMNS[name]) for name, path in paths.items()}
        begun = True
        failures = carry_out(left, len(tasks) - len(left), options.processes, tables)
    except KeyboardInterrupt:
        say("", "Stopped; the same command goes on from here.")
        return 130
    except (RunError, OSError, ValueError) as error:
        say(f"error: {error}")
        return 1 if begun else 2
    say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {where}", *failures)
    return 1 if failures else 0


def _make_results(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RunError(f"--results {folder} cannot be made: {error.strerror}; is a file in the way?") from error


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, epilog=EXAMPLES, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("experiments", nargs="*", metavar="EXPERIMENT", help="which; none stands for all of them")
    parser.add_argument("--only", nargs="+", default=[], metavar="VARIANT", help="of their variants only these")
    parser.add_argument("--seeds", type=int, default=10, help="how many (default: %(default)s)")
    parser.add_argument("--first-seed", type=int, default=0, help="(default: %(default)s)")
    parser.add_argument(
        "--processes",
        type=int,
        default=os.cpu_count() or 1,
        help="runs at once (default: one a core, here %(default)s)",
    )
    parser.add_argument("--out", type=Path, default=Path("runs"), help="where the runs go (default: %(default)s)")
    parser.add_argument(
        "--results", type=Path, default=Path("results"), help="folder of the tables (default: %(default)s)"
    )
    parser.add_argument("--dry-run", action="store_true", help="only tell what is still to be done")
    options = parser.parse_args()
    options.experiments = list(dict.fromkeys(options.experiments)) or list(EXPERIMENTS)
    _check_names(parser, options)
    for name, least in (("seeds", 1), ("first_seed", 0), ("processes", 1)):
        if getattr(options, name) < least:
            parser.error(f"--{name.replace('_', '-')} must be at least {least}, got {getattr(options, name)}")
    return options


def _check_names(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    homes: dict[str, list[str]] = {}
    for experiment, variants in EXPERIMENTS.items():
        for variant in variants:
            homes.setdefault(variant, []).append(experiment)
    known = list(EXPERIMENTS)
    for name in options.experiments:
        if name in homes and name not in EXPERIMENTS:
            parser.error(f"{name} is a variant, of {' and '.join(homes[name])}; write {homes[name][0]} --only {name}")
        if name not in EXPERIMENTS:
            parser.error(f"unknown experiment {name!r}, known are {', '.join(known)}{_slip(name, known)}")
    known = [variant for variant, experiments in homes.items() if {*experiments} & {*options.experiments}]
    for name in options.only:
        if name in EXPERIMENTS and name not in homes:
            parser.error(f"{name} is an experiment, no variant; experiments go before --only")
        if name in homes and name not in known:
            where = " and ".join(homes[name])
            parser.error(f"{name} is a variant of {where}, asked for were {', '.join(options.experiments)}")
        if name not in homes:
            parser.error(f"unknown variant {name!r}, known are {', '.join(known)}{_slip(name, known)}")


def _slip(name: str, known: Sequence[str]) -> str:
    near = difflib.get_close_matches(name.lower().replace("_", "-"), known, 1, 0.5)
    return f"; did you mean {near[0]}?" if near else ""


def _interrupt(signum: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(with_streams(main))
