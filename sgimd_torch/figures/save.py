"""Figures as files: one style, one resolution, written whole or not at all, and the same data give the same file.

save_figure(lambda: errors(data), Path("results/figures/errors"), "png", "svg")    # errors.png and errors.svg
"""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from matplotlib import rc_context
from matplotlib.figure import Figure

from sgimd_torch.files import write_bytes

DPI: Final = 150
STYLE: Final[Any] = {
    "font.size": 12,
    "axes.titlesize": 13,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 2,
    "legend.fontsize": 10.5,
    "svg.hashsalt": "sgimd_torch",  # else names inside an svg are random
}


def save_figure(draw: Callable[[], Figure], stem: Path, *kinds: str) -> list[Path]:
    """Draw a figure in our style and write it as ``stem`` for each of the ``kinds`` of file, such as "png".

    Returns:
        The files.

    Raises:
        OSError: one cannot be written.
    """
    files = {stem.with_name(f"{stem.name}.{kind}"): kind for kind in kinds}
    with rc_context(STYLE):
        figure = draw()
        for path, kind in files.items():
            content = io.BytesIO()
            figure.savefig(content, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else {})
            write_bytes(path, content.getvalue())
    return list(files)
