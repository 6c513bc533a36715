"""The controls of the page: three numbered steps, and what the learner does meanwhile.

    panel = Panel(server, act, space, 5000, ""); panel.say_lesson(lesson); panel.say_standing(standing, practising=True)
``act(name, client)`` is called with the name of an action of ``ACTIONS`` and the viewer who wants it.
"""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import Any, Final

import numpy as np
import viser

from sgimd_torch.demonstrations.lessons import HandLesson
from sgimd_torch.spaces import Box
from sgimd_torch.views.teach.chart import SKILL, Chart
from sgimd_torch.views.teach.taught import Standing

Act = Callable[[str, viser.ClientHandle], None]
ICON: Final = viser.Icon
RECORD, STOP = ("Record", ICON.PLAYER_RECORD), ("Stop", ICON.PLAYER_STOP)
PRACTISE, PAUSE = ("Let the learner go on", ICON.PLAYER_PLAY), ("Pause the learner", ICON.PLAYER_PAUSE)
ACTIONS: Final[dict[str, tuple[str, Any, Any]]] = {
    "record": (*RECORD, "red"),
    "home": ("Arm back to its start", ICON.HOME, "gray"),
    "discard": ("Throw it away", ICON.TRASH, "gray"),
    "show": ("Show it to the learner", ICON.SCHOOL, "green"),
    "practise": (*PRACTISE, "blue"),
}
"""What a button says, its picture, and its colour."""
LEAD: Final = "Press **Record**, **drag the orange ball** (or any part of the arm) as if you threw, press **Stop**."
LOOK: Final = "Nothing recorded yet."
SEEN: Final = (
    "The ground is the task space, {0}: light where the learner can land, dark where it cannot yet. "
    "The orange ball is the hand of the robot; small dots are goals of the benchmark."
)
_STATUS: Final = (
    '<div style="padding:0 .6em;line-height:1.5"><b style="font-size:1.1em">{0}</b><br>{1} of {2} movements, '
    "{3} lessons by you<br>predicted error <b>{4}</b><br>{5} of {6} goals within reach</div>"
    '<div style="color:#a33;padding:0 .6em">{7}</div>'
    '<div style="padding:0 .6em;font-size:.85em;line-height:1.5"><b style="color:#f0781e">●</b> you &nbsp; '
    '<b style="color:#3c46be">●</b> where the learner landed<br><b style="color:#0a6e32">●</b> goals within '
    'reach &nbsp; <b style="color:#788ca0">●</b> goals still too far</div>'
)
_LEGEND: Final = (
    '<div style="display:flex;gap:.5em;align-items:center;padding:0 .6em;font-size:.85em">cannot<div style="flex:1;'
    'height:.8em;border-radius:.3em;background:linear-gradient(90deg,{0})"></div>can</div>'
)


class Panel:
    """What viewers see beside the scene; all of them see the same.

    Args:
        server: that shows it.
        act: does what a viewer wants.
        space: T.
        total: movements of the run.
        cannot: why the learner cannot be taught, "" if it can.
    """

    def __init__(self, server: viser.ViserServer, act: Act, space: Box, total: int, cannot: str) -> None:
        self._gui: Any = server.gui
        self._act, self._space, self._total, self._cannot = act, space, total, cannot
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
            self._add_buttons("show")
            self.effect = gui.add_markdown("It answers at once.")
        panel = gui.add_panel()
        with panel.add_tab("The learner"):
            self.status = gui.add_html("")
            self._add_buttons("practise")
            gui.add_html(_LEGEND.format(",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in SKILL)))
        panel.dock_left()
        panel.set_width(300)
        self.say_lesson(None)

    def _add_buttons(self, *names: str) -> None:
        for name in names:
            self._add_button(name, *ACTIONS[name])

    def _add_button(self, name: str, label: str, icon: Any, colour: Any) -> None:
        self.buttons[name] = button = self._gui.add_button(label, icon=icon, color=colour)

        @button.on_click  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            self._act(name, event.client)

    def say_recording(self, recording: bool) -> None:
        """The button that begins a recording ends it."""
        self.buttons["record"].label, self.buttons["record"].icon = STOP if recording else RECORD

    def say_lesson(self, lesson: HandLesson | None, problem: str = "") -> None:
        """What was recorded, or why it is no lesson."""
        self.buttons["discard"].visible = lesson is not None or bool(problem)
        self.buttons["show"].disabled = lesson is None
        if lesson is None:
            self.lesson.content = f"**This is no lesson:** {problem}" if problem else LOOK
            return
        place = ", ".join(f"{x:.2f}" for x in lesson.demonstration.outcome)
        words = f"It lands at **({place}) {self._space.unit}**, the orange ring."
        if np.isfinite(lesson.misfit):
            words += f" The robot plays it within **{lesson.misfit:.3f} rad** of what you did."
        remarks = lesson.remarks or ["everything could be followed"]
        self.lesson.content = "\n".join([words, "", *(f"- {remark}" for remark in remarks)])

    def say_effect(self, before: Chart, after: Chart) -> None:
        """What a lesson changed."""
        more = int(after.met.sum() - before.met.sum())
        self.effect.content = (
            f"**Taught.** Predicted error {before.mean_error:.3f} → **{self._space.amount(after.mean_error, '.3f')}**, "
            f"{more:+d} goals within reach."
        )

    def say_standing(self, now: Standing, practising: bool) -> None:
        """What the learner does, and how well."""
        self.buttons["practise"].label, self.buttons["practise"].icon = PAUSE if practising else PRACTISE
        doing = "replaying" if now.replaying else "it practises" if practising else "paused"
        if now.movements >= self._total:
            doing = "it has made all its movements"
        error, met = self._space.amount(now.chart.mean_error, ".3f"), now.chart.met
        counts = (now.movements, self._total, now.lessons, error, int(met.sum()), len(met))
        self.status.content = _STATUS.format(doing, *counts, escape(self._cannot))
