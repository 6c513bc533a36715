"""Tables of the pages of results, in Markdown.

print(verdicts_table("claim", judge(PAPER_CLAIMS, results)))
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from judging import NotRun, Verdict
from read_results import ResultsError

Cell = Callable[[str], str]  # the text of a variant in a column of a table; raises NotRun if there is none


def variants_table(names: Sequence[str], columns: Mapping[str, Cell]) -> str:
    """One row for each variant, with a dash for what was not run."""

    def shown(cell: Cell, name: str) -> str:
        try:
            return cell(name)
        except NotRun:
            return "-"

    return markdown([*columns], [[shown(cell, name) for cell in columns.values()] for name in names])


def verdicts_table(what: str, verdicts: Sequence[Verdict]) -> str:
    """One row for each claim; ``what`` heads the first column."""
    cells = [(row.claim, row.bar, row.number, row.effect, _in_words(row)) for row in verdicts]
    return markdown((what, "bar", "our number [95 % interval]", "difference [95 % interval]", "verdict"), cells)


def said_table(said: Mapping[str, tuple[str, str]], verdicts: Sequence[Verdict]) -> str:
    """One row for each claim of an earlier version: what it said, and what is said now, bold where a verdict changed.

    Raises:
        ResultsError: a claim is not judged any more.
    """
    now = {row.claim: row for row in verdicts}
    if lost := said.keys() - now.keys():
        raise ResultsError(f"said.csv has {', '.join(sorted(lost))}, which is not judged any more; was it renamed?")
    cells = [
        (claim, number, verdict, now[claim].number, _bold(now[claim].verdict, now[claim].verdict != verdict))
        for claim, (number, verdict) in said.items()
    ]
    return markdown(("claim", "we said", "verdict then", "now we say", "verdict now"), cells)


def _bold(text: str, when: bool) -> str:
    return f"**{text}**" if when else text


def _in_words(row: Verdict) -> str:
    return f"**{row.verdict}**" + (f" (alone: {row.alone})" if row.alone != row.verdict else "")


def markdown(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table; "Not run." without rows."""
    if not rows:
        return "Not run."
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
