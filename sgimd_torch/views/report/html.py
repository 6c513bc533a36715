"""Markup that cannot go wrong: a string is text and is escaped, only what ``tag`` has made is markup.

page = document("Runs", [tag("h1", "a < b"), table(["seed"], [["3"]])])    # everything in one file, nothing fetched
"""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

STYLE: Final = Path(__file__).with_name("style.css")
_EMPTY: Final = ("img", "link", "meta")


class Html(str):
    """Markup."""


def tag(name: str, /, *children: str, **attributes: str | bool | int) -> Html:
    """An element; an attribute that is a keyword of Python has a _ behind it, True stands alone, False is left out."""
    given = ((key.strip("_").replace("_", "-"), value) for key, value in attributes.items() if value is not False)
    words = [key if value is True else f'{key}="{_escaped(str(value))}"' for key, value in given]
    start = f"<{' '.join([name, *words])}>"
    return Html(start if name in _EMPTY else f"{start}{joined(children)}</{name}>")


def joined(children: Iterable[str]) -> Html:
    """One after the other."""
    return Html("".join(child if isinstance(child, Html) else _escaped(child) for child in children))


def table(head: Sequence[str], rows: Iterable[Sequence[str]], *, caption: str, notes: bool = False) -> Html:
    """A table that scrolls by itself where the page is narrow; the first cell of a row is its name.

    Args:
        head: of the columns.
        rows: as long as the head.
        caption: above it.
        notes: its cells are words, not numbers, and stand on the left.
    """
    body = [
        tag("tr", tag("th", row[0], scope="row"), *(cell if _is_cell(cell) else tag("td", cell) for cell in row[1:]))
        for row in rows
    ]
    whole = tag(
        "table",
        tag("thead", tag("tr", *(tag("th", name, scope="col") for name in head))),
        tag("tbody", *body),
        class_="notes" if notes else "numbers",
    )
    scroll = tag("div", whole, class_="scroll", tabindex=0, role="region", aria_label=caption)
    return joined([tag("p", caption, class_="soft"), scroll])


def picture(png: bytes, alt: str, caption: str, *, wide: bool = False) -> Html:
    """An image, kept in the page."""
    image = tag("img", src=data_uri("image/png", png), alt=alt)
    return tag("figure", image, tag("figcaption", caption), class_="wide" if wide else False)


def data_uri(kind: str, content: bytes) -> str:
    """A file as an address."""
    return f"data:{kind};base64,{b64encode(content).decode()}"


def details(summary: str, *children: str) -> Html:
    """What opens when asked for."""
    return tag("details", tag("summary", summary), *children)


def document(title: str, body: Iterable[str]) -> Html:
    """The whole page."""
    head = tag(
        "head",
        tag("meta", charset="utf-8"),
        tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
        tag("meta", name="color-scheme", content="light dark"),
        tag("title", title),
        tag("link", rel="icon", href="data:,"),  # else a browser asks for one
        tag("style", Html(STYLE.read_text(encoding="utf-8"))),
    )
    return Html(f"<!DOCTYPE html>\n{tag('html', head, tag('body', tag('main', *body)), lang='en')}\n")


def _is_cell(cell: str) -> bool:
    return isinstance(cell, Html) and cell.startswith("<td")


def _escaped(text: str) -> str:
    return html.escape(text.encode(errors="backslashreplace").decode())
