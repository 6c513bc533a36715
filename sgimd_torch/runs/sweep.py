"""Run many runs: options of sgimd run, crossed with each other and with seeds, some at a time.

Each --vary is one option with its values. The runs of a variant go to OUT/NAME/seed-003 and so on; NAME says what is
varied: sgim-d,goals=uniform if algorithm and goals are. All other options of sgimd run apply to every run.

  sgimd sweep --seeds 0-9                                                  ten runs with the defaults
  sgimd sweep --vary goals=interest-map,uniform --seeds 0-19 --out study   is the interest map worth it?
  sgimd sweep --vary algorithm=sagg-riac,sgim-d --vary budget=5,15 --seeds 0-4 --movements 2000 --out study
  sgimd sweep --vary noise=0,0.03 --seeds 0,3,7-9 --out study --dry-run    what is still to be done
  sgimd table study                                                        their results

Start the same command again after Ctrl-C or a power cut, or with more seeds: finished runs stay as they are, the
others go on. If a run fails, the others go on, too; it is named at the end, and its output is in OUT/NAME/seed-003.log.

Exit code: 0 all runs are finished, 1 some failed, 2 the request is wrong, 130 or 143 stopped by Ctrl-C or SIGTERM.
"""

from __future__ import annotations

import argparse
import itertools
import os
import re
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Final

from sgimd_torch.files import locked, make_folder
from sgimd_torch.runs.command_line import parse
from sgimd_torch.runs.config import Config, dashed, words
from sgimd_torch.runs.process import Failed, Progress, loading, say
from sgimd_torch.runs.read import finished, movements_on_disk

LOOK_EVERY: Final = 0.3  # s, from one look at the runs to the next
PATIENCE: Final = 20.0  # s, for a stopped run to write what it has; then it is killed and loses a second at most
NOT_VARIED: Final = {
    "seed": "--seeds takes them, such as 5, 0-19 or 0,3,7-9",
    "name": "a sweep names its variants by what is varied",
    "out": "all runs of a sweep go to one --out",
}


def main(argv: Sequence[str] | None = None) -> int:
    """Carry out all runs that are not finished.

    Returns:
        The exit code, 1 where runs failed.
    """
    parser = argparse.ArgumentParser(
        prog="sgimd sweep",
        usage="%(prog)s [--vary OPTION=VALUE,VALUE ...] [--seeds SEEDS] [--OPTION VALUE ...]",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="OPTION=VALUE,VALUE",
        help="one option of sgimd run and its values; a list is one value in brackets: floor-at=[1000],[1000,5000]",
    )
    add_options(parser, seeds="0")
    options, rest = parser.parse_known_args(argv)
    variants, flags = variants_of(options.vary, rest)
    configs = [replace(variant, seed=seed) for seed in options.seeds for variant in variants]
    left = [config for config in configs if not finished(config)]
    out = configs[0].out
    counts = f"{len(variants)} variants, {len(options.seeds)} seeds"
    say(f"{len(configs)} runs ({counts}), {len(configs) - len(left)} of them finished: {out}")
    own = [config for config in configs if config.own and config not in left]
    if own:
        from sgimd_torch.runs.directory import stale  # loads numpy

        say(*dict.fromkeys(f"{config.title}: {note}" for config in own for note in stale(config)))
    if options.dry_run:
        for config in left:
            print(f"{config.title}: {movements_on_disk(config.directory)} of {config.movements} movements")
        return 0
    with loading():
        from sgimd_torch.runs.build import build  # after --help
    for variant in variants if left else []:
        build(variant)  # a wrong option is refused before anything starts
    make_folder(out)
    failures = sweep(left, options.processes, flags=flags)
    say(f"{len(left) - len(failures)} runs ended well, {len(failures)} failed: {out}", *failures)
    return 1 if failures else 0


def add_options(parser: argparse.ArgumentParser, *, seeds: str) -> None:
    """Options of every command with many runs: --seeds, with that default, --processes and --dry-run."""
    cores = os.cpu_count() or 1
    parser.add_argument("--seeds", type=_seeds, default=seeds, help="5, 0-19 or 0,3,7-9 (default: %(default)s)")
    parser.add_argument("--processes", type=_count, default=cores, help="runs at a time (default: cores, %(default)s)")
    parser.add_argument("--dry-run", action="store_true", help="only list what is still to be done")


