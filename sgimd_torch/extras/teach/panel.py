"""The controls of the page: three numbered steps, and the status of the learner.

    panel = Panel(server, act, space, 5000); panel.show_lesson(lesson); panel.show_status(status, running=True)
A button calls ``act(name, client)``: ``name`` is its key in ``ACTIONS``, ``client`` the viewer who pressed it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import viser

from sgimd_torch.extras.teach.chart import COLOURS, Chart
from sgimd_torch.extras.teach.lessons import HandLesson
from sgimd_torch.extras.teach.taught import Status
from sgimd_torch.spaces import Box

Act = Callable[[str, viser.ClientHandle], None]
ICON: Final = viser.Icon
RECORD, STOP = ("Record", ICON.PLAYER_RECORD), ("Stop", ICON.PLAYER_STOP)
RUN, PAUSE = ("Let the learner go on", ICON.PLAYER_PLAY), ("Pause the learner", ICON.PLAYER_PAUSE)
ACTIONS: Final[dict[str, tuple[str, Any, Any]]] = {
    "record": (*RECORD, "red"),
    "discard": ("Throw it away", ICON.TRASH, "gray"),
    "show": ("Show it to the learner", ICON.SCHOOL, "green"),
    "run": (*RUN, "blue"),
}
"""Label, icon and colour of each button."""
HOW_TO_LEAD: Final = (
    "Press **Record**, **drag the orange ball** (or any part of the arm), press **Stop**. "
    "The arm goes back to its start by itself."
)
NOTHING_RECORDED: Final = "Nothing recorded yet."
INTRODUCTION: Final = (
    "The coloured map is the task space, {0}: light where an outcome came near, dark where none did yet. "
    "The orange ball is the hand of the robot. Small dots are goals of the benchmark."
)
_STATUS: Final = (
    '<div style="padding:0 .6em;line-height:1.5"><b style="font-size:1.1em">{0}</b><br>{1} of {2} movements<br>'
    "{3} by hand<br>nearest outcome <b>{4}</b> from a goal<br>{5} of {6} goals within reach</div>"
    '<div style="padding:0 .6em;font-size:.85em;line-height:1.5"><b style="color:#f0781e">●</b> you &nbsp; '
    '<b style="color:#3c46be">●</b> latest outcomes<br><b style="color:#0a6e32">●</b> goals within '
    'reach &nbsp; <b style="color:#788ca0">●</b> goals still too far</div>'
)
_LEGEND: Final = (
    '<div style="display:flex;gap:.5em;align-items:center;padding:0 .6em;font-size:.85em">out of reach<div '
    'style="flex:1;height:.8em;border-radius:.3em;background:linear-gradient(90deg,{0})"></div>reached</div>'
)


class Panel:
    """The controls beside the scene; all viewers see the same controls.

    Args:
        server: web server of the page.
        act: function to call when a button is pressed.
        space: T.
        total: number of movements of the whole run.
    """

    def __init__(self, server: viser.ViserServer, act: Act, space: Box, total: int) -> None:
        self._gui: Any = server.gui
        self._act, self._space, self._total = act, space, total
        self.buttons: dict[str, Any] = {}
        gui = server.gui
        gui.configure_theme(
            show_logo=False, show_share_button=False, control_width="medium", brand_color=(34, 110, 160)
        )
        gui.set_panel_label("Teach it by hand")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(350)
        gui.add_markdown(INTRODUCTION.format(" and ".join(space.axis(k) for k in range(min(2, space.dim)))))
        with gui.add_folder("1 · Lead the arm"):
            gui.add_markdown(HOW_TO_LEAD)
            self._add_button("record")
        with gui.add_folder("2 · Look at what you recorded"):
            self.lesson = gui.add_markdown(NOTHING_RECORDED)
            self._add_button("discard")
        with gui.add_folder("3 · Teach it"):
            self._add_button("show")
            self.effect = gui.add_markdown("The learner imitates it at once.")
        panel = gui.add_panel()
        with panel.add_tab("The learner"):
            self.status = gui.add_html("")
            self._add_button("run")
            gui.add_html(_LEGEND.format(",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in COLOURS)))
        panel.dock_left()
        panel.set_width(300)
        self.show_lesson(None)

    def _add_button(self, name: str) -> None:
        label, icon, colour = ACTIONS[name]
        self.buttons[name] = button = self._gui.add_button(label, icon=icon, color=colour)

        @button.on_click  # type: ignore[untyped-decorator]
        async def _(event: Any) -> None:
            self._act(name, event.client)

    def show_recording(self, recording: bool) -> None:
        """Label the button that begins and ends a recording."""
        self.buttons["record"].label, self.buttons["record"].icon = STOP if recording else RECORD

    def show_lesson(self, lesson: HandLesson | None, problem: str = "") -> None:
        """Describe the lesson of a recording, or the ``problem`` that prevents a lesson."""
        self.buttons["discard"].visible = lesson is not None or bool(problem)
        self.buttons["show"].disabled = lesson is None
        if lesson is None:
            self.lesson.content = f"**This is no lesson:** {problem}" if problem else NOTHING_RECORDED
            return
        point = ", ".join(f"{x:.2f}" for x in lesson.demonstration.outcome)
        words = f"Its outcome is **({point}) {self._space.unit}**, the orange ring."
        if np.isfinite(lesson.misfit):
            words += f" The robot repeats your movement to **{lesson.misfit:.3f} rad** (root mean square)."
        remarks = lesson.remarks or ["the robot can follow everything"]
        self.lesson.content = "\n".join([words, "", *(f"- {remark}" for remark in remarks)])

    def show_effect(self, before: Chart, after: Chart) -> None:
        """Compare the map before and after a lesson."""
        more = int(after.reached.sum() - before.reached.sum())
        distance = self._space.amount(after.mean_distance, ".3f")
        self.effect.content = (
            f"**Taught.** From a goal to the nearest outcome: {before.mean_distance:.3f} → **{distance}**, "
            f"{more:+d} goals within reach."
        )

    def show_status(self, status: Status, running: bool) -> None:
        """Show what the learner does, and what it has reached."""
        self.buttons["run"].label, self.buttons["run"].icon = PAUSE if running else RUN
        activity = "replaying the record" if status.replaying else "learning by itself" if running else "paused"
        if status.movements >= self._total:
            activity = "all movements are made"
        distance, reached = self._space.amount(status.chart.mean_distance, ".3f"), status.chart.reached
        lessons = f"{status.lessons} lesson{'s' * (status.lessons != 1)}"
        self.status.content = _STATUS.format(
            activity, status.movements, self._total, lessons, distance, int(reached.sum()), len(reached)
        )
