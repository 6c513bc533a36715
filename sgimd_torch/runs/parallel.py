"""Carry out a list of runs, each in a process of its own: start them, show progress, name failures.

failures = sweep([Config(seed=seed) for seed in range(20)], Machine(processes=4))
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Protocol

from sgimd_torch.files import make_folder
from sgimd_torch.options.config import Config, words
from sgimd_torch.runs.read import movements_on_disk
from sgimd_torch.runs.signals import ONE_THREAD, Failed, Progress, Stopped, Stopping

POLL: Final = 0.05  # s between two looks at the processes
REFRESH: Final = 20  # looks at the processes between two looks at the movements on disk
PATIENCE: Final = 20.0  # s for stopped runs to save their movements; a run killed then loses a second at most

Process = subprocess.Popen[bytes]


class Engine(Protocol):
    """What carries out runs: this machine, or a cluster. A run has ``poll`` and ``returncode``, as ``Process``."""

    at_once: float  # most runs under way at a time

    def start(self, config: Config) -> Any:
        """Start or resume a run; its output is appended to its log."""

    def stop(self, runs: Sequence[Any]) -> None:
        """Stop runs, which get some time to save their movements; no run is started later."""


class Machine:
    """This machine; at most ``processes`` runs at a time."""

    def __init__(self, processes: float) -> None:
        self.at_once = processes

    def start(self, config: Config) -> Process:
        return start_process(["-m", "sgimd_torch"], words(config), log_of(config), stdin=subprocess.DEVNULL)

    @staticmethod
    def stop(processes: Sequence[Process]) -> None:
        """Stop runs; they get some time to save their movements."""
        for process in processes:
            process.terminate()
        deadline = time.monotonic() + PATIENCE
        for process in processes:
            with suppress(subprocess.TimeoutExpired):
                process.wait(max(0.0, deadline - time.monotonic()))
            process.kill()


def sweep(configs: Sequence[Config], engine: Engine, *, on_end: Callable[[Config], None] | None = None) -> list[str]:
    """Carry out runs in this order and show progress; a failed run does not stop the others.

    Args:
        configs: the runs, each with its own directory; they are started or resumed.
        engine: machine or cluster that carries them out.
        on_end: function to call with each run that ended well; its ValueError or OSError means failure.

    Returns:
        A sentence for each failure: name of the run, last line of its log, path of the log.

    Raises:
        ValueError: two runs have the same directory.
        OSError: a log cannot be written; all runs are stopped.
        Failed: the cluster is gone, or cannot make runs; all runs are stopped.
        Stopped: a signal came; all runs are stopped.
    """
    twice = [path for path, n in Counter(config.directory for config in configs).items() if n > 1]
    if twice:
        raise ValueError(f"two runs would be written to {twice[0]}; their variants need different names")
    done = {config: _on_disk(config) for config in configs}
    failures: dict[Config, str] = {}
    waiting, running = [*reversed(configs)], dict[Config, tuple[Any, int]]()
    bar = Progress("sweep", sum(config.movements for config in configs), sum(done.values()))
    with Stopping("stopping all runs; the same command continues them") as stopping, bar as progress:
        try:
            while (waiting or running) and not stopping.heard:
                while waiting and len(running) < engine.at_once:
                    config = waiting.pop()
                    make_folder(config.directory.parent)
                    before = log_of(config).stat().st_size if log_of(config).exists() else 0
                    running[config] = engine.start(config), before
                ended = _wait(running, stopping)
                done |= {config: _on_disk(config) for config in running}
                for config in ended:
                    run, before = running.pop(config)
                    try:
                        check_end(config, run.returncode, log_of(config).read_bytes()[before:])
                        if on_end is not None:
                            on_end(config)
                    except (Failed, ValueError, OSError) as error:
                        failures[config] = f"{config.title} failed: {error}"
                        progress.total -= config.movements - done[config]  # other movements are not made
                well = len(configs) - len(waiting) - len(running) - len(failures)
                failed = f", {len(failures)} failed" if failures else ""
                progress.show(sum(done.values()), f"{well} of {len(configs)} runs{failed}")
        finally:
            engine.stop([run for run, _ in running.values()])
    if stopping.heard:
        raise Stopped(stopping.heard)
    return [failures[config] for config in configs if config in failures]


def start_process(
    program: Sequence[str], options: Sequence[str], log: Path, *, stdin: int, folder: str = "."
) -> Process:
    """Start ``sgimd run --resume`` in a process; ``program`` are the words that make Python run ``sgimd``."""
    command = [sys.executable, *program, "run", "--resume", *options]
    environment = {**os.environ, **ONE_THREAD}  # the processes share the cores
    with log.open("ab") as output:
        # The run has its own process group: Ctrl-C reaches only this process, which passes it on.
        return subprocess.Popen(
            command, stdin=stdin, stdout=output, stderr=output, process_group=0, env=environment, cwd=folder
        )


def _wait(running: Mapping[Config, tuple[Any, int]], stopping: Stopping) -> list[Config]:
    """The runs that have ended, as soon as there is one; after ``REFRESH`` looks or a signal, perhaps none."""
    ended: list[Config] = []
    for _ in range(REFRESH):
        time.sleep(POLL)
        ended = [config for config, (run, _) in running.items() if run.poll() is not None]
        if ended or stopping.heard:
            break
    return ended


def log_of(config: Config) -> Path:
    """The log of a run's output, next to its directory."""
    return config.directory.with_suffix(".log")


def check_end(config: Config, code: int, said: bytes) -> None:
    """Raise an error with the last line of the output if a run did not end well.

    Args:
        config: configuration of the run.
        code: exit code of its process; if negative, the signal that killed it.
        said: output of its process.

    Raises:
        Failed: the run failed.
    """
    if code == 0:
        return
    _, mark, last = ("\n" + said.decode(errors="replace").rstrip()).rpartition("\nerror: ")
    if code < 0:
        last = f"stopped by {signal.Signals(-code).name}; the same command continues the run"
    elif not mark:
        last = last.rpartition("\n")[2] or "it printed nothing"
    raise Failed(f"{last}\nFull log: {log_of(config)}")


def _on_disk(config: Config) -> int:
    return min(movements_on_disk(config.directory), config.movements)
