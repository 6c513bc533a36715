"""Helpers for tests of reports: a parser of pages, and figures of pages."""

import html
import re
from html.parser import HTMLParser

from markupsafe import escape
from matplotlib.figure import Figure


class Page(HTMLParser):
    """The elements of a page with their attributes, and its texts by element; fails if an element is not closed."""

    def __init__(self, text):
        super().__init__()
        self.open, self.elements, self.texts = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, name, attributes):
        self.elements.append((name, dict(attributes)))
        if name == "table":
            assert self.elements[-2][1]["class"] == "scroll"
        if name not in ("meta", "link", "img"):
            self.open.append(name)

    def handle_endtag(self, name):
        assert self.open.pop() == name

    def handle_data(self, text):
        self.texts.append((self.open[-1] if self.open else "", text))

    def all(self, name):
        return [text for element, text in self.texts if element == name]


def rows_of(text, caption):
    """Rows of cells, the head first, of the first table whose caption begins with ``caption``."""
    table = text[text.index(f'<p class="soft">{escape(caption)}') :]
    table = table[table.index("<tr>") : table.index("</tbody>")]
    cells = [re.findall("<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in table.split("</tr>")[:-1]]
    return [[html.unescape(re.sub("<[^>]*>", "", cell)) for cell in row] for row in cells]


def alts(text):
    """The words for each image of a page."""
    return [given["alt"] for name, given in Page(text).elements if name == "img"]


def drawn(draw, *args):
    """The figure that a function of a page draws."""
    draw.__wrapped__(figure := Figure(), *args)
    return figure
