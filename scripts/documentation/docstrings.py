"""Docstrings of the library as Markdown: what mkdocstrings reads before it makes the API pages.

A griffe extension, named in `zensical.toml`. The docstrings stay as they are in an editor; here `Tiling` and
:class:`Tiling` become links if the library has one thing of that name, and lines that are indented are shown as code.
"""

from __future__ import annotations

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr):(`[^`]+`)")
NAME = re.compile(r"(?<!`)`([A-Za-z_][\w.]*)`(?!`)")
LISTED = re.compile(r"\](?=\[)")  # [context][policy] is a list of words, which Markdown takes for a link


class Docstrings(griffe.Extension):  # type: ignore[misc]
    """Changes every docstring of a package once it is loaded."""

    def on_package(self, *, pkg: griffe.Module, **more: Any) -> None:
        """Called by griffe."""
        self.places: dict[str, list[str]] = {}
        for each in self._objects(pkg):
            each.members = {name: member for name, member in each.members.items() if not self._is_inner(member)}
        objects = list(self._objects(pkg))
        for each in objects:
            self.places.setdefault(each.name, []).append(each.path)
            self.places.setdefault(each.path, []).append(each.path)
        for each in objects:
            if each.docstring is not None:
                each.docstring.value = self._markdown(each.docstring.value, of_module=each.is_module)

    def _is_inner(self, member: Any) -> bool:
        """Whether it is only what a constructor keeps: not declared as a field, and without a docstring."""
        return (
            isinstance(member, griffe.Attribute)
            and member.labels == {"instance-attribute"}
            and member.value is not None
            and member.docstring is None
        )

    def _objects(self, owner: griffe.Object) -> Any:
        yield owner
        for member in owner.members.values():
            if isinstance(member, griffe.Object) and not member.name.startswith("_"):
                yield from self._objects(member)

    def _markdown(self, text: str, of_module: bool) -> str:
        text = NAME.sub(self._link, ROLE.sub(r"\1", LISTED.sub(r"]\\", text)))
        if not of_module:
            return text
        # A module shows its use at the end of a line, after some spaces, or in lines that are indented.
        text = re.sub(r"^(\S.*?\S) {3,4}(?=\S)", r"\1\n    ", text, flags=re.MULTILINE)
        return re.sub(r"^(\S.*)\n(?=    )", r"\1\n\n", text, flags=re.MULTILINE)

    def _link(self, found: re.Match[str]) -> str:
        places = self.places.get(found[1], [])
        return f"[`{found[1]}`][{places[0]}]" if len(places) == 1 else found[0]
