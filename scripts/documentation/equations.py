r"""Equations of the documentation as pictures made when the site is built: no script and no font at reading time.

In a page, $J(\tau_g, \tau)$ in a line, or a block fenced as ```math, whose number is written \tag{7}. Code hosts show
both as equations, too. `zensical.toml` names this module as an extension of Markdown, and ``display`` for the fence.
"""

from __future__ import annotations

import html
import re
from typing import Any

from markdown import Markdown
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from matplotlib.font_manager import FontProperties
from matplotlib.mathtext import MathTextParser
from matplotlib.path import Path
from matplotlib.textpath import TextPath

# Opens before and closes after something that is not a space, so that prices and variables of a shell stay as they are.
INLINE = r"(?<![\\$\w])\$(?!\s)([^$\n]+?)(?<!\s)\$(?![\w$])"
TAG = re.compile(r"\s*\\tag\{(\w+)\}\s*$")
SIZE = 17  # points in which it is drawn
EM = 15  # of these points are the size of the text around it, whose letters are larger than those of this font
FONT = FontProperties(math_fontfamily="cm", size=SIZE)
COMMANDS = {Path.MOVETO: "M", Path.LINETO: "L", Path.CURVE3: "Q", Path.CURVE4: "C", Path.CLOSEPOLY: "Z"}


def picture(latex: str) -> str:
    """An equation as SVG, which takes the size and the colour of the text around it.

    Raises:
        ValueError: matplotlib does not know a command of it.
    """
    text = f"${' '.join(latex.split())}$"
    width, height, depth, *_ = MathTextParser("path").parse(text, dpi=72, prop=FONT)
    low, high = min(-depth, 0.0) - 1, height - depth + 1  # strokes are a little larger than their boxes
    drawn = []
    for points, code in TextPath((0, 0), text, prop=FONT).iter_segments(simplify=False):
        pairs = [] if code == Path.CLOSEPOLY else (points.reshape(-1, 2) * (1, -1)).tolist()  # SVG counts downwards
        drawn.append(COMMANDS[code] + " ".join(f"{x:.2f} {y:.2f}" for x, y in pairs))
    return (
        f'<svg class="equation" role="img" aria-label="{html.escape(latex, quote=True)}" '
        f'viewBox="-1 {-high:.1f} {width + 2:.1f} {high - low:.1f}" style="width:{(width + 2) / EM:.3f}em;'
        f'height:{(high - low) / EM:.3f}em;vertical-align:{low / EM:.3f}em"><path d="{"".join(drawn)}"/></svg>'
    )


def display(source: str, language: str, css_class: str, options: Any, md: Any, **more: Any) -> str:
    """A fenced equation, as superfences asks for it."""
    number = TAG.search(source)
    tag = f'<span class="number">({number[1]})</span>' if number else ""
    equation = TAG.sub("", source).replace(r"\frac", r"\dfrac")  # has the space for fractions of full size
    return f'<div class="display"><div>{picture(equation)}</div>{tag}</div>'


class _Inline(InlineProcessor):  # type: ignore[misc]
    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:
        return self.md.htmlStash.store(picture(m[1])), m.start(0), m.end(0)


class _Equations(Extension):  # type: ignore[misc]
    def extendMarkdown(self, md: Markdown) -> None:
        # After code in backticks, which has 190, and before backslashes, which have 180.
        md.inlinePatterns.register(_Inline(INLINE, md), "equation", 185)


def makeExtension(**options: Any) -> Extension:
    """Called by Markdown."""
    return _Equations(**options)
