"""One life: replay what was recorded, live on, evaluate now and then, write everything to one run directory.

print(carry_out(Config(seed=3), resume=False, accept_loss=False, again="sgimd run --seed 3 --resume"))
"""

from __future__ import annotations

import importlib.metadata
import json
import math
import platform
import subprocess
import time
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np

import sgimd_torch
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.evaluation import Evaluation, evaluate
from sgimd_torch.goals.regions import Region
from sgimd_torch.runs.board import RunBoard
from sgimd_torch.runs.build import RunParts, build
from sgimd_torch.runs.clock import Seconds
from sgimd_torch.runs.config import Config, having
from sgimd_torch.runs.directory import RunDirectory
from sgimd_torch.runs.log import Columns, RunError
from sgimd_torch.runs.model_record import RunModel
from sgimd_torch.runs.process import Failed, Progress, Stopped, Stopping, say
from sgimd_torch.session import ReplayError, live, replay, run

# Files count by their content, of which a checksum is recorded; a benchmark may be another one when a run is resumed.
MAY_CHANGE: Final = (*having("on_resume"), "benchmark_crc32")
EVALUATION_SETTINGS: Final = (*having("evaluates"), "benchmark_crc32")  # all evaluations of a run share these
FLUSH_EVERY = 1.0  # s, what a killed run loses at most


def carry_out(config: Config, *, resume: bool, accept_loss: bool, again: str) -> str:
    """Make a run, or go on with one; what came of it, in a line.

    Args:
        config: of the run.
        resume: go on with what is there.
        accept_loss: also if movements are missing from its log.
        again: the command that goes on, for whoever stops it.

    Raises:
        ValueError, OSError: the request is wrong.
        Failed: it failed under way.
        Stopped: by a signal.
    """
    with Stopping() as stopping:
        with stopping.at_once():
            parts = build(config)
        directory = open_directory(config, parts, resume, accept_loss=accept_loss)
        try:
            with directory:
                say(*config.without_effect, *parts.notes, *directory.notes, *correspondence_of(parts))
                return run_in(directory, config, parts, stopping)
        except Stopped:
            say(f"stopped after {directory.summary.get('movements', 0)} movements; to go on: {again}")
            raise
        except ReplayError as error:
            raise RunError(str(error)) from error
        except (SimulationError, ValueError) as error:
            raise Failed(str(error)) from error
        except OSError as error:
            raise Failed(f"{directory.path} cannot be written: {error}; is the disk full? --resume goes on") from error


def run_in(directory: RunDirectory, config: Config, parts: RunParts, stopping: Stopping) -> str:
    """Replay what the directory's log holds, live on to the end, and say what came out.

    Seconds: physics and evaluations of a resumed run add to those of its summary, which is at most ``FLUSH_EVERY`` old
    if it was killed; the learner's are counted from movement 0 on, since a replay lets it do all its work again.
    """
    rows = {id(demonstration): row for row, demonstration in enumerate(parts.demonstrations)}
    recorded = directory.columns.recorded(directory.lines)
    seconds = Seconds(directory.summary)
    execute = replay(recorded, seconds.of_physics(live(parts.environment, config.seed)))
    wanted = set(config.evaluations)
    model = RunModel(directory, parts.model, 0.0 if parts.trust is None else parts.trust.error)
    movements, flushed, title = 0, time.monotonic(), f"{config.variant} seed {config.seed}"

    def begin() -> None:
        directory.begin()
        model.begin()
        board.begin()

    def flush() -> None:
        board.flush()  # first: of a movement that the log holds, a replay does not know again when it was
        directory.log.flush()

    def summarise(*, finished: bool = False) -> None:
        flush()
        model.flush()
        last = directory.evaluations.last
        directory.summarise(
            movements=movements,
            mean_error_m=last.get("mean_error_m"),
            noise_floor_m=last.get("noise_floor_m"),
            **seconds.summary(),
            **model.summary(),
            finished=finished,
        )

    episodes = run(
        parts.learner,
        parts.environment,
        config.seed,
        movements=config.movements,
        teacher=parts.teacher,
        execute=execute,
    )
    finished = False
    with (
        RunBoard(directory, config, parts, seconds, partial(regions_of, parts)) as board,
        Progress("replaying" if recorded else title, len(recorded) or config.movements) as progress,
    ):
        try:
            if not recorded:
                begin()
            for episode in seconds.of_learner(episodes):
                demonstration = episode.demonstration
                line = directory.columns.line(episode, None if demonstration is None else rows[id(demonstration)])
                if episode.index >= len(recorded):
                    directory.log.append(line)
                elif line != directory.lines[episode.index]:
                    raise ReplayError(_differs(directory.columns, directory.lines[episode.index], line))
                movements = episode.index + 1
                board.episode(episode)
                if model.episode(episode, parts.learner.memory):
                    board.model(model.curves)
                if movements in wanted and not (movements in directory.evaluations and board.recall_evaluation()):
                    flush()
                    with seconds.of_evaluation():
                        evaluated = evaluate_in(config, parts, movements, stopping)
                    if evaluated is not None:
                        board.evaluation(evaluated)
                        with seconds.of_evaluation():
                            directory.evaluations.add(movements, evaluated, regions_of(parts))
                if movements == len(recorded):
                    begin()
                    say(*model.news())
                if movements > len(recorded) and time.monotonic() - flushed >= FLUSH_EVERY:
                    summarise()
                    flushed = time.monotonic()
                if movements > len(recorded):
                    say(*model.news())
                progress.show(movements, _error_so_far(directory))
                if movements == len(recorded) < config.movements:
                    progress.begin(title, config.movements, movements)
                stopping.check()
            finished = True
            say(*model.news(ended=True))
            board.finish()
        finally:
            if movements >= len(recorded):  # else the summary that was found counts for more
                summarise(finished=finished)
    error, floor = (directory.summary[name] for name in ("mean_error_m", "noise_floor_m"))
    measured = "not measured" if floor is None or math.isnan(floor) else f"{floor:.4f} m"
    found = "not evaluated" if error is None else f"mean error {error:.4f} m, noise floor {measured}"
    return f"{directory.path}: {movements} movements, {found}"


