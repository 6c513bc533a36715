"""A notebook as a page: its text, its code and what the code printed and drew, as stored in the file.

    text = as_page(Path("docs/notebooks/first_learner.ipynb"), pictures=folder)
Nothing is executed here. Cells keep the outputs of their last run; the tests execute the notebooks.
"""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any


def as_page(notebook: Path, pictures: Path) -> str:
    """Markdown; what was drawn is written into the folder ``pictures``, where the page will lie."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    parts: list[str] = []
    for number, cell in enumerate(cells):
        source = "".join(cell["source"]).strip()
        if cell["cell_type"] == "markdown":
            parts.append(source)
        elif cell["cell_type"] == "code" and source:
            parts.append(f"```python\n{source}\n```")
            for k, output in enumerate(cell["outputs"]):
                parts.append(_output(output, pictures / f"{notebook.stem}-{number}-{k}.png"))
    return "\n\n".join(filter(None, parts)) + "\n"


def _output(output: dict[str, Any], picture: Path) -> str:
    data = output.get("data", {})
    if "image/png" in data:
        picture.parent.mkdir(parents=True, exist_ok=True)
        picture.write_bytes(base64.b64decode("".join(data["image/png"])))
        return f"![What this cell drew]({picture.name})"
    text = "".join(output.get("text", data.get("text/plain", []))).rstrip()
    return f"```text\n{text}\n```" if text else ""
