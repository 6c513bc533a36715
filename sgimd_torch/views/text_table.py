"""Tables on stdout, for all commands: as text, as csv, or for LaTeX.

print_table([("variant", "error (m)"), ("sgim-d", "0.123"), ("random", "0.456")])    # the first row is the head
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from typing import Final

from sgimd_torch.runs.signals import printable

_LATEX: Final = {
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}


def print_table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of equal length in aligned columns, two spaces apart.

    Each row is flushed, so that a reader such as ``head``, which closes the pipe, causes its error here.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print(printable(line.rstrip()), flush=True)


def print_csv(rows: Iterable[Sequence[str]]) -> None:
    """Print rows with commas between their cells."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([printable(cell) for cell in row] for row in rows)
    print(text.getvalue(), end="", flush=True)


def print_latex(rows: Sequence[Sequence[str]]) -> None:
    """Print rows as a ``tabular`` of LaTeX, which needs no package; numbers are aligned to the right."""
    head, *lines = [" & ".join(map(_in_latex, row)) + r" \\" for row in rows]
    print(rf"\begin{{tabular}}{{l{'r' * (len(rows[0]) - 1)}}}", r"\hline", head, r"\hline", *lines, sep="\n")
    print(r"\hline", r"\end{tabular}", sep="\n", flush=True)


def _in_latex(cell: str) -> str:
    """The text of a cell in LaTeX; a minus before a digit is set as one."""
    text = "".join(_LATEX.get(sign, sign) for sign in printable(cell).replace("\n", " "))
    return re.sub(r"(?<![\w.])-(?=\d)", "$-$", text)
