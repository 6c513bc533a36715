"""What plays on the page by itself: the learner's movements, its trials, and its best try at a goal that it asks for.

    stage = Stage(session, scene, panel, outline); stage.try_goal(goal); stage.play(now, watched=True)
A trial comes first. If movements come faster than they can be played, only the newest one is.
"""

from __future__ import annotations

from concurrent.futures import Future
from typing import Final

from sgimd_torch.environments.protocol import Recorded
from sgimd_torch.spaces import Array
from sgimd_torch.views.teach.panel import SPEEDS, Panel
from sgimd_torch.views.teach.playing import Outline, Playing
from sgimd_torch.views.teach.scene import Scene
from sgimd_torch.views.teach.session import Session
from sgimd_torch.views.teach.trial import Trial

MOVEMENT: Final = 2.0  # s, from one movement of the learner to the next in real time
FASTEST: Final = 4.0  # times as fast as they are, movements of a learner that goes as fast as it can


class Stage:
    """Plays one movement after the other."""

    def __init__(self, session: Session, scene: Scene, panel: Panel, outline: Outline) -> None:
        self._session, self._scene, self._panel, self._outline = session, scene, panel, outline
        self._trial: Future[Trial] | None = None
        self._wanted: Future[Recorded | None] | None = None
        self._played: Playing | None = None
        self._best: Playing | None = None
        self._last = -1  # index of the last movement that was played
        self.set_speed("1 x")

    def set_speed(self, word: str) -> None:
        """One of ``SPEEDS``; the learner moves as often as its movements can be played."""
        self._speed = SPEEDS[word] or FASTEST
        self._session.interval = MOVEMENT / SPEEDS[word] if SPEEDS[word] else 0.0

    def try_goal(self, goal: Array) -> None:
        """Have the learner try a goal, unless it is trying one already."""
        if self._trial is None:
            self._trial = self._session.try_goal(goal)

    def show_best(self, best: Recorded | None, now: float) -> None:
        """Play the best try at a goal that it asks for, again and again; None ends that."""
        self._best = None if best is None else Playing(best, now)
        self._scene.draw_best(None)

    def play(self, now: float, *, watched: bool) -> None:
        """The picture of ``now`` (s); without viewers no movement is fetched."""
        if self._trial is not None and self._trial.done():
            trial, self._trial = self._trial, None
            self._tried(trial, now)
        if self._played is not None:
            self._scene.draw_ghost(*self._outline.at(self._played.recorded, self._played.seconds(now)))
            if self._played.over(now):
                self._played = None
        elif self._wanted is not None and self._wanted.done():
            wanted, self._wanted = self._wanted, None
            recorded = None if wanted.exception() else wanted.result()
            self._played = None if recorded is None else Playing(recorded, now, self._speed)
        elif self._wanted is None and watched:
            latest = self._session.state.latest[-1:]
            if latest and latest[0].index != self._last:
                self._last = latest[0].index
                self._wanted = self._session.recorded(latest[0])
        if self._best is not None:
            self._scene.draw_best(self._outline.at(self._best.recorded, self._best.seconds(now))[0])
            if self._best.over(now):
                self._best = Playing(self._best.recorded, now)

    def _tried(self, done: Future[Trial], now: float) -> None:
        if done.exception() is not None:
            self._panel.trial.content = f"**No trial:** {done.exception()}"
            return
        trial = done.result()
        self._panel.say_trial(trial)
        for name, place in (("goal", trial.goal), ("expected", trial.expected), ("landed", trial.outcome)):
            self._scene.mark(name, place, f"missed by {trial.missed:.2f} m" if name == "landed" else "")
        self._played = None if trial.recorded is None else Playing(trial.recorded, now)
