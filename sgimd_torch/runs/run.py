"""One run: replay its record, make new movements, evaluate now and then. Listeners do everything else.

print(run_one(build(Config(seed=3)), stopping, resume=False, again="sgimd run --seed 3 --resume"))
"""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from typing import Final

from sgimd_torch.environments.protocol import FAILURES, SimulationError, reason_of
from sgimd_torch.evaluation import beyond
from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.record import ReplayError, RunError
from sgimd_torch.runs.directory import has_ended, open_run
from sgimd_torch.runs.evaluations import Evaluations
from sgimd_torch.runs.hooks import Listener, Listening
from sgimd_torch.runs.messages import ProgressBar, say
from sgimd_torch.runs.program import Failed
from sgimd_torch.runs.run_parts import RunParts
from sgimd_torch.runs.signals import Stopped, Stopping
from sgimd_torch.session import NoOutcomeError, live, run
from sgimd_torch.spaces import Episode

N_TOLD: Final = 3  # number of failures with a message each; later ones are only counted
BEYOND: Final = 0.1  # share of goals that look out of reach from which on the result tells their number
COMMIT_EVERY: Final = 1.0  # s between two commits; a killed run loses the movements since the last commit


def run_one(parts: RunParts, stopping: Stopping, *, resume: bool, again: str) -> str:
    """Make a run, or go on with one, and return its result as one line.

    Args:
        parts: parts of the run.
        stopping: object that knows whether a signal has come.
        resume: true to go on with the run in the folder.
        again: command that resumes the run, for messages.

    Raises:
        ValueError, OSError: the run cannot begin.
        Failed: the run failed after its beginning, or most of its movements did.
        Stopped: a signal stopped the run.
    """
    with RunLoop(parts, resume=resume) as loop:
        try:
            loop.go_on(stopping)
        except Stopped:
            say(f"stopped after {loop.record.movements} movements; to go on: {again}")
            raise
        except (ReplayError, RunError) as error:
            raise RunError(str(error)) from error
        except OSError as error:
            raise Failed(f"{loop.record.path} cannot be written: {reason_of(error)}; to go on: {again}") from error
        except (Exception, SystemExit) as error:  # an error of a part, or too many failed movements
            raised = error.__cause__ if isinstance(error, NoOutcomeError) and error.__cause__ else error
            if not isinstance(raised, SimulationError):
                say("".join(traceback.format_exception(raised)).rstrip())
            said = str(error) if raised is not error else reason_of(error)
            if isinstance(error, NoOutcomeError):
                said += " (--failures says how many in a row end a run)"
            raise Failed(f"{said}; {loop.record.movements} movements are kept; to go on: {again}") from error
        if 2 * loop.failed > loop.movements:
            raise Failed(f"{loop.summary}; most movements failed, so little was learnt: does the robot work?")
        return loop.summary


