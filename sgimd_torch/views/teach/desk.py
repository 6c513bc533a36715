"""The teacher's desk: the recording at hand, from the first posture to the lesson that the learner is shown.

    desk.record(); ...; desk.record(); desk.trim(); desk.show()
What was recorded is kept on disk until it is shown or thrown away, so that a killed page loses nothing but a drag.
"""

from __future__ import annotations

import time
from concurrent.futures import Future
from itertools import count
from typing import Any, Final

import numpy as np

from sgimd_torch.demonstrations import save_demonstrations
from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.demonstrations.recording import Recording
from sgimd_torch.files import make_folder
from sgimd_torch.spaces import Array
from sgimd_torch.teachers.by_hand import FOLDER
from sgimd_torch.views.teach.panel import Panel
from sgimd_torch.views.teach.scene import Grip, Scene
from sgimd_torch.views.teach.session import Session

DRAFT: Final = "draft.npz"  # in the folder of the lessons: what was recorded and not shown yet
PAUSE: Final = 0.25  # s after the last change of the trim, before it is looked at


class Desk:
    """Leading, recording, trimming, and what becomes of it."""

    def __init__(self, session: Session, leading: Leading, panel: Panel, scene: Scene) -> None:
        self._session, self._leading, self._panel, self._scene = session, leading, panel, scene
        self.offset = np.zeros(3)
        """``(3,)`` m, from where the mouse is to where the arm is held."""
        self.by_joints = False
        """Whether the joints are moved one by one, and not by a hand on the arm."""
        self.lesson: HandLesson | None = None
        self._recording: Recording | None = None
        self._judged: Future[HandLesson] | None = None
        self._look_at = np.inf
        self._played: tuple[Recording, float] | None = None
        self._draft = session.run.directory.path / FOLDER / DRAFT
        if self._draft.exists():
            self._take(Recording.load(self._draft))

    @property
    def trimmed(self) -> Recording | None:
        """What the sliders leave of the recording."""
        if self._recording is None:
            return None
        return self._recording.trim(self._panel.start.value, self._panel.end.value)

    def grab(self, grip: Grip, point: Array) -> None:
        """Take hold of the hand, or of another part of the arm where ``point`` ``(3,)`` m touches it.

        Raises:
            ValueError: it cannot be led.
        """
        self.stop_playing()
        self._leading.grab(grip.body, None if grip.is_hand else point)
        self.offset = self._leading.point - point

    def set_joints(self, q: Array) -> None:
        """The joints go to ``q`` ``(n_joints,)`` rad."""
        self.stop_playing()
        self._leading.set_joints(self._leading.ranges.clip(q))
        self.by_joints = True

    def home(self) -> None:
        """The arm goes back to where movements start: at once, or smoothly during a recording."""
        self.stop_playing()
        if self._leading.recording:
            self._leading.set_joints(self._leading.start)
        else:
            self._leading.home()

    def record(self) -> None:
        """Begin a recording, or end the one under way."""
        self.stop_playing()
        if not self._leading.recording:
            self._leading.record()
        else:
            recording = self._leading.stop().without_pauses()
            recording.save(self._folder() / DRAFT)
            self._take(recording)
        self._panel.say_recording(self._leading.recording)

    def trim(self) -> None:
        """The sliders were moved; what is left is looked at when they rest."""
        self._look_at = time.monotonic() + PAUSE
        self.lesson = None

    def look_again(self) -> None:
        """Have the lesson made anew if something changed, and show it when it is there."""
        if self._judged is not None and self._judged.done():
            judged, self._judged = self._judged, None
            if judged.exception() is None:
                self._say(judged.result())
            else:
                self._say(None, str(judged.exception()))
        if time.monotonic() >= self._look_at and self._judged is None:
            self._look_at = np.inf
            try:
                trimmed = self.trimmed
            except ValueError as error:
                self._say(None, str(error))
                return
            if trimmed is not None:
                self._judged = self._session.lesson_of(trimmed)

    def play(self) -> None:
        """The arm does again what was recorded."""
        if self._leading.recording:
            raise ValueError("a recording is under way; stop it first")
        trimmed = self.trimmed
        if trimmed is not None:
            self._leading.release()
            self._played = trimmed, time.monotonic()

    def stop_playing(self) -> None:
        """The arm is the teacher's again."""
        self._played, self.by_joints = None, False

    def posture(self, now: float) -> Array:
        """``(n_joints,)`` rad, of the arm as it is to be drawn."""
        if self._played is None:
            return self._leading.q
        recording, begun = self._played
        seconds = now - begun
        if seconds > recording.duration + 0.5:
            self._played = None
            return self._leading.q
        return np.array([np.interp(seconds, recording.times, column) for column in recording.joints.T])

    def show(self) -> Future[None]:
        """Show the lesson to the learner; done when it has answered.

        Raises:
            ValueError: there is none.
        """
        if self.lesson is None:
            raise ValueError("there is no lesson to show yet; record one first")
        self._panel.buttons["show"].disabled = True
        return self._session.show(self.lesson.demonstration)

    def save(self, client: Any) -> None:
        """Write the lesson to a file in the run directory, and hand it to the browser."""
        if self.lesson is None:
            raise ValueError("there is no lesson to save yet; record one first")
        folder = self._folder()
        path = next(place for n in count() if not (place := folder / f"saved-{n}.npz").exists())
        save_demonstrations(path, [self.lesson.demonstration])
        client.send_file_download(path.name, path.read_bytes())
        client.add_notification("Saved", f"{path}; load_demonstrations reads it", auto_close_seconds=8.0)

    def discard(self) -> None:
        """Throw the recording away."""
        self._draft.unlink(missing_ok=True)
        self._recording = None
        self._look_at = np.inf
        self._judged = None
        self._say(None)
        self._scene.draw_trace(None)

    def _take(self, recording: Recording) -> None:
        self._recording = recording
        self._panel.set_trim(recording.duration)
        self._look_at = 0.0

    def _say(self, lesson: HandLesson | None, problem: str = "") -> None:
        self.lesson = lesson
        self._panel.say_lesson(lesson, problem)
        self._scene.mark("lesson", None if lesson is None else lesson.demonstration.outcome, "your throw lands here")

    def _folder(self) -> Any:
        folder = self._session.run.directory.path / FOLDER
        make_folder(folder)
        return folder
