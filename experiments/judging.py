"""Verdicts on claims, which have parts with bars; one correction serves all claims of a page.

    judge([Claim("SGIM-D halves Random's error", [at_most(0.5, found.ratio, "sgim-d", "random")])])
A part clears its bar only if its whole interval does. A claim of several parts holds if each part holds, which needs
no correction. It fails if one part fails at a confidence corrected for the number of parts. Else the claim is open.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache, partial
from typing import Final, NamedTuple

from evidence import Level, NotRun, Statistic
from sgimd_torch.views.statistics import LEVEL, holm, show

HOLDS: Final = "holds"
FAILS: Final = "fails"
OPEN: Final = "open"
MISSING: Final = "not run"


class Part(NamedTuple):
    """A number with a bar.

    Args:
        measured: function of a confidence ``level`` that returns the number with its interval.
        bar: upper bound of the number; lower bound if ``least`` is true.
        least: true if the claim says that the number is at least the bar.
        margin: length of the interval that may lie beyond the bar if the part holds.
        name: name of the part, if a claim has several parts.
        form: format of the number.
    """

    measured: Statistic
    bar: float
    least: bool = False
    margin: float = 0.0
    name: str = ""
    form: str = ".2f"

    @property
    def above(self) -> float:
        """The distance from the bar to the number, positive if the number is on the wrong side."""
        return _above(self, None)[0]

    def holds(self, level: float) -> bool:
        """Whether the number clears the bar, and its interval clears the bar except for the margin."""
        return self.above <= 0 and _above(self, level)[2] <= self.margin

    def fails(self, level: float) -> bool:
        """Whether the whole interval is on the wrong side."""
        return self.above > 0 and _above(self, level)[1] > 0


class Claim(NamedTuple):
    """A claim: ``text`` has its schedules and bar, all ``parts`` must hold, ``note`` is a sentence on the result."""

    text: str
    parts: Sequence[Part]
    note: str = ""


class Verdict(NamedTuple):
    """A verdict; ``number`` belongs to the worst part, farthest on the wrong side, and has a 95 % interval."""

    claim: str
    number: str
    verdict: str


def judge(claims: Sequence[Claim]) -> list[Verdict]:
    """Verdicts on claims, corrected together by Holm's method: the chance that any of them is wrong is 5 % at most.

    Intervals of few seeds are too narrow. If n paired differences all have one sign, their bootstrap interval excludes
    0 at any level. By chance alone they all have one sign with probability 2^(1 - n).

    Raises:
        ValueError: errors have no ratio, for example because they are 0.
    """
    run = {number: claim for number, claim in enumerate(claims) if _was_run(claim)}
    standing = holm(run, lambda number, level: _verdict(run[number], level) != OPEN)
    return [
        Verdict(claim.text, _number(claim), _verdict(claim, LEVEL) if number in standing else OPEN)
        if number in run
        else Verdict(claim.text, "", MISSING)
        for number, claim in enumerate(claims)
    ]


def at_most(
    bar: float, statistic: Statistic, *of: object, margin: float = 0.0, name: str = "", form: str = ".2f"
) -> Part:
    """A part: ``statistic(*of)`` is at most the bar."""
    return Part(partial(statistic, *of), bar, False, margin, name, form)


def at_least(
    bar: float, statistic: Statistic, *of: object, margin: float = 0.0, name: str = "", form: str = ".2f"
) -> Part:
    """A part: ``statistic(*of)`` is at least the bar."""
    return Part(partial(statistic, *of), bar, True, margin, name, form)


@cache
def _above(part: Part, level: Level) -> tuple[float, float, float]:
    """The number of a part and its interval, as distances from the bar; a distance above 0 is on the wrong side."""
    value, low, high = (each - part.bar for each in part.measured(level=level))
    return (-value, -high, -low) if part.least else (value, low, high)


def _verdict(claim: Claim, level: float) -> str:
    # The worst part comes first, so that a claim of many parts that does not hold costs few intervals.
    worst = sorted(claim.parts, key=lambda part: -part.above)
    if all(part.holds(level) for part in worst):
        return HOLDS
    return FAILS if any(part.fails(1 - (1 - level) / len(worst)) for part in worst) else OPEN


def _number(claim: Claim) -> str:
    part = max(claim.parts, key=lambda part: part.above / max(abs(part.bar), 1e-3))
    return show(part.measured(), part.form).replace("-", "−") + (f" ({part.name})" if part.name else "")


def _was_run(claim: Claim) -> bool:
    try:
        for part in claim.parts:
            part.measured(level=None)
    except NotRun:
        return False
    return True