class RunLoop(AbstractContextManager["RunLoop"]):
    """A run under way. Each movement is recorded, then told to the listeners; then there may be an evaluation.

    It is a context manager. Leaving it writes the last movements to the disk, except after Ctrl-C.

    Args:
        parts, resume: arguments of ``run_one``.

    Attributes:
        record: record of the run; new movements are written to it after the replay.
        movements, recorded, failed: number of movements so far, number recorded earlier, and number that failed.
        told: number of failures since this process began.

    Raises:
        RunError, OSError: see ``open_run``.
    """

    def __init__(self, parts: RunParts, *, resume: bool) -> None:
        self.parts = parts
        self.record, notes = open_run(parts, resume=resume)
        say(*parts.notes, *notes)
        self.movements, self.recorded, self.failed, self.told = 0, self.record.movements, 0, 0
        self.seconds = Seconds(self.record.about.get("seconds", {}))
        parts.learner.listeners.append(self._hear)
        self.listeners: list[Listener] = []
        self._recalls = has_ended(self.record, parts)
        self.evaluations = Evaluations(parts, self.record, with_regions=not self._recalls)
        for part in parts.learner.problem.trained:
            if isinstance(part, Listening) and not self._recalls:
                until = min([self.recorded, *self.evaluations.missing])
                refreshes = [row for row in self.record.rows("refreshes") if row[0] <= until]
                part.restore(parts.config.directory, refreshes)
                self.listeners.append(part.listener(self))
        for hook in parts.hooks:  # one may look for the listeners of those before
            self.listeners += filter(None, [hook.listener(self)])
        self._wanted = parts.config.evaluations  # numbers of movements before the evaluations to come
        self._committed_at, self._kept, self._warned = time.monotonic(), self.recorded, False  # of the last commit
        self._remarked = {kind for found in self.record.about.setdefault("remarks", {}).values() for kind in found}

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        broken_off = kind is not None and issubclass(kind, KeyboardInterrupt)
        with suppress(*([] if kind is None else [OSError])):  # a full disk: the first error is raised
            self.close(keep=not broken_off)

    def close(self, *, keep: bool = True) -> None:
        """Close record and listeners; ``keep`` commits the last movements first."""
        try:
            if keep:
                self._keep()
        finally:
            self.record.close()
            for listener in self.listeners:
                listener.close()

    @property
    def replaying(self) -> bool:
        """Whether the record is still being replayed."""
        return self.movements < self.recorded and not self._recalls

    @property
    def summary(self) -> str:
        """Result of the run, as one line."""
        last, result, amount = self.evaluations.last, "not evaluated", self.parts.environment.outcomes.amount
        if last is not None:
            floor = last.noise_floor
            measured = "not measured" if math.isnan(floor) else amount(floor, ".4f")
            result = f"mean error {amount(last.mean_error, '.4f')}, noise floor {measured}"
            outside = beyond(self.parts.learner.memory.outcomes, self.parts.benchmark.goals)
            if BEYOND < outside.mean() < 1:
                others = f"mean error at the others {amount(float(last.errors[~outside].mean()), '.4f')}"
                result += f"; {outside.sum()} of {len(outside)} goals look out of reach, {others}"
            if last.failed.any():
                result += f" ({last.failed.sum()} of {len(last.failed)} movements of the evaluation failed)"
        failed = f" ({self.failed} failed)" if self.failed else ""
        ended_early = self.record.about["ended_early"]
        early = f", ended early as {ended_early[1]}" if ended_early else ""
        return f"{self.parts.config.directory}: {self.movements} movements{failed}, {result}{early}"

    def go_on(self, stopping: Stopping) -> None:
        """Make all movements, or stop after the movement during which ``stopping`` has heard a signal."""
        total, title = self.parts.config.movements, self.parts.config.title
        unit = self.parts.environment.outcomes.amount
        self.evaluations.between = partial(self._stop_if, stopping)
        first = "evaluating" if self._recalls else "replaying" if self.recorded else title
        with ProgressBar(first, self.recorded or total) as progress:
            for _ in self.episodes():
                last = self.evaluations.last
                note = "" if last is None else f"error {unit(last.mean_error, '.4f')}"
                progress.show(self.movements, note)
                if self.movements == self.recorded < total:
                    progress.begin(title, total, self.movements)
                self._stop_if(stopping)
        self.commit()

    def episodes(self) -> Iterator[Episode]:
        """All episodes, one by one: first the recorded ones, then new ones. A finished run has none, unless a hook
        needs them: its learner gets its exemplars, and missing evaluations are made."""
        parts, config = self.parts, self.parts.config
        if self._recalls:
            self._recall()
            return
        in_this_process = nullcontext(live(parts.environment, config.seed))
        with next(filter(None, (hook.executing(parts) for hook in parts.hooks)), in_this_process) as execute:
            episodes = run(
                parts.learner,
                parts.environment,
                config.seed,
                movements=config.movements,
                teacher=parts.teacher,
                teachers=parts.teachers,
                execute=self.seconds.of("physics")(execute),
                record=self.record,
                failures=config.failures or FAILURES,
                at_once=parts.robots,
            )
            if not self.recorded:
                self._begin()
            following = self.seconds.of("learner")(partial(next, episodes, None))
            for episode in iter(following, None):
                self._after(episode)
                yield episode
                if self._ends_early():
                    return

    def _recall(self) -> None:
        """Give the learner of a finished run its exemplars, and make missing evaluations."""
        from sgimd_torch.runs.recall import Recalled  # most runs have not ended yet

        recalled = Recalled(self.parts.learner, self.record)
        self.evaluations.parts = self._parts_of(self.recorded)
        for movements in self.evaluations.missing:
            recalled.until(movements)
            self.movements = self.parts.learner.movements
            self._evaluate()
        recalled.until()
        self.movements, self.failed = self.recorded, recalled.failed
        self._begin()

    def _parts_of(self, movements: int) -> RunParts:
        """The parts of a run that ends after this number of ``movements``."""
        return replace(self.parts, config=replace(self.parts.config, movements=movements))

    @property
    def _all_told(self) -> bool:
        """Whether the episodes of all robots that moved at once were told to the listeners."""
        return self.movements == self.parts.learner.movements

    def commit(self) -> bool:
        """Write everything to the disk. If another program's reading prevents that, say so; the result is false."""
        self._committed_at = time.monotonic()
        self.record.about["seconds"] = self.seconds.summary()
        if self.record.commit():
            self._kept, self._warned = self.movements, False
            for listener in self.listeners:
                listener.flush()
            return True
        if not self._warned:
            say(f"another program reads {self.record.path}: until it ends, nothing after movement {self._kept} is kept")
        self._warned = True
        return False

    def _keep(self) -> None:
        """Write the last movements to the disk, as soon as no other program reads the record."""
        while not self.replaying and not self.commit():
            time.sleep(COMMIT_EVERY)

    def _stop_if(self, stopping: Stopping) -> None:
        """Stop between two movements of the run or of an evaluation, if a signal was heard."""
        if stopping.heard and self._all_told:
            self._keep()
            raise Stopped(stopping.heard)

    def _hear(self, event: Event) -> None:
        if event.kind == Kind.CHANGED and self.record.add in self.parts.learner.listeners:  # not in a replay
            say(str(event.reply))

    def curves(self) -> dict[str, float]:
        """Numbers of the listeners for the board since the last call, by tag."""
        return {tag: value for listener in self.listeners for tag, value in listener.curves().items()}

    def _after(self, episode: Episode) -> None:
        replayed = self.replaying
        self.movements = episode.index + 1
        if episode.failed:
            self.failed += 1
            self.told += not replayed
            if not replayed and self.told <= N_TOLD:
                more = "; further failures are only counted" if self.told == N_TOLD else ""
                say(f"movement {episode.index} failed: {episode.failed}{more}")
        for listener in self.listeners:
            listener.episode(episode, replayed)
        if self._wanted and self._wanted[0] <= self.movements and self._all_told:
            self._wanted = [movements for movements in self._wanted if movements > self.movements]
            self._evaluate()
        if self.movements == self.recorded:
            self._begin()
        if not self.replaying and time.monotonic() - self._committed_at >= COMMIT_EVERY:
            self.commit()

    def remark(self, who: str, found: Mapping[str, str]) -> None:
        """Say what a listener has noticed, by kind, each kind once; the record keeps its last remarks for all views."""
        self.record.about["remarks"][who] = found
        say(*(text for kind, text in found.items() if kind not in self._remarked))
        self._remarked |= found.keys()

    def _ends_early(self) -> bool:
        """Whether a listener ends the run now; then there is a last evaluation."""
        config, ended = self.parts.config, self.record.about["ended_early"]
        if self.replaying or not self._all_told or self.movements >= config.movements:
            return False
        if ended is None:
            why = next(filter(None, (listener.ends() for listener in self.listeners)), "")
            ended = self.record.about["ended_early"] = [self.movements, why] if why else None
        if ended and config.evaluations:
            self.evaluations.parts = self._parts_of(self.movements)
            self._evaluate()
        return ended is not None

    def _evaluate(self) -> None:
        with self.seconds.of("evaluation"):
            evaluations = self.evaluations.after(self.movements)
        if evaluations is None:
            return
        for listener in self.listeners:
            listener.evaluated(self.movements, evaluations)
        if not self.replaying:
            self.commit()

    def _begin(self) -> None:
        """The replay is over: from now on files change."""
        for listener in self.listeners:
            listener.begin()
        self.commit()


class Seconds:
    """Seconds spent so far, by part of the run.

    Args:
        before: seconds of the resumed run; physics and evaluation continue from there, as a replay skips both.
    """

    def __init__(self, before: Mapping[str, float]) -> None:
        self._spent = {part: before.get(f"seconds_{part}", 0.0) for part in ("physics", "evaluation")}
        self._spent["learner"] = self._within = 0.0

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Add the time of a block or decorated function to a ``part``; blocks within it count for their own parts."""
        begun, around, self._within = time.perf_counter(), self._within, 0.0
        try:
            yield
        finally:
            passed = time.perf_counter() - begun
            self._spent[part] = self._spent.get(part, 0.0) + passed - self._within
            self._within = around + passed

    def summary(self) -> dict[str, float]:
        """Seconds by name, as the record stores them."""
        return {f"seconds_{part}": round(seconds, 3) for part, seconds in self._spent.items()}
