"""Small pictures in the panel, as HTML: how the learner stands, the colours of the map, the error over movements.

gui.add_html(status(state, "")); gui.add_html(legend("error")); gui.add_html(curve(state.curve, lessons=[30]))
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Final

from sgimd_torch.views.teach.chart import CHANGE, SKILL
from sgimd_torch.views.teach.state import State

MAPS: Final = ("error", "competence", "last lesson")
ENDS: Final = {"error": ("cannot", "can"), "competence": ("-1", "0"), "last lesson": ("worse", "better")}
WIDTH, HEIGHT, LEFT, BOTTOM, TOP = 270, 150, 34, 20, 8  # pixels, of the curve and around it
_STATUS: Final = (
    '<div style="padding:0 .6em;line-height:1.5"><b style="font-size:1.1em">{0}</b><br>{1} of {2} movements, {3}<br>'
    "predicted error <b>{4}</b><br>{5}</div>"
)
_KEY: Final = (
    '<div style="padding:0 .6em;font-size:.85em;line-height:1.5"><b style="color:#f0781e">●</b> you &nbsp; '
    '<b style="color:#3c46be">●</b> the learner, and where it landed<br><b style="color:#0a6e32">●</b> goals within '
    'reach &nbsp; <b style="color:#788ca0">●</b> goals still too far</div>'
)


def status(state: State, cannot: str) -> str:
    """What it does and how well, in four lines; ``cannot`` says why it cannot be taught."""
    doing = state.busy or ("it asks you" if state.waiting else "paused" if state.paused else "it practises")
    if state.movements == state.total:
        doing = "it has made all its movements"
    doing = state.problem or doing
    chart = state.chart
    error = "–" if chart is None else f"{chart.mean_error:.3f} m"
    met = "" if chart is None else f"{int(chart.met.sum())} of {len(chart.met)} goals within reach"
    lessons = f"{state.lessons} lesson{'s' * (state.lessons != 1)} by you"
    told = _STATUS.format(escape(doing), state.movements, state.total, lessons, error, met)
    return told + (f'<p style="color:#a33;padding:0 .6em">{escape(cannot)}</p>' if cannot else "") + _KEY


def legend(which: str) -> str:
    """The colours of one of ``MAPS``, from its one end to the other."""
    colours, (low, high) = CHANGE if which == MAPS[2] else SKILL, ENDS[which]
    stops = ",".join(f"rgb({r:.0f},{g:.0f},{b:.0f})" for r, g, b in colours)
    return (
        f'<div style="display:flex;gap:.5em;align-items:center;padding:0 .6em;font-size:.85em">{low}<div style="flex:1;'
        f'height:.8em;border-radius:.3em;background:linear-gradient(90deg,{stops})"></div>{high}</div>'
    )


def curve(points: Sequence[tuple[int, float]], lessons: Sequence[int]) -> str:
    """The predicted error (m) over movements, with a dot for each lesson."""
    points = points or [(0, 1.0)]
    last, most = max(1, points[-1][0]), max(error for _, error in points) or 1.0

    def x(movements: float) -> float:
        return LEFT + (WIDTH - LEFT - 6) * movements / last

    def y(error: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * error / most

    line = " ".join(f"{x(movements):.1f},{y(error):.1f}" for movements, error in points)
    dots = ""
    for lesson in lessons:
        error = next((error for movements, error in points if movements >= lesson), points[-1][1])
        dots += f'<circle cx="{x(lesson):.1f}" cy="{y(error):.1f}" r="4.5" fill="#f0781e"/>'
    grid = "".join(
        f'<line x1="{LEFT}" x2="{WIDTH}" y1="{y(value):.1f}" y2="{y(value):.1f}" stroke="#ddd"/>'
        f'<text x="{LEFT - 4}" y="{y(value) + 3:.1f}" text-anchor="end">{value:.2f}</text>'
        for value in (0.0, most / 2, most)
    )
    ends = "".join(
        f'<text x="{x(value):.1f}" y="{HEIGHT - 6}" text-anchor="{side}">{value}</text>'
        for value, side in ((0, "start"), (last, "end"))
    )
    return (
        f'<div style="padding:.2em .6em 0;font-size:.85em">Predicted error (m) over movements, '
        f'<b style="color:#f0781e">●</b> lessons</div><svg viewBox="0 0 {WIDTH} {HEIGHT}" width="100%" font-size="10" '
        f'fill="#555">{grid}{ends}<polyline points="{line}" fill="none" stroke="#3c46be" stroke-width="2"/>{dots}</svg>'
    )
