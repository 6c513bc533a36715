"""The controls of the page: four numbered steps, what the learner does meanwhile, and a key for every action.

    panel = Panel(server, leading, act, joints); panel.say_lesson(lesson); panel.say_state(state)
``act(name, client)`` is called with the name of an action of ``ACTIONS`` and the viewer who wants it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
import viser

from sgimd_torch.demonstrations.leading import Leading
from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.views.teach.chart import Chart
from sgimd_torch.views.teach.drawing import MAPS, curve, legend, status
from sgimd_torch.views.teach.state import State
from sgimd_torch.views.teach.trial import Trial

Act = Callable[[str, viser.ClientHandle], None]


class Action(NamedTuple):
    """A button: what it says, its picture, the key that does the same, and its colour."""

    label: str
    icon: Any
    key: Any
    colour: Any = None


ICON: Final = viser.Icon
# The browser moves the camera with W, A, S, D, Q, E and the arrows.
ACTIONS: Final = {
    "record": Action("Record", ICON.PLAYER_RECORD, "R", "red"),
    "home": Action("Arm back to its start", ICON.HOME, "H", "gray"),
    "play": Action("Play it back", ICON.PLAYER_PLAY, "P", "gray"),
    "show": Action("Show it to the learner", ICON.SCHOOL, "T", "green"),
    "save": Action("Save it to a file", ICON.DEVICE_FLOPPY, "F", "gray"),
    "discard": Action("Throw it away", ICON.TRASH, "X", "gray"),
    "undo": Action("Take back the last lesson", ICON.ARROW_BACK_UP, "U", "gray"),
    "alone": Action("Let it go on alone", ICON.WALK, "G", "gray"),
    "pause": Action("Pause the learner", ICON.PLAYER_PAUSE, "space", "blue"),
    "map": Action("Next map", ICON.MAP, "M", "gray"),
    "seat": Action("Let someone else teach", ICON.USERS, "L", "gray"),
}
SPEEDS: Final = {"½ x": 0.5, "1 x": 1.0, "4 x": 4.0, "max": 0.0}
STEPS: Final = (
    "1 · Lead the arm",
    "2 · Look at what you recorded",
    "3 · Teach it",
    "4 · Try what it has learnt",
)
LEAD: Final = "Press **Record**, **drag the orange ball** (or any part of the arm) as if you threw, press **Stop**."
MORE: Final = ("Play", "Save", "Throw away")
REMARKS: Final = 3  # that are shown
LOOK: Final = "Nothing recorded yet."
CLICK: Final = "**Click anywhere on the map**: the learner does its best to land there."


class Panel:
    """What viewers see beside the scene; all of them see the same."""

    def __init__(self, server: viser.ViserServer, leading: Leading, act: Act, joints: Callable[[Any], None]) -> None:
        self._server, self._act = server, act
        self.buttons: dict[str, Any] = {}
        gui = server.gui
        gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="medium", brand_color=(34, 110, 160)
        )
        gui.set_panel_label("Teach it by hand")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(350)
        self.who = gui.add_markdown("", visible=False)
        with gui.add_folder(STEPS[0]):
            gui.add_markdown(LEAD)
            self._button("record")
            self._button("home")
            with gui.add_folder("Joints one by one", expand_by_default=False):
                self.joints = self._sliders(leading, joints)
        with gui.add_folder(STEPS[1]):
            self.lesson = gui.add_markdown(LOOK)
            self.start = gui.add_slider("From (s)", 0.0, 1.0, 0.01, 0.0, visible=False)
            self.end = gui.add_slider("To (s)", 0.0, 1.0, 0.01, 1.0, visible=False)
            self.more = gui.add_button_group("", MORE, visible=False)
            for name in ("play", "save", "discard"):
                self._command(name)
        with gui.add_folder(STEPS[2]):
            self._button("show")
            self._button("alone")
            self.effect = gui.add_markdown("It answers at once, and the map shows what changed.")
            self._button("undo")
        with gui.add_folder(STEPS[3]):
            self.trial = gui.add_markdown(CLICK)
        self._learner()
        self.buttons["alone"].visible = False
        for name in ("show", "undo"):
            self.buttons[name].disabled = True

    def _learner(self) -> None:
        gui = self._server.gui
        panel = gui.add_panel()
        with panel.add_tab("The learner"):
            self.status = gui.add_html("")
            self._button("pause")
            self.speed = gui.add_button_group("Speed", tuple(SPEEDS))
            self.maps = gui.add_dropdown("Map shows", MAPS, initial_value=MAPS[0], hint="key M")
            self.legend = gui.add_html(legend(MAPS[0]))
            self.curve = gui.add_html(curve((), []))
            self.wait = gui.add_checkbox("Wait for me when it asks", True)
            self._button("seat")
            with gui.add_folder("Keys", expand_by_default=False):
                gui.add_markdown("\n".join(f"- **{each.key}** {each.label}" for each in ACTIONS.values()))
        panel.dock_left()
        panel.set_width(300)

    def _button(self, name: str) -> None:
        action = ACTIONS[name]
        button = self._server.gui.add_button(
            action.label, icon=action.icon, color=action.colour, hint=f"key {action.key}"
        )
        self.buttons[name] = button
        self._command(name)

        @button.on_click
        async def _(event: Any) -> None:
            self._act(name, event.client)

    def _command(self, name: str) -> None:
        """The key that does the same, as long as the button can be pressed."""
        action = ACTIONS[name]
        command = self._server.gui.add_command(action.label, hotkey=action.key, icon=action.icon)

        @command.on_trigger
        async def _(event: Any) -> None:
            button = self.buttons.get(name)
            if button is None or (button.visible and not button.disabled):
                self._act(name, event.client)

    def _sliders(self, leading: Leading, moved: Callable[[Any], None]) -> list[Any]:
        sliders = []
        for name, low, high, start in zip(
            leading.joints, leading.ranges.low, leading.ranges.high, leading.start, strict=True
        ):
            slider = self._server.gui.add_slider(name, float(low), float(high), 0.01, float(start))

            @slider.on_update
            async def _(event: Any) -> None:
                if event.client is not None:
                    moved(event.client)

            sliders.append(slider)
        return sliders

    def say_recording(self, recording: bool) -> None:
        """The button that begins a recording ends it."""
        button = self.buttons["record"]
        button.label, button.icon = ("Stop", ICON.PLAYER_STOP) if recording else ("Record", ICON.PLAYER_RECORD)

    def say_lesson(self, lesson: HandLesson | None, problem: str = "") -> None:
        """What was recorded, or why it is no lesson."""
        for handle in (self.start, self.end, self.more):
            handle.visible = lesson is not None or bool(problem)
        self.buttons["show"].disabled = lesson is None
        if lesson is None:
            self.lesson.content = f"**This is no lesson:** {problem}" if problem else LOOK
            return
        lands = ", ".join(f"{x:.2f}" for x in lesson.demonstration.outcome)
        lines = [f"It lands at **({lands}) m**, the orange ring."]
        if np.isfinite(lesson.misfit):
            lines.append(f"The robot plays it within **{lesson.misfit:.3f} rad** of what you did.")
        remarks = list(lesson.remarks[:REMARKS]) or ["everything could be followed"]
        if len(lesson.remarks) > REMARKS:
            remarks[-1] += f" (and {len(lesson.remarks) - REMARKS} more)"
        self.lesson.content = " ".join(lines) + "\n\n" + "\n".join(f"- {remark}" for remark in remarks)

    def say_effect(self, before: Chart, after: Chart) -> None:
        """What a lesson changed."""
        more = int(after.met.sum() - before.met.sum())
        self.effect.content = (
            f"**Taught.** Predicted error {before.mean_error:.3f} → **{after.mean_error:.3f} m**, "
            f"{more:+d} goals within reach. The map shows where it changed."
        )

    def set_trim(self, duration: float) -> None:
        """Both sliders at the ends of a new recording."""
        for slider, value in ((self.start, 0.0), (self.end, duration)):
            slider.max = max(duration, 0.02)
            put(slider, value)

    def say_trial(self, trial: Trial) -> None:
        """How a trial went."""
        x = ", ".join(f"{x:.2f}" for x in trial.goal)
        expected = float(np.linalg.norm(trial.expected - trial.goal))
        self.trial.content = (
            f"{CLICK}\n\nGoal ({x}) m, the pink ring: **missed by {trial.missed:.2f} m** (blue ring); "
            f"it expected to miss by {expected:.2f} m (white ring)."
        )

    def say_state(self, state: State, cannot: str) -> None:
        """How the session stands."""
        self.buttons["pause"].label = "Let the learner go on" if state.paused else ACTIONS["pause"].label
        self.buttons["pause"].icon = ICON.PLAYER_PLAY if state.paused else ICON.PLAYER_PAUSE
        self.buttons["undo"].disabled = not state.lessons
        self.buttons["alone"].visible = state.waiting
        self.status.content = status(state, cannot)

    def say_curve(self, state: State, lessons: list[int]) -> None:
        """The error over movements, with the lessons on it."""
        self.curve.content = curve(state.curve, lessons)

    def say_map(self, which: str) -> None:
        """The colours of the map that is shown."""
        self.legend.content = legend(which)


def put(control: Any, value: object) -> None:
    """Set the value of a control; its type says that it cannot be set, but it can."""
    control.value = value
