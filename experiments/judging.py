"""Verdicts on claims: a claim has parts, and each part is a number with a bar, the bound that the number must keep.

    judge([Claim("SGIM-D halves Random's error", [at_most(0.5, found.ratio, "sgim-d", "random")])])
A part holds if its whole interval is on the right side of the bar. A claim holds if all its parts hold; this needs no
correction for their number. A claim fails if one part fails at a level corrected for the number of parts. All other
claims are open. Verdicts on several claims, such as all claims of a page, are corrected jointly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import cache, partial
from typing import Final, NamedTuple

from evidence import Level, NotRun, Statistic
from sgimd_torch.extras.table.statistics import LEVEL, interval_text

HOLDS: Final = "holds"
FAILS: Final = "fails"
OPEN: Final = "open"
MISSING: Final = "not run"


class Part(NamedTuple):
    """A number with a bar.

    Args:
        measured: function of a confidence ``level`` that returns the number with its interval.
        bar: upper bound of the number; lower bound if ``least`` is true.
        least: whether the bar is a lower bound.
        margin: distance beyond the bar that the interval may reach although the part holds.
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
        """The distance from the bar to the number, positive on the wrong side of the bar."""
        return _above(self, None)[0]

    def holds(self, level: float) -> bool:
        """Whether number and interval are on the right side of the bar, the interval except for the margin."""
        return self.above <= 0 and _above(self, level)[2] <= self.margin

    def fails(self, level: float) -> bool:
        """Whether the whole interval is on the wrong side of the bar."""
        return self.above > 0 and _above(self, level)[1] > 0


class Claim(NamedTuple):
    """A claim: ``text`` with the bar, ``parts`` that must all hold, and ``note``, a sentence on the result."""

    text: str
    parts: Sequence[Part]
    note: str = ""


class Verdict(NamedTuple):
    """A verdict; ``number`` is that of the part whose interval (95 %) ends farthest on the wrong side of its bar."""

    claim: str
    number: str
    verdict: str


def judge(claims: Sequence[Claim]) -> list[Verdict]:
    """Verdicts on claims, corrected jointly by Holm's method: the probability of any wrong verdict is at most 5 %.

    With few seeds, bootstrap intervals are too narrow. If n paired differences have equal signs, their interval
    excludes 0 at any level, although n signs are equal by chance with probability 2^(1 - n).

    Raises:
        ValueError: a number cannot be computed, for example a ratio of errors that are 0.
    """
    run = {number: claim for number, claim in enumerate(claims) if _was_run(claim)}
    standing = holm(run, lambda number, level: _verdict(run[number], level) != OPEN)
    return [
        Verdict(claim.text, _number(claim), _verdict(claim, LEVEL) if number in standing else OPEN)
        if number in run
        else Verdict(claim.text, "", MISSING)
        for number, claim in enumerate(claims)
    ]


def holm(claims: Iterable[int], rejects: Callable[[int, float], bool]) -> set[int]:
    """The claims that are accepted jointly: the probability that any accepted claim is wrong is at most 5 %.

    Holm's method (1979) with intervals: all claims are tested at Bonferroni's level for their number. Accepted claims
    are set aside, and the remaining claims are tested again at the level for their own number.

    Args:
        claims: numbers of all claims that were considered, also those without a chance.
        rejects: function of a claim's number and a confidence level; true if the interval at this level decides the
            claim.
    """
    left = list(dict.fromkeys(claims))
    standing: set[int] = set()
    while left:
        level = 1 - (1 - LEVEL) / len(left)
        decided = {claim for claim in left if rejects(claim, level)}
        if not decided:
            break
        standing |= decided
        left = [claim for claim in left if claim not in decided]
    return standing


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
    """Number, low and high end of a part, as distances from its bar; a distance above 0 is on the wrong side."""
    value, low, high = (end - part.bar for end in part.measured(level=level))
    return (-value, -high, -low) if part.least else (value, low, high)


def _verdict(claim: Claim, level: float) -> str:
    # The worst part comes first: if it does not hold, the intervals of the other parts need not be computed.
    worst = sorted(claim.parts, key=lambda part: -part.above)
    if all(part.holds(level) for part in worst):
        return HOLDS
    return FAILS if any(part.fails(1 - (1 - level) / len(worst)) for part in worst) else OPEN


def _number(claim: Claim) -> str:
    part = max(claim.parts, key=lambda part: _above(part, LEVEL)[2] / max(abs(part.bar), 1e-3))
    return interval_text(part.measured(), part.form).replace("-", "−") + (f" ({part.name})" if part.name else "")


def _was_run(claim: Claim) -> bool:
    try:
        for part in claim.parts:
            part.measured(level=None)
    except NotRun:
        return False
    return True
