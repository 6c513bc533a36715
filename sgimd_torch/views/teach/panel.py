"""The controls of the page: four numbered steps, what the learner does meanwhile, and a key for every action.

    panel = Panel(server, act); panel.say_lesson(lesson); panel.say_state(state, "")
``act(name, client)`` is called with the name of an action of ``ACTIONS`` and the viewer who wants it.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any, Final, NamedTuple

import numpy as np
import viser

from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.spaces import Array, Box
from sgimd_torch.views.teach.chart import CHANGE, SKILL, Chart, State
from sgimd_torch.views.teach.taught import Trial

Act = Callable[[str, viser.ClientHandle], None]


class Action(NamedTuple):
    """A button: what it says, its picture, the key that does the same, and its colour."""

    label: str
    icon: Any
    key: Any
    colour: Any = "gray"


ICON: Final = viser.Icon
# The browser moves the camera with W, A, S, D, Q, E and the arrows.
ACTIONS: Final = {
    "record": Action("Record", ICON.PLAYER_RECORD, "R", "red"),
    "home": Action("Arm back to its start", ICON.HOME, "H"),
    "discard": Action("Throw it away", ICON.TRASH, "X"),
    "show": Action("Show it to the learner", ICON.SCHOOL, "T", "green"),
    "alone": Action("Let it go on alone", ICON.WALK, "G"),
    "undo": Action("Take back the last lesson", ICON.ARROW_BACK_UP, "U"),
    "pause": Action("Pause the learner", ICON.PLAYER_PAUSE, "space", "blue"),
}
SPEEDS: Final = {"slowly": 2.0, "as fast as it can": 0.0}
"""s, from one movement of the learner to the next."""
MAPS: Final = ("error", "last lesson")
ENDS: Final = {"error": ("cannot", "can"), "last lesson": ("worse", "better")}
LEAD: Final = "Press **Record**, **drag the orange ball** (or any part of the arm) as if you threw, press **Stop**."
REMARKS: Final = 3  # that are shown
LOOK: Final = "Nothing recorded yet."
SEEN: Final = (
    "The ground is the task space, {0}: light where the learner can land, dark where it cannot yet. "
    "The orange ball is the hand of the robot; small dots are goals of the benchmark."
)
CLICK: Final = "**Click anywhere on the map**: the learner does its best to land there."
_STATUS: Final = (
    '<div style="padding:0 .6em;line-height:1.5"><b style="font-size:1.1em">{0}</b><br>{1} of {2} movements, {3}<br>'
    'predicted error <b>{4}</b><br>{5}</div><div style="color:#a33;padding:0 .6em">{6}</div>'
    '<div style="padding:0 .6em;font-size:.85em;line-height:1.5"><b style="color:#f0781e">●</b> you &nbsp; '
    '<b style="color:#3c46be">●</b> where the learner landed<br><b style="color:#0a6e32">●</b> goals within '
    'reach &nbsp; <b style="color:#788ca0">●</b> goals still too far</div>'
)
_LEGEND: Final = (
    '<div style="display:flex;gap:.5em;align-items:center;padding:0 .6em;font-size:.85em">{0}<div style="flex:1;'
    'height:.8em;border-radius:.3em;background:linear-gradient(90deg,{1})"></div>{2}</div>'
)


class Panel:
    """What viewers see beside the scene; all of them see the same."""

    def __init__(self, server: viser.ViserServer, act: Act, space: Box, *, asks: bool) -> None:
        self._server, self._act, self._space = server, act, space
        self.buttons: dict[str, Any] = {}
        gui = server.gui
        gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="medium", brand_color=(34, 110, 160)
        )
        gui.set_panel_label("Teach it by hand")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(350)
        gui.add_markdown(SEEN.format(" and ".join(space.axis(k) for k in range(min(2, space.dim)))))
        with gui.add_folder("1 · Lead the arm"):
            gui.add_markdown(LEAD)
            self._add_buttons("record", "home")
        with gui.add_folder("2 · Look at what you recorded"):
            self.lesson = gui.add_markdown(LOOK)
            self._add_buttons("discard")
        with gui.add_folder("3 · Teach it"):
            self._add_buttons("show", "alone")
            self.effect = gui.add_markdown("It answers at once, and the map shows what changed.")
            self._add_buttons("undo")
        with gui.add_folder("4 · Try what it has learnt"):
            self.trial = gui.add_markdown(CLICK)
        self._add_learner(asks)
        self.say_lesson(None)

    def _add_learner(self, asks: bool) -> None:
        gui = self._server.gui
        panel = gui.add_panel()
        with panel.add_tab("The learner"):
            self.status = gui.add_html("")
            self._add_buttons("pause")
            self.speed = gui.add_button_group("Speed", tuple(SPEEDS))
            self.maps: Any = gui.add_dropdown("Map shows", MAPS, initial_value=MAPS[0])
            self.legend = gui.add_html("")
            self.waits: Any = gui.add_checkbox("It waits for me when it asks", asks, visible=asks)
            with gui.add_folder("Keys", expand_by_default=False):
                gui.add_markdown("\n".join(f"- **{each.key}** {each.label}" for each in ACTIONS.values()))
        panel.dock_left()
        panel.set_width(300)

    def _add_buttons(self, *names: str) -> None:
        for name in names:
            self._add_button(name, ACTIONS[name])

    def _add_button(self, name: str, action: Action) -> None:
        """A button, and the key that does the same as long as it can be pressed."""
        gui: Any = self._server.gui
        button = gui.add_button(action.label, icon=action.icon, color=action.colour, hint=f"key {action.key}")
        self.buttons[name] = button
        command = gui.add_command(action.label, hotkey=action.key, icon=action.icon)

        @button.on_click  # type: ignore[untyped-decorator]
        @command.on_trigger  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            if button.visible and not button.disabled:
                self._act(name, event.client)

    def say_recording(self, recording: bool) -> None:
        """The button that begins a recording ends it; until then there is nothing to show."""
        button = self.buttons["record"]
        button.label, button.icon = ("Stop", ICON.PLAYER_STOP) if recording else ("Record", ICON.PLAYER_RECORD)

    def say_lesson(self, lesson: HandLesson | None, problem: str = "") -> None:
        """What was recorded, or why it is no lesson."""
        self.buttons["discard"].visible = lesson is not None or bool(problem)
        self.buttons["show"].disabled = lesson is None
        if lesson is None:
            self.lesson.content = f"**This is no lesson:** {problem}" if problem else LOOK
            return
        lines = [f"It lands at **{self._place(lesson.demonstration.outcome)}**, the orange ring."]
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
            f"**Taught.** Predicted error {before.mean_error:.3f} → **{self._space.amount(after.mean_error, '.3f')}**, "
            f"{more:+d} goals within reach. The map shows where it changed."
        )

    def say_trial(self, trial: Trial) -> None:
        """How a trial went."""
        missed = f"**missed by {self._space.amount(trial.missed, '.2f')}** (blue ring)"
        self.trial.content = f"{CLICK}\n\nGoal {self._place(trial.goal)}, the pink ring: {missed}."

    def say_state(self, state: State, cannot: str) -> None:
        """What it does and how well; ``cannot`` says why it cannot be taught."""
        self.buttons["pause"].label = "Let the learner go on" if state.paused else ACTIONS["pause"].label
        self.buttons["pause"].icon = ICON.PLAYER_PLAY if state.paused else ICON.PLAYER_PAUSE
        self.buttons["undo"].disabled = not state.lessons
        self.buttons["alone"].visible = state.waiting
        doing = state.busy or ("it asks you" if state.waiting else "paused" if state.paused else "it practises")
        if state.movements == state.total:
            doing = "it has made all its movements"
        lessons = f"{len(state.lessons)} lesson{'s' * (len(state.lessons) != 1)} by you"
        error, met = "–", ""
        if state.chart is not None:
            error = self._space.amount(state.chart.mean_error, ".3f")
            met = f"{int(state.chart.met.sum())} of {len(state.chart.met)} goals within reach"
        doing = escape(state.problem or doing)
        self.status.content = _STATUS.format(doing, state.movements, state.total, lessons, error, met, escape(cannot))

    def say_map(self, which: str) -> None:
        """The colours of the map that is shown."""
        colours, (low, high) = CHANGE if which == MAPS[1] else SKILL, ENDS[which]
        stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in colours)
        self.legend.content = _LEGEND.format(low, stops, high)

    def _place(self, outcome: Array) -> str:
        return f"({', '.join(f'{x:.2f}' for x in outcome)}) {self._space.unit}".rstrip()
