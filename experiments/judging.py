"""How claims are judged: parts with bars, and one loop for all claims of a page.

    judge([Claim("SGIM-D halves Random's error", [at_most(0.5, found.ratio, "sgim-d", "random")])])
A part clears its bar only if its whole interval does. A claim of several parts holds if each of them does, which
needs no correction. It fails if one of them does at a confidence corrected for their number. Else it is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Final, NamedTuple

from evidence import Level, Measure, NotRun
from sgimd_torch.views.statistics import LEVEL, holm, show

HOLDS: Final = "holds"
FAILS: Final = "fails"
OPEN: Final = "open"
MISSING: Final = "not run"


class Part(NamedTuple):
    """A number with a bar.

    ``measured`` gives it at a confidence ``level``. It should be at most the ``bar``, or at least, if ``least``; its
    interval may reach ``margin`` beyond. ``name``: what it is of, where a claim has several; ``form``: of the number.
    """

    measured: Measure
    bar: float
    least: bool = False
    margin: float = 0.0
    name: str = ""
    form: str = ".2f"

    @property
    def above(self) -> float:
        """How far the number lies on the wrong side of the bar."""
        return _above(self, None)[0]

    def holds(self, level: float) -> bool:
        """Whether the number clears the bar, and its interval, too, but for the margin."""
        return self.above <= 0 and _above(self, level)[2] <= self.margin

    def fails(self, level: float) -> bool:
        """Whether the whole interval is on the wrong side."""
        return self.above > 0 and _above(self, level)[1] > 0


class Claim(NamedTuple):
    """What is claimed, with its schedules and its bar in words; its parts; a sentence on what came of it."""

    text: str
    parts: Sequence[Part]
    note: str = ""


class Verdict(NamedTuple):
    """``number``: of the part that is farthest on the wrong side, with its interval of 95 %."""

    claim: str
    number: str
    verdict: str


def judge(claims: Sequence[Claim]) -> list[Verdict]:
    """All claims in order, corrected together by Holm's method: the chance that any verdict is wrong is 5 % at most.

    Intervals of few seeds are too narrow: where n paired differences all have one sign, their bootstrap interval
    excludes 0 at any level, and by chance alone they have one sign with probability 2^(1 - n).

    Raises:
        ValueError: errors that have no ratio, such as 0.
    """
    run = {number: claim for number, claim in enumerate(claims) if not _missing(claim)}
    standing = holm(run, lambda number, level: _verdict(run[number], level) != OPEN)
    return [
        Verdict(claim.text, _number(claim), _verdict(claim, LEVEL) if number in standing else OPEN)
        if number in run
        else Verdict(claim.text, "", MISSING)
        for number, claim in enumerate(claims)
    ]


def at_most(bar: float, measure: Measure, *of: object, margin: float = 0.0, name: str = "", form: str = ".2f") -> Part:
    """The part that ``measure(*of)`` is at most the bar."""
    return Part(partial(measure, *of), bar, False, margin, name, form)


def at_least(bar: float, measure: Measure, *of: object, margin: float = 0.0, name: str = "", form: str = ".2f") -> Part:
    """The part that ``measure(*of)`` is at least the bar."""
    return Part(partial(measure, *of), bar, True, margin, name, form)


@cache
def _above(part: Part, level: Level) -> tuple[float, float, float]:
    """The number of a part and its interval, as distances to the bar: above 0 on the wrong side."""
    value, low, high = (each - part.bar for each in part.measured(level=level))
    return (-value, -high, -low) if part.least else (value, low, high)


def _verdict(claim: Claim, level: float) -> str:
    # The worst first: then a claim of many parts that does not hold costs few intervals.
    worst = sorted(claim.parts, key=lambda part: -part.above)
    if all(part.holds(level) for part in worst):
        return HOLDS
    return FAILS if any(part.fails(1 - (1 - level) / len(worst)) for part in worst) else OPEN


def _number(claim: Claim) -> str:
    part = max(claim.parts, key=lambda part: part.above / max(abs(part.bar), 1e-3))
    return show(part.measured(), part.form).replace("-", "−") + (f" ({part.name})" if part.name else "")


def _missing(claim: Claim) -> list[str]:
    missing = list[str]()
    for part in claim.parts:
        try:
            part.measured(level=None)
        except NotRun as error:
            missing.append(str(error))
    return missing
