"""Build the documentation into site/ with zensical: the pages of the repository, and an API reference.

Pages keep their paths in the repository, so links work both on a code host and on the site; see `zensical.toml`.
"""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import sgimd_torch

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
COPIED = ("*.md", "LICENSE", "CITATION.cff", "docs/**/*", "results/**/*", "sgimd_torch/**/*.md", "sgimd_torch/**/*.xml")
CHANGES = {  # patterns in a page for code hosts, and their replacements for zensical
    r"\]\(((?:\.\./)*)(sgimd_torch/[\w/]+)\.py\)": r"](\1api/\2.md)",  # a source file has an API page
    r"\.ipynb\)": r".md)",
    r"^```(\w+) ([\w./-]+)$": r'```\1 title="\2"',
    r"^```math\n([^`]+)\n```$": r"$$\n\1\n$$",
    r"\\tag\{": r"\\qquad\\tag{",
}


def copy_pages(to: Path) -> None:
    """Copy the pages, with all files that the pages link to."""
    for path in {path for pattern in COPIED for path in ROOT.glob(pattern) if path.is_file()}:
        place = to / path.relative_to(ROOT)
        place.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix in (".md", ".ipynb"):
            text = notebook(path) if path.suffix == ".ipynb" else path.read_text(encoding="utf-8")
            for pattern, replacement in CHANGES.items():
                text = re.sub(pattern, replacement, text, flags=re.MULTILINE)
            place.with_suffix(".md").write_text(text, encoding="utf-8")
        else:
            shutil.copyfile(path, place)


def notebook(path: Path) -> str:
    """A notebook as Markdown: its text, its code, and the outputs of its last run."""
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = "".join(cell["source"])
        parts.append(source if cell["cell_type"] == "markdown" else f"```python\n{source}\n```")
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if "image/png" in data:
                parts.append(f"![What this cell drew](data:image/png;base64,{''.join(data['image/png']).strip()})")
            else:
                parts.append(f"```text\n{''.join(output.get('text', data.get('text/plain', ()))).rstrip()}\n```")
    return "\n\n".join(parts)


def names() -> str:
    """A table of the names that the package offers, with the first sentence of each docstring."""
    rows = ["# What `from sgimd_torch import` offers", "", "| name | what it is |", "| --- | --- |"]
    for name in sorted({*dir(sgimd_torch)} - {"__version__"}, key=str.lower):
        thing = getattr(sgimd_torch, name)
        thing = getattr(thing, "func", thing)  # of which it is a partial application, in the same module
        first = " ".join(thing.__doc__.split()).partition(". ")[0].replace("[", r"\[")
        rows.append(f"| [`{name}`][{thing.__module__}.{name}] | {first} |")
    return "\n".join(rows)


def build(site: Path) -> int:
    """Make the site, in place of an earlier one; the exit code is not 0 if a page has a fault."""
    with TemporaryDirectory() as folder:
        shutil.copytree(HERE, folder, dirs_exist_ok=True)
        Path(folder, "sgimd_torch").symlink_to(ROOT / "sgimd_torch")
        copy_pages(Path(folder, "pages"))
        Path(folder, "pages/names.md").write_text(names(), encoding="utf-8")
        done = subprocess.run([sys.executable, "-m", "zensical", "build", "--strict"], cwd=folder)
        if done.returncode == 0:
            shutil.rmtree(site, ignore_errors=True)
            shutil.move(Path(folder, "site"), site)
        return done.returncode


if __name__ == "__main__":
    sys.exit(build(ROOT / "site"))