def variants_of(varied: Sequence[str], options: Sequence[str]) -> tuple[list[Config], list[str]]:
    """Every combination of the values, as a run that is named after it, and the flags among the ``options``.

    Args:
        varied: such as ``["goals=interest-map,uniform", "budget=5,15"]``.
        options: of ``sgimd run``, for all of them.

    Raises:
        ValueError: an option cannot be varied, or is given twice.
        SystemExit: ``sgimd run`` would refuse an option; it has said why.
    """
    given = [dashed(word.partition("=")[0].removeprefix("--")) for word in options if word.startswith("--")]
    values: dict[str, list[str]] = {}
    for word in varied:
        name, _, listed = word.removeprefix("--").partition("=")
        option = dashed(name)
        choices = re.split(r",(?![^[]*\])", listed)  # not at the commas in brackets
        if not all([option, *choices]):
            raise ValueError(f"--vary must be like goals=interest-map,uniform, got {word!r}")
        if option in [*values, *given]:
            raise ValueError(f"--{option} is there twice; put all its values in one --vary")
        values[option] = list(dict.fromkeys(choices))
    for option, instead in NOT_VARIED.items():
        if option in values or (option in given and option != "out"):
            raise ValueError(f"--{option} cannot be given here: {instead}")
    found = []
    for combination in itertools.product(*values.values()):
        chosen = dict(zip(values, combination, strict=True))
        config, flags = parse([*options, *(f"--{option}={value}" for option, value in chosen.items())])
        in_order = [dashed(field.name) for field in fields(Config) if dashed(field.name) in chosen]
        found.append(replace(config, name=",".join(_in_name(option, chosen[option]) for option in in_order) or None))
    return found, [f"--{dashed(flag)}" for flag, on in flags.items() if on]


def sweep(
    configs: Sequence[Config],
    processes: int,
    *,
    flags: Sequence[str] = (),
    on_end: Callable[[Config], None] | None = None,
    keep_going: bool = True,
) -> list[str]:
    """Run them, in this order, and show how far they are; those that are finished already are not started.

    If another process writes a run, such as one left by a killed sweep, it is waited for and then taken over.
        failures = sweep([Config(seed=seed) for seed in range(20)], processes=4)

    Args:
        configs: the runs, each with a directory of its own.
        processes: how many run at a time.
        flags: of ``sgimd run``, for all of them, besides --resume.
        on_end: called with each run that ended well, in this thread; its ValueError or OSError counts as a failure.
        keep_going: False: the first failure stops the others, and is raised.

    Returns:
        The failures: which run, the last words of its log, and where the log is.

    Raises:
        ValueError: two runs have one directory; without ``keep_going`` also: a run refused its request.
        Failed: without ``keep_going``: a run failed under way.
        KeyboardInterrupt: a signal came. All runs were stopped first, and nothing is lost.
    """
    twice = [path for path, n in Counter(config.directory for config in configs).items() if n > 1]
    if twice:
        raise ValueError(f"two runs would be written to {twice[0]}; their variants need different names")
    runs, failures = [_Run(config, flags) for config in configs], list[str]()
    total = sum(config.movements for config in configs)
    # Threads that each wait for a process of their own: a pool of processes would break, for all runs, when the system
    # kills one of its processes.
    pool, stop = ThreadPoolExecutor(processes), threading.Event()
    try:
        with Progress("sweep", total, _done(runs), every=30.0) as progress:
            pending = {pool.submit(run.carry_out, stop): run for run in runs}
            while pending:
                for future in wait(pending, LOOK_EVERY, FIRST_COMPLETED).done:
                    run = pending.pop(future)
                    run.look()
                    try:
                        future.result()
                        if on_end is not None:
                            on_end(run.config)
                        run.state = "done"
                    except (Failed, ValueError, OSError) as error:
                        run.state = "failed"
                        progress.total -= run.config.movements - run.done  # the rest will not be run
                        failures.append(f"{run.config.title} failed: {error}")
                        if not keep_going:
                            raise (Failed if isinstance(error, Failed) else ValueError)(failures[0]) from error
                progress.show(_done(runs), _note(runs))
    except KeyboardInterrupt:
        say("stopping all runs; the same command goes on from here")
        raise
    finally:
        stop.set()
        pool.shutdown(cancel_futures=True)
    return failures


