"""Figures as files, all in one style and one resolution; equal data give equal files.

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
    "text.parse_math": False,  # names of a user are no formulas
    "axes.titlesize": 13,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 2,
    "legend.fontsize": 10.5,
    "svg.hashsalt": "sgimd_torch",  # without a fixed salt, ids in an svg are random
}


def save_figure(draw: Callable[[], Figure], stem: Path, *kinds: str) -> list[Path]:
    """Draw a figure in ``STYLE`` and write a file for each kind, whole or not at all.

    Args:
        draw: function that makes the figure.
        stem: path of the files without their suffix.
        kinds: suffixes, such as "png".

    Returns:
        The files.

    Raises:
        OSError: a file cannot be written.
    """
    files = {stem.with_name(f"{stem.name}.{kind}"): kind for kind in kinds}
    with rc_context(STYLE):
        figure = draw()
        for path, kind in files.items():
            content = io.BytesIO()
            figure.savefig(content, format=kind, dpi=DPI, metadata={"Date": None} if kind == "svg" else {})
            write_bytes(path, content.getvalue())
    return list(files)