def _error_so_far(directory: RunDirectory) -> str:
    """Of the last evaluation, for the line of progress."""
    error = directory.evaluations.last.get("mean_error_m")
    return "" if error is None else f"error {error:.4f} m"


def evaluate_in(config: Config, parts: RunParts, movements: int, stopping: Stopping) -> Evaluation | None:
    """Evaluate the learner as it is now, with streams that the run does not use.

    Before its first exemplar there is nothing to infer a movement from, as for the learner by observation before its
    first demonstration: such an evaluation is left out.
    """
    if len(parts.learner.memory) == 0:
        return None
    goals = parts.benchmark.goals
    repeats = config.repeats if config.floor_at is None or movements in config.floor_at else 0
    with stopping.at_once():
        return evaluate(parts.inverse, parts.environment, goals, config.seed, movements, repeats=repeats)


def correspondence_of(parts: RunParts) -> list[str]:
    """How well the robot can play what it will be shown; nothing for who learns alone."""
    if not parts.residuals:
        return []
    median, worst = np.median(parts.residuals), max(parts.residuals)
    n = len(parts.residuals)
    return [
        f"{n} demonstrations; correspondence misses them by {median:.4f} rad (median), {worst:.4f} rad at most",
        *_outside(parts),
    ]


def _outside(parts: RunParts) -> list[str]:
    box, shown = parts.environment.outcomes, parts.demonstrations
    outside = [row for row, demonstration in enumerate(shown) if not box.contains(demonstration.outcome)]
    if not outside:
        return []
    place = ", ".join(f"{x:g}" for x in shown[outside[0]].outcome)
    more = f", as do {len(outside) - 1} more" if len(outside) > 1 else ""
    return [f"recording {outside[0]} lands at ({place}) m, outside T{more}; were they recorded in cm?"]


def regions_of(parts: RunParts) -> list[Region]:
    """Of the learner's goal model, whichever it is; none if it has no regions."""
    goals = getattr(parts.learner.autonomous, "goals", None)
    return list(getattr(goals, "regions", ()))


def open_directory(config: Config, parts: RunParts, resume: bool, *, accept_loss: bool = False) -> RunDirectory:
    """The directory of this run; of an earlier part's evaluations it keeps those that the whole run would have.

    Raises:
        RunError: see ``RunDirectory``; or its log is longer than the run is to be.
    """
    environment, regions = parts.environment, regions_of(parts)
    settings = json.loads(json.dumps({**vars(config), **parts.data}, default=str))  # as they will read back
    directory = RunDirectory(
        config.directory,
        settings,
        free=MAY_CHANGE,
        columns=Columns(environment.contexts.dim, environment.policies.dim, environment.outcomes.dim),
        region_dims=len(regions[0].low) if regions else None,
        versions=versions(),
        resume=resume,
        movements=config.movements,
        accept_loss=accept_loss,
    )
    same = directory.before is not None and all(
        directory.before.get(key) == settings[key] for key in EVALUATION_SETTINGS
    )
    directory.evaluations.keep(m for m in config.evaluations if same and m <= len(directory.lines))
    return directory


def versions() -> dict[str, Any]:
    """What runs here; ``commit`` is None outside a git repository and ends in "-dirty" when files were changed."""
    packages = {"numpy": "numpy", "scipy": "scipy", "faiss": "faiss-cpu", "mujoco": "mujoco"}
    here = str(Path(__file__).parent)
    describe = ["git", "-C", here, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        commit = subprocess.run(describe, capture_output=True, text=True, check=True, timeout=10).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        commit = None
    return {
        "python": platform.python_version(),
        **{name: importlib.metadata.version(package) for name, package in packages.items()},
        "sgimd_torch": sgimd_torch.__version__,
        "platform": platform.platform(),
        "commit": commit,
    }


def _differs(columns: Columns, recorded: bytes, now: bytes) -> str:
    """Of two lines: which columns differ, the first three in full."""
    were, are = (line.decode().split(",")[:-1] for line in (recorded, now))
    differences = [
        f"{name} was {old or 'empty'}, now {new or 'empty'}"
        for name, old, new in zip(columns.names, were, are, strict=True)
        if old != new
    ]
    more = f"; and {len(differences) - 3} more" if len(differences) > 3 else ""
    return (
        f"movement {were[0]} is replayed otherwise than recorded: {'; '.join(differences[:3])}{more}. "
        "Was it recorded by another version, or on another processor?"
    )