@dataclass(eq=False)
class _Run:
    """One of the runs. ``state``: waiting, held by another process, running, done or failed."""

    config: Config
    flags: Sequence[str]
    state: str = "waiting"

    def __post_init__(self) -> None:
        self.log = self.config.directory.with_suffix(".log")  # its output, next to its directory
        self.look()

    def look(self) -> None:
        """Update ``done``, its number of movements on disk."""
        self.done = min(movements_on_disk(self.config.directory), self.config.movements)

    def carry_out(self, stop: threading.Event) -> None:
        """Run it, or resume it, to its end; returns early after ``stop``.

        Raises:
            ValueError: it refused its request (exit code 2), or there is no place for its directory.
            Failed: it failed under way.
            OSError: its log cannot be written, or no process started.
        """
        directory = self.config.directory
        make_folder(directory.parent)
        while not stop.is_set():
            if locked(directory / "lock"):
                if self.state != "held":
                    say(f"{self.config.title}: waiting for another process, which writes this run")
                self.state = "held"
                stop.wait(LOOK_EVERY)
                continue
            if finished(self.config):
                return
            self.state = "running"
            code = self._process(stop)
            if code == 0:
                return
            if not stop.is_set() and not locked(directory / "lock"):  # else another process took it over first
                raise (ValueError if code == 2 else Failed)(self._last_words(code))

    def _process(self, stop: threading.Event) -> int:
        """Start its process, wait for it, stop it after ``stop``; its exit code."""
        command = [sys.executable, "-m", "sgimd_torch", "run", "--resume", *self.flags, *words(vars(self.config))]
        one_thread = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
        with self.log.open("wb") as log:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=log,
                env={**os.environ, **one_thread},
                process_group=0,  # only we get Ctrl-C, and pass it on
            )
        while not stop.is_set():
            try:
                return process.wait(LOOK_EVERY)
            except subprocess.TimeoutExpired:
                continue
        process.send_signal(signal.SIGINT)
        try:
            return process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def _last_words(self, code: int) -> str:
        _, mark, said = ("\n" + self.log.read_text(errors="replace").rstrip()).rpartition("\nerror: ")
        if not mark:
            said = said.rpartition("\n")[2] or "it said nothing"
        if code < 0:
            said = f"stopped by {signal.Signals(-code).name}; the same command goes on with it"
        return f"{said}\nIts whole log: {self.log}"


def _done(runs: Sequence[_Run]) -> int:
    """Movements on disk of all of them."""
    for run in runs:
        if run.state in ("held", "running"):
            run.look()
    return sum(run.done for run in runs)


def _note(runs: Sequence[_Run]) -> str:
    """How many runs are in each state, and how far the running ones are."""
    states = Counter(run.state for run in runs)
    parts = [f"{states['done']} of {len(runs)} runs"]
    parts += [f"{states['failed']} failed"] if states["failed"] else []
    parts += [f"waiting for {states['held']} held by another process"] if states["held"] else []
    return ", ".join([*parts, *(f"{run.config.title} at {run.done}" for run in runs if run.state == "running")])


def _in_name(option: str, value: str) -> str:
    """A choice in the name of a variant; a path is shortened to the name of its file."""
    return value if option == "algorithm" else f"{option}={Path(value).name if os.sep in value else value}"


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"must be a whole number of at least 1, got {text!r}")
    return int(text)


def _seeds(text: str) -> list[int]:
    seeds: dict[int, None] = {}
    for part in text.split(","):
        first, dash, last = part.partition("-")
        if not first.isdecimal() or (dash and not last.isdecimal()) or int(last or first) < int(first):
            raise argparse.ArgumentTypeError(f"must be like 5, 0-19 or 0,3,7-9, got {text!r}")
        seeds |= dict.fromkeys(range(int(first), int(last or first) + 1))
    return list(seeds)
