"""Pages of results: tables in markdown, each between two marker lines; the prose around them stays as it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from judgements import Row
from read_results import ResultsError
from sgimd_torch.runs.log import make_folder, write_whole


def markdown(head: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    """A table; one without lines says so."""
    if not lines:
        return "Not run.\n"
    rows = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in line] for line in lines)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def verdicts_table(what: str, rows: Sequence[Row]) -> str:
    """A table of what was judged; ``what`` heads its first column."""
    cells = [(row.claim, row.bar, row.number, f"**{row.verdict}**") for row in rows]
    return markdown((what, "bar", "our number [95 % interval]", "verdict"), cells)


def count_verdicts(rows: Sequence[Row]) -> str:
    """Such as "3 holds, 1 cannot say"."""
    verdicts = [row.verdict for row in rows]
    return ", ".join(f"{verdicts.count(verdict)} {verdict}" for verdict in dict.fromkeys(verdicts))


def read_page(path: Path, empty: str) -> str:
    """Its text, or that of an ``empty`` one if there is none yet.

    Raises:
        OSError: it cannot be read.
    """
    return path.read_text(encoding="utf-8") if path.exists() else empty


def write_page(path: Path, text: str, tables: Mapping[str, str]) -> None:
    """``text`` with each of the ``tables`` in the place of its name; all of it, or the page stays as it was.

    Raises:
        ResultsError: a place is not marked, or marked more than once.
        RunError, OSError: it cannot be written.
    """
    for name, table in tables.items():
        text = _between_markers(text, name, table, path)
    make_folder(path.parent)
    write_whole(path, text)


def _between_markers(text: str, name: str, table: str, path: Path) -> str:
    first, last = f"<!-- {name} -->\n", f"<!-- end of {name} -->"
    if text.count(first) != 1 or text.count(last) != 1 or text.index(first) > text.index(last):
        raise ResultsError(
            f"{path} must hold the line {first.strip()} and below it the line {last}, each once; "
            "mark where that table is to stand, or move the file away to get a new one"
        )
    before, after = text[: text.index(first) + len(first)], text[text.index(last) :]
    return f"{before}\n{table}\n{after}"
