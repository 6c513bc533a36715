"""How a session stands: one record, replaced whole, so that any thread can read it at any time.

state = session.state; state.movements, state.chart.mean_error
"""

from __future__ import annotations

from dataclasses import dataclass

from sgimd_torch.environments.protocol import Recorded
from sgimd_torch.spaces import Array, Episode
from sgimd_torch.views.teach.chart import Chart


@dataclass(frozen=True, eq=False)
class State:
    """How it stands: after how many ``movements`` of ``total``, and ``lessons``.

    ``busy`` says what it does if it neither learns nor pauses; ``problem`` what ended it. ``asked`` ``(outcome_dim,)``
    is a goal that the learner would like to be shown, ``best`` the recorded movement by which it came nearest so far,
    and ``waiting`` whether it waits for an answer. ``latest`` are the last episodes. ``chart`` is the newest map,
    ``before`` that from before the last lesson, ``curve`` movements and mean predicted error (m) of all maps.
    """

    total: int
    movements: int = 0
    lessons: int = 0
    paused: bool = False
    busy: str = "starting"
    problem: str = ""
    asked: Array | None = None
    best: Recorded | None = None
    waiting: bool = False
    latest: tuple[Episode, ...] = ()
    chart: Chart | None = None
    before: Chart | None = None
    curve: tuple[tuple[int, float], ...] = ()
