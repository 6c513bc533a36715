"""Figures as files, all in one style and one resolution; equal data give equal files.

save_figure(lambda: errors(data), Path("results/figures/errors.svg"))
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from matplotlib import style
from matplotlib.figure import Figure

from sgimd_torch.files import write_bytes

DPI: Final = 150
STYLE: Final[Any] = {
    "font.size": 12,
    "text.parse_math": False,  # names of a user are no formulas
    "axes.titlesize": 13,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 2,
    "legend.fontsize": 10.5,
    "svg.hashsalt": "sgimd_torch",  # without a fixed salt, ids in an svg are random
}


def save_figure(draw: Callable[[], Figure], path: Path) -> None:
    """Draw a figure in ``STYLE`` and write it to a file, whole or not at all; its suffix is png or svg.

    Raises:
        OSError: the file cannot be written.
    """
    kind, content = path.suffix[1:], io.BytesIO()
    with style.context(STYLE, after_reset=True):
        draw().savefig(content, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else {})
    write_bytes(path, content.getvalue())
