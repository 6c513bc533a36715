"""Tables of text on stdout, for all commands.

print_table([("variant", "error (m)"), ("sgim-d", "0.123"), ("random", "0.456")])    # the first row is the head
"""

from __future__ import annotations

from collections.abc import Sequence

from sgimd_torch.runs.process import printable


def print_table(rows: Sequence[Sequence[str]]) -> None:
    """Print rows of equal length in aligned columns, two spaces apart.

    Each row is flushed, so that a reader such as ``head``, which closes the pipe, causes its error here.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        print(printable(line.rstrip()), flush=True)
