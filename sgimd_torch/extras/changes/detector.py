"""Detects that a robot has changed, and finds out which exemplars of earlier eras still help.

An era is a part of a life in which the robot stays the same.

Each movement is predicted before its outcome is remembered. A CUSUM on surprises beyond the usual ones (Page 1954) says
since when predictions fail. A small or slow change makes no single prediction fail, so the last movements are also
tested at intervals. The test is what predicts them better: each other, or what was known, calibrated or shifted. Noise
alone makes none of these better. Everything follows from the exemplars and their order, so a replay notices the same.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.extras.changes.calibration import Calibration, by_halves, shifted_by_halves
from sgimd_torch.extras.changes.eras import SURE, Era, better, gains_over, squared
from sgimd_torch.inverses.gaussian_process import one_thread
from sgimd_torch.inverses.local_process import LocalProcess, predictions
from sgimd_torch.memory import Memory, Rows
from sgimd_torch.memory.exemplars import Exemplars
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array

_RECENT: Final = 200  # number of last surprises from which the usual surprise is taken
_PREDICTED_FROM: Final = 40  # number of exemplars from which a movement is predicted
_SURPRISING: Final = 4.0  # surprise, relative to the usual one, above which a prediction counts for the CUSUM
_DRIFT: Final = 0.12  # number that the CUSUM loses with each movement
_SUSPICIOUS: Final = 3.0  # CUSUM from which on a change is suspected
_FIRST: Final = 50  # least number of exemplars before a change is suspected
_PREDICTED: Final = 30  # least number of predictions in an era before a change is suspected
# Numbers of movements since a suspicion at which it is tested.
_TESTED_AFTER: Final = (16, 24, 36, 54, 81, 122, 182, 273)
_EVERY: Final = 64, 1 / 32  # movements between two tests without a suspicion: at least so many, and this part of all
_SURE_OF_MANY: Final = 2.5  # statistic T from which on such a test is passed; 1.5 at most where nothing had changed
_FAILED: Final = 6.0  # squared error, relative to the expected one, above which a prediction has failed
_TESTED: Final = 128  # largest number of newest movements that are tested
_KNOWN: Final = 4 * _TESTED  # least number of exemplars before a test without a suspicion
_ERAS: Final = 3  # largest number of earlier eras that are kept
_SURER: Final = 0.5  # largest variance of the outcome of an earlier exemplar now, relative to its variance without it
_GROWTH: Final = 2  # factor of the length of an era from one comparison with earlier eras to the next
_FIRST_REVIEW: Final = 8  # number of movements at the first such comparison with a prior
_ALONE: Final = 24  # least number of movements that get lengths and kernel of their own
_CALIBRATED: Final = 12  # least number of movements that calibrate an earlier era
_HELPS: Final = 2.0  # statistic T from which on earlier exemplars are kept


class Found(NamedTuple):
    """What was found out when a learner is to begin again.

    Attributes:
        kept: helpful exemplars of an earlier era; all of the present era follow them.
        n_before: number of exemplars of the earlier era.
        is_new: whether the present era has begun now.
    """

    kept: Exemplars
    n_before: int
    is_new: bool


class ChangeDetector:
    """Compares the exemplars of a learner with predictions.

    Args:
        problem: problem to learn, with its spaces and noise.
        life: all exemplars of the learner.
        prior: exemplars of another robot, such as a simulator: an earlier era from the start. None: there is none.

    Attributes:
        since: row of ``life`` in which the present era began.
    """

    def __init__(self, problem: Problem, life: Memory, prior: Memory | None) -> None:
        self.problem, self.life, self.noise = problem, life, problem.outcome_noise
        self.since = self._tested_at = 0
        self._eras: list[Era] = []  # earlier ones; the one that helped last comes last
        self._review = 0  # length of the era at which to compare it with earlier eras again, 0: never
        self._reset_suspicion()
        if prior is not None:
            self._review = _FIRST_REVIEW
            if (fitted := LocalProcess(problem.over(prior)).fitted()) is not None:
                self._eras = [Era(fitted, Exemplars.of(prior))]

    def _reset_suspicion(self) -> None:
        self._surprises: list[float] = []
        self._cusum, self._suspected_at, self._last_quiet, self._n_tests = 0.0, -1, 0, 0

    def expect(self, process: LocalProcess, context: Array, theta: Array, outcome: Array) -> None:
        """Predict a movement that is not in memory yet, and compare."""
        fitted = process.fitted()
        if fitted is None:
            return
        point = ((np.concatenate((theta, context)) - fitted.units[0]) / fitted.units[1])[None]
        near = fitted.inputs.nearest(point, _PREDICTED_FROM)
        predicted = predictions(fitted.inputs, process.memory.outcomes, near, point, fitted.kernel)
        expected, (variance,), (noise,), _ = predicted
        surprise = float(squared(expected[0] - outcome)) / (len(outcome) * float(variance + noise) + 1e-300)
        self._surprises = [*self._surprises[-_RECENT:], surprise]
        if len(process.memory) >= _FIRST and len(self._surprises) >= _PREDICTED:
            self._accumulate(len(self.life) + 1)

    def restart_if_changed(self, process: LocalProcess) -> Found | None:
        """What to begin again with; None to go on."""
        n = len(self.life)
        if self._suspected_at < 0 and self._review and n - self.since >= self._review:
            return self._restart(is_new=False)
        n_last, sure = self._to_test(n, len(process.memory))
        if n_last and (n_last := self._changed(process, n_last, sure)):
            fitted, before = process.fitted(), Exemplars.of(process.memory, slice(len(process.memory) - n_last))
            assert fitted is not None
            self._eras, self.since = [*self._eras, Era(fitted, before)][-_ERAS:], n - n_last
            return self._restart(is_new=True)
        return None

    def _accumulate(self, n: int) -> None:
        """Add the last surprise to the CUSUM; ``n``: number of exemplars with this one."""
        if self._suspected_at < 0:
            self._usual = _fourth_fifth(self._surprises[:-1])
        self._cusum = max(0.0, self._cusum + (self._surprises[-1] > _SURPRISING * self._usual) - _DRIFT)
        if self._suspected_at < 0:
            if self._cusum == 0:
                self._last_quiet = n
            if self._cusum >= _SUSPICIOUS:
                self._suspected_at, self._n_tests = self._last_quiet, 0
                self._usual = _fourth_fifth(self._surprises[: self._last_quiet - n] or self._surprises)

    def _to_test(self, n: int, n_known: int) -> tuple[int, float]:
        """How many of the last movements to test now, and from which statistic T on they are of another era."""
        if self._suspected_at < 0:
            is_due = (
                n_known >= _KNOWN and n - self.since >= _TESTED and n - self._tested_at >= max(_EVERY[0], _EVERY[1] * n)
            )
            self._tested_at = n if is_due else self._tested_at
            return _TESTED if is_due else 0, _SURE_OF_MANY
        n_since = n - self._suspected_at
        due = sum(n_since >= moment for moment in _TESTED_AFTER)
        if due > self._n_tests:
            self._n_tests = due
            return n_since, SURE
        if self._cusum == 0 or n_since > _TESTED_AFTER[-1]:
            self._reset_suspicion()
        return 0, SURE

    @one_thread
    def _changed(self, process: LocalProcess, n_last: int, sure: float) -> int:
        """How many of the last ``n_last`` movements are of another era."""
        fitted, memory, n = process.fitted(), process.memory, len(process.memory)
        if fitted is None or n - n_last < _PREDICTED:
            return 0
        rows = np.arange(max(n - n_last, n - _TESTED), n)
        tested, earlier = Exemplars.of(memory, rows), Era(fitted, Exemplars.of(memory, slice(n - n_last)))
        expected, variances, _ = prediction = earlier.predict(tested)
        as_it_was, failed = squared(expected - tested.outcomes), variances * _FAILED * memory.outcome_dim
        of_each_other, shifted = Era(fitted, tested).left_out_each(), shifted_by_halves(tested.outcomes - expected)
        calibrated = Calibration(earlier, self.problem.policies).linear_by_halves(tested, prediction)
        subsets = (slice(None), sure), (as_it_was > failed, SURE)  # a local change is seen in those that failed
        # If nothing had changed, all others would predict, too; they err more if noise grew.
        of_all: Array | None = None
        for errors in (of_each_other, calibrated, shifted):
            for some, least in subsets:
                if better(as_it_was[some], errors[some], self.noise) < least:
                    continue
                of_all = Era(fitted, Exemplars.of(memory)).left_out(rows)[0] if of_all is None else of_all
                if better(of_all[some], errors[some], self.noise) >= least:
                    # The suspicion may have begun too early: the first movements then fit the old era better.
                    gains = np.zeros(len(rows))
                    gains[some] = gains_over(as_it_was, errors, self.noise)[some]
                    n_changed = 1 + int(gains[::-1].cumsum().argmax())
                    return n_last if n_changed == len(rows) else n_changed
        return 0

    @one_thread
    def _restart(self, *, is_new: bool) -> Found:
        """Exemplars of earlier eras that help to predict this one, then all of this one."""
        current = Exemplars.of(self.life, slice(self.since, None))
        n, kept, n_before, best = len(current.thetas), current.some(slice(0)), 0, -np.inf
        tested_rows = np.arange(max(0, n - _TESTED), n)
        tested = current.some(tested_rows)
        for era in self._eras:
            own_errors, _ = self._process(current, era).left_out(tested_rows)
            errors = [era.errors(tested)]
            errors += [by_halves(era, self.problem.policies, tested)] if n >= _CALIBRATED else []
            for calibration, era_errors in enumerate(errors):
                if (gain := float(gains_over(own_errors, era_errors, self.noise).mean())) > best:
                    best, chosen, calibrated, alone = gain, era, bool(calibration), own_errors
        if self._eras:
            self._eras = [*(era for era in self._eras if era is not chosen), chosen]
            helpful, n_before = self._helpful(chosen, calibrated, current, tested_rows), len(chosen.exemplars.thetas)
            together, _ = self._process(helpful.and_then(current), chosen).left_out(len(helpful.thetas) + tested_rows)
            kept = helpful if better(alone, together, self.noise) >= _HELPS else kept
        self._review = _GROWTH * n if len(kept.thetas) else 0
        if is_new:
            self._reset_suspicion()
        return Found(kept, n_before, is_new)

    def _process(self, exemplars: Exemplars, era: Era) -> Era:
        """A process of these exemplars; if they are few, with lengths and kernel of an earlier era."""
        few = len(exemplars.thetas) < _ALONE
        fitted = None if few else LocalProcess(self.problem.over(exemplars.memory_like(self.life))).fitted()
        return Era(fitted or era.fitted, exemplars)

    def _helpful(self, era: Era, calibrated: bool, current: Exemplars, tested_rows: Rows) -> Exemplars:
        """Exemplars of an earlier era, as they would come out now, where they are surer than those of now.

        What a calibration leaves unexplained is a process, too.
        """
        calibration = Calibration(era, self.problem.policies)
        if calibrated:
            calibration.fit(current.some(tested_rows))
        unexplained = current._replace(outcomes=current.outcomes - calibration.predict(current))
        largest_variance = max(float(np.median(squared(unexplained.outcomes[tested_rows]))), self.noise**2)
        before = calibration.translated(largest_variance)
        of_unexplained, alone = self._process(unexplained, era), self._process(current, era)
        correction, variances, _ = of_unexplained.predict(before)
        variances_alone = alone.predict(before)[1] * alone.inflation(tested_rows)
        corrected = before._replace(outcomes=before.outcomes + correction)
        return corrected.some(variances * of_unexplained.inflation(tested_rows) < _SURER * variances_alone)


def _fourth_fifth(values: list[float]) -> float:
    """The value below which four fifths of the values lie."""
    return sorted(values)[int(0.8 * len(values))]
