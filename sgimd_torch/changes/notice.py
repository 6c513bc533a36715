"""Notices that a robot has changed, and finds out what of its earlier regimes still helps.

Each movement is predicted before its outcome is remembered. A CUSUM on surprises beyond the usual ones (Page 1954) says
since when predictions fail. Then it is tested whether the movements since then predict each other better, or whether a
calibration of what was known predicts them better: noise alone does neither. Everything follows from the exemplars and
their order, so a replay notices the same.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from sgimd_torch.changes.calibration import Calibration, by_halves
from sgimd_torch.changes.regimes import NEAR, Exemplars, Regime, predicted, squared
from sgimd_torch.inverses.gaussian_process import one_thread
from sgimd_torch.inverses.local_process import LocalProcess
from sgimd_torch.memory import Memory, Rows
from sgimd_torch.parts import Problem
from sgimd_torch.spaces import Array

_RECENT, _OVER, _DRIFT, _SUSPICIOUS = 200, 4.0, 0.12, 3.0  # surprises, times their upper fifth; of the CUSUM
_UPPER: Final = 0.8
_FIRST, _CALM = 50, 30  # exemplars, and predictions in this regime, before anything is suspected
_LOOKS: Final = (16, 24, 36, 54, 81, 122, 182, 273)  # movements since the suspicion at which it is tested
_EVERY, _SLOW = 64, 128  # without a suspicion: how often, and on how many of the last movements
_BAD: Final = 6.0  # times the variance expected: a prediction that failed
_SURE: Final = 3.5  # T of the test
_MOST: Final = 1.5  # largest log ratio of two errors
_TESTED: Final = 128  # newest movements that are tested
_REGIMES: Final = 3  # earlier regimes that are kept
_SURER: Final = 0.5  # largest variance of the outcome of an earlier exemplar now, relative to its variance without it
_GROWS: Final = 2  # factor of the movements of a regime from one look back to the next
_FIRST_LOOK: Final = 8  # movements, with a prior
_ALONE, _CALIBRATED = 24, 12  # least movements that predict each other by their own process, that calibrate


class Again(NamedTuple):
    """What to begin again with: ``kept`` of the ``before`` exemplars of an earlier regime, then all of the present one;
    whether that is ``new``."""

    exemplars: Exemplars
    kept: int
    before: int
    new: bool


class Notice:
    """Watches the exemplars of a learner.

    Args:
        problem: problem to learn, with its spaces and noise.
        life: all exemplars of the learner.
        prior: exemplars of another robot, such as a simulator: an earlier regime from the start. None: there is none.

    Attributes:
        since: row of ``life`` in which the present regime began.
    """

    def __init__(self, problem: Problem, life: Memory, prior: Memory | None) -> None:
        self.problem, self.life, self.noise = problem, life, problem.outcome_noise
        self.since = self._compared = 0
        self._regimes: list[Regime] = []  # earlier ones, the one that was used last comes last
        self._review = 0  # length of the regime at which to look back again, 0: never
        self._calm()
        if prior is not None:
            self._review = _FIRST_LOOK
            if (learnt := LocalProcess(problem.over(prior)).learnt()) is not None:
                self._regimes = [Regime(learnt, Exemplars.of(prior))]

    def _calm(self) -> None:
        self._surprises: list[float] = []
        self._errors: list[float] = []
        self._cusum, self._start, self._quiet, self._looks = 0.0, -1, 0, 0

    def expect(self, process: LocalProcess, context: Array, theta: Array, outcome: Array) -> None:
        """Predict a movement that is not in memory yet, and compare."""
        learnt = process.learnt()
        if learnt is None:
            return
        here = ((np.concatenate((theta, context)) - learnt.units[0]) / learnt.units[1])[None]
        near = learnt.inputs.nearest(here, NEAR)
        found, (variance,), _ = predicted(learnt.inputs, process.memory.outcomes, near, here, learnt.kernel)
        self._errors.append(float(squared(found[0] - outcome)))
        surprise = self._errors[-1] / (len(outcome) * float(variance) + 1e-300)
        self._surprises = [*self._surprises[-_RECENT:], surprise]
        if len(process.memory) >= _FIRST and len(self._surprises) >= _CALM:
            self._accumulate(len(self.life) + 1)

    def look(self, process: LocalProcess) -> Again | None:
        """What to begin again with; None to go on."""
        n = len(self.life)
        if self._start < 0 and self._review and n - self.since >= self._review:
            return self._look_back(new=False)
        m = self._suspected(process, n)
        if m and (m := self._changed(process, m)):
            learnt, before = process.learnt(), Exemplars.of(process.memory, slice(len(process.memory) - m))
            assert learnt is not None
            self._regimes, self.since = [*self._regimes, Regime(learnt, before)][-_REGIMES:], n - m
            return self._look_back(new=True)
        return None

    def _accumulate(self, n: int) -> None:
        """Add the last surprise to the CUSUM; ``n``: number of exemplars with this one."""
        if self._start < 0:
            self._usual = _upper(self._surprises[:-1])
        self._cusum = max(0.0, self._cusum + (self._surprises[-1] > _OVER * self._usual) - _DRIFT)
        if self._start < 0:
            if self._cusum == 0:
                self._quiet = n
            if self._cusum >= _SUSPICIOUS:
                self._start, self._looks = self._quiet, 0
                self._usual = _upper(self._surprises[: self._quiet - n] or self._surprises)

    def _suspected(self, process: LocalProcess, n: int) -> int:
        """How many of the last movements to test now."""
        if self._start < 0:
            return self._drifted(process, n)
        m = n - self._start
        due = sum(m >= look for look in _LOOKS)
        if due > self._looks:
            self._looks = due
            return m
        if self._cusum == 0 or m > _LOOKS[-1]:
            self._calm()
        return 0

    def _drifted(self, process: LocalProcess, n: int) -> int:
        """Without a suspicion, how many of the last movements predict each other better than they were predicted."""
        m, learnt = _SLOW, process.learnt()
        if n - self._compared < _EVERY or learnt is None:
            return 0
        self._compared = n
        if len(self._errors) < m or len(process.memory) < 4 * m:
            return 0
        others, _ = Regime(learnt, Exemplars.of(process.memory, slice(-m, None))).left_out(np.arange(m))
        return m if self._better(np.array(self._errors[-m:]), others) >= _SURE else 0

    @one_thread
    def _changed(self, process: LocalProcess, m: int) -> int:
        """How many of the last ``m`` movements are of another regime."""
        learnt, memory, n = process.learnt(), process.memory, len(process.memory)
        if learnt is None or n - m < _CALM:
            return 0
        rows = np.arange(max(n - m, n - _TESTED), n)
        told, before = Exemplars.of(memory, rows), Regime(learnt, Exemplars.of(memory, slice(n - m)))
        expected, variances, _ = before.predict(told)
        as_it_was, failed = squared(expected - told.outcomes), variances * _BAD * memory.outcome_dim
        # If nothing had changed, both would predict; the first errs more where noise has grown.
        nulls = Regime(learnt, Exemplars.of(memory)).left_out(rows)[0], as_it_was
        alone, _ = Regime(learnt, told).left_out(np.arange(len(rows)))
        for other in (alone, by_halves(before, self.problem.policies, told)):
            for which in (slice(None), as_it_was > failed):  # a local change is seen in those that failed
                if all(self._better(null[which], other[which]) >= _SURE for null in nulls):
                    # The suspicion may have begun too early: the first movements then fit the old regime better.
                    gains = np.zeros(len(rows))
                    gains[which] = self._gains(as_it_was, other)[which]
                    last = 1 + int(gains[::-1].cumsum().argmax())
                    return m if last == len(rows) else last
        return 0

    def _gains(self, errors: Array, others: Array) -> Array:
        """By how much others predict better: log ratios of errors; noise is not to be had."""
        floor = self.noise**2 + 1e-300
        return np.clip(0.5 * np.log((errors + floor) / (others + floor)), -_MOST, _MOST)

    def _better(self, errors: Array, others: Array) -> float:
        """T, self-normalised: how sure it is that others predict better."""
        gains = self._gains(errors, others)
        return float(gains.sum() / np.sqrt(squared(gains) + 1e-300))

    @one_thread
    def _look_back(self, *, new: bool) -> Again:
        """Exemplars of earlier regimes that help to predict this one, then all of this one."""
        now = Exemplars.of(self.life, slice(self.since, None))
        n, kept, before, best = len(now.thetas), now.some(slice(0)), 0, -np.inf
        test = np.arange(max(0, n - _TESTED), n)
        told = now.some(test)
        for regime in self._regimes:
            mine, _ = self._process(now, regime).left_out(test)
            errors = [regime.errors(told)]
            errors += [by_halves(regime, self.problem.policies, told)] if n >= _CALIBRATED else []
            for change, each in enumerate(errors):
                if (gain := float(self._gains(mine, each).mean())) > best:
                    best, chosen, calibrated, alone = gain, regime, bool(change), mine
        if self._regimes:
            self._regimes = [*(each for each in self._regimes if each is not chosen), chosen]
            helpful, before = self._helpful(chosen, calibrated, now, test), len(chosen.exemplars.thetas)
            together, _ = self._process(helpful.and_then(now), chosen).left_out(len(helpful.thetas) + test)
            kept = helpful if self._gains(alone, together).mean() >= 0 else kept
        self._review, self._errors = _GROWS * n if len(kept.thetas) else 0, []
        if new:
            self._calm()
        return Again(kept.and_then(now), len(kept.thetas), before, new)

    def _process(self, exemplars: Exemplars, regime: Regime) -> Regime:
        """A process of these exemplars; if they are few, with lengths and kernel of an earlier regime."""
        few = len(exemplars.thetas) < _ALONE
        learnt = None if few else LocalProcess(self.problem.over(exemplars.memory)).learnt()
        return Regime(learnt or regime.learnt, exemplars)

    def _helpful(self, regime: Regime, calibrated: bool, now: Exemplars, test: Rows) -> Exemplars:
        """Exemplars of an earlier regime, as they would come out now, where they are surer than those of now.

        What a calibration leaves unexplained is a process, too.
        """
        calibration = Calibration(regime, self.problem.policies)
        if calibrated:
            calibration.fit(now.some(test))
        left = now._replace(outcomes=now.outcomes - calibration.predict(now))
        before = calibration.translated(max(float(np.median(squared(left.outcomes[test]))), self.noise**2))
        of_left, alone = self._process(left, regime), self._process(now, regime)
        wrong, variances, _ = of_left.predict(before)
        without = alone.predict(before)[1] * alone.doubt(test)
        corrected = before._replace(outcomes=before.outcomes + wrong)
        return corrected.some(variances * of_left.doubt(test) < _SURER * without)


def _upper(values: list[float]) -> float:
    """The value below which four fifths of the values lie."""
    return sorted(values)[int(_UPPER * len(values))]
