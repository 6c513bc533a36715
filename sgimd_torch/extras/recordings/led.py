"""A movement that somebody leads: it is recorded until the arm has moved and is still.

times, postures = led(read, clock, rate=50.0)
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from sgimd_torch.spaces import Array

LED: Final = 0.02  # rad, least way of an arm that is led
STILL: Final = 1.0  # s after which an arm that was led and does not move has been led to the end


def led(read: Callable[[], Array], clock: Any, rate: float) -> tuple[Array, Array]:
    """Times ``(n,)`` (s) from 0, and postures ``(n, n_joints)`` (rad) that ``read`` gives ``rate`` times a second."""
    times, postures, moves, begun = list[float](), list[Array](), list[int](), clock.monotonic()
    before: Array | float = np.inf
    while len(moves) < 2 or times[-1] - times[moves[-1]] < STILL:
        times.append(clock.monotonic() - begun)
        postures.append(read())
        if np.abs(postures[-1] - before).max() > LED:  # the first one, too
            moves.append(len(times) - 1)
            before = postures[-1]
        clock.sleep(max(0.0, begun + len(times) / rate - clock.monotonic()))
    moving = slice(moves[1] - 1, moves[-1] + 1)
    return np.subtract(times[moving], times[moving.start]), np.array(postures[moving])
