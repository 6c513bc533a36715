"""What outcomes tell of a robot: a dead sensor, a place that no movement moves, outcomes that are clipped, a wrong T.

`sgimd check` tells it of random movements, a run of its own; tables, reports and answers of the run repeat it.
    remarks_on(robot, outcomes)["equal"]    # "the last 50 outcomes are equal, ..."
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sgimd_torch.environments.protocol import Environment
from sgimd_torch.inverses.local_process import plausible
from sgimd_torch.spaces import ROUNDING, Array

LATEST: Final = 500  # number of latest outcomes that count
FEWEST: Final = 10  # number of outcomes from which on anything is told
EQUAL: Final = 50  # number of equal outcomes that are told after others
NOISY: Final = 1.5  # standard deviation of outcomes, as a multiple of their noise, up to which only noise moves them
MANY: Final = 0.2  # share of outcomes far outside T from which on they are no exceptions
CLIPPED: Final = 0.1  # share of outcomes on the border of T that is told
AN_END: Final = 0.1  # part of a side of T that counts as its end
AT_ENDS: Final = 0.03  # share of outcomes at each end from which on an outcome may wrap
NARROW: Final = 0.03  # share of the volume of T that outcomes span; less is told


def remarks_on(robot: Environment, outcomes: Array) -> dict[str, str]:
    """Sentences for the user, by kind.

    Args:
        robot: robot that has moved. Its ``noticed``, if it has one, is a sentence on what it noticed of its movements,
            such as episodes that end early, "" for nothing.
        outcomes: ``(n, outcome_dim)``, outcomes of its movements, in order; the latest 500 count.
    """
    space, outcomes = robot.outcomes, outcomes[-LATEST:]
    told = {"noticed": said} if (said := getattr(robot, "noticed", "")) else {}
    if (n := len(outcomes)) < FEWEST:
        return told
    differ = (outcomes != outcomes[-1]).any(axis=1)[::-1]
    equal = int(differ.argmax()) if differ.any() else n
    still = outcomes.std(axis=0) <= np.maximum(NOISY * robot.outcome_noise, ROUNDING * space.sides)
    if equal in range(EQUAL, n) or equal == n:
        what = f"the last {equal} outcomes are equal, {outcomes[-1].round(4).tolist()}"
        return told | {"equal": f"{what}: is a sensor dead, or does no movement move what is measured?"}
    if still.all():
        what = f"the last {n} outcomes differ by their noise alone, {space.amount(robot.outcome_noise)}"
        return told | {"still": f"{what}: does no movement move what is measured?"}
    if still.any():
        names = ", ".join(space.axis(k) for k in np.flatnonzero(still).tolist())
        told["flat"] = f"{names} changes by no more than noise in the last {n} outcomes; leave it out of T"
    least, greatest = plausible(outcomes, space)  # an outcome that counts in no answer, and lies a side of T away
    least, greatest = np.minimum(least, space.low - space.sides), np.maximum(greatest, space.high + space.sides)
    if 0 < (far := ((outcomes < least) | (outcomes > greatest)).any(axis=1)).mean() < MANY:
        what = f"{far.sum()} of the last {n} outcomes lie far outside T, such as {outcomes[far][-1].round(4).tolist()}"
        told["far"] = f"{what}, and count in no answer: is it an error code of a sensor?"
    border = ((outcomes == space.low) | (outcomes == space.high)) & (outcomes != robot.rest) & ~still
    if (clipped := border.any(axis=1).mean()) >= CLIPPED:
        told["clipped"] = (
            f"{clipped:.0%} of the last {n} outcomes lie on the border of T: a miss that is clipped teaches wrongly; "
            "let execute() fail there, or return where it ended"
        )
    low, high = outcomes.min(axis=0), outcomes.max(axis=0)
    ends = np.minimum(
        (outcomes < space.low + AN_END * space.sides).mean(axis=0),
        (outcomes > space.high - AN_END * space.sides).mean(axis=0),
    )
    turn = np.isclose(space.sides, 2 * np.pi, rtol=0.01) | np.isclose(space.sides, 360, rtol=0.01)
    if not space.periodic and (wraps := turn & (ends >= AT_ENDS)).any():
        names = ", ".join(space.axis(k) for k in np.flatnonzero(wraps).tolist())
        told["wraps"] = f"{names} spans a whole turn, up to both ends: if it wraps, say so by Box(..., periodic=...)"
    spans = " x ".join(f"[{a:.3g}, {b:.3g}]" for a, b in zip(low, high, strict=True))
    share = float(np.prod((high - low) / space.sides))
    if not space.contains(outcomes).any():
        told["outside"] = f"none of the last {n} outcomes lies in T; they span {spans}. Are both in the same unit?"
    elif share < NARROW and not still.any():
        told["narrow"] = (
            f"the last {n} outcomes span only {100 * share:.2g} % of T, {spans}; if no movement gets much farther, "
            "make T smaller, because learners draw goals from all of T"
        )
    return told
