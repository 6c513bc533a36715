"""A griffe extension, named in `zensical.toml`: in the API pages a name in backticks becomes a link to its meaning in
that module, and the lines of a module's docstring that show its use become code."""

import re
from typing import Any

import griffe


class Docstrings(griffe.Extension):  # type: ignore[misc]
    """Changes each docstring once a package is loaded."""

    def on_object(self, *, obj: griffe.Object, **more: Any) -> None:
        """Change the docstring of one object; griffe calls this method."""
        for name, member in [*obj.members.items()]:
            inner = isinstance(member, griffe.Attribute) and member.labels == {"instance-attribute"} and member.value
            if inner and not member.docstring:  # a constructor sets it for the methods only
                del obj.members[name]
        if obj.docstring:
            text = re.sub(r"(?:\B:\w+:)?(?<!`)`(\w+)`(?!`)", lambda found: link(obj, found[1]), obj.docstring.value)
            if obj.is_module:  # lines of use are indented, or stand behind a sentence and spaces
                text = re.sub(r"^(\S.*?\S) {3,4}(?=\S)", r"\1\n    ", text, flags=re.MULTILINE)
                text = re.sub(r"^(\S.*)\n(?=    )", r"\1\n\n", text, flags=re.MULTILINE)
            obj.docstring.value = text


def link(obj: griffe.Object, name: str) -> str:
    """A link to the public thing of the library that has this name in an object's scope, else the name alone."""
    try:
        place = obj.resolve(name)
    except griffe.NameResolutionError:
        place = ""
    return f"[`{name}`][{place}]" if re.fullmatch(r"sgimd_torch(\.[a-zA-Z]\w*)+", place) else f"`{name}`"
