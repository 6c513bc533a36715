"""A griffe extension for the API pages, named in `zensical.toml`.

A name in backticks becomes a link to what the name means in its module. Lines of a module's docstring that show how to
use the module become code."""

import re
from typing import Any

import griffe


class Docstrings(griffe.Extension):  # type: ignore[misc]
    """Extension that changes all docstrings after griffe has loaded a package."""

    def on_object(self, *, obj: griffe.Object, **more: Any) -> None:
        """Change the docstring of one object; griffe calls this method."""
        for name, member in [*obj.members.items()]:
            inner = isinstance(member, griffe.Attribute) and member.labels == {"instance-attribute"} and member.value
            if inner and not member.docstring:  # attributes that a constructor sets have no docstring
                del obj.members[name]
        if obj.docstring:
            text = re.sub(r"(?:\B:\w+:)?(?<!`)`(\w+)`(?!`)", lambda match: link(obj, match[1]), obj.docstring.value)
            if obj.is_module:  # code is indented, or follows a sentence and spaces
                text = re.sub(r"^(\S.*?\S) {3,4}(?=\S)", r"\1\n    ", text, flags=re.MULTILINE)
                text = re.sub(r"^(\S.*)\n(?=    )", r"\1\n\n", text, flags=re.MULTILINE)
            obj.docstring.value = text


def link(obj: griffe.Object, name: str) -> str:
    """A link to the public object that ``name`` means in the scope of ``obj``; without one, the name alone."""
    try:
        place = obj.resolve(name)
    except griffe.NameResolutionError:
        place = ""
    return f"[`{name}`][{place}]" if re.fullmatch(r"sgimd_torch(\.[a-zA-Z]\w*)+", place) else f"`{name}`"
