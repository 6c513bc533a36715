"""The notebooks work from top to bottom, and what they show is what they made, in that order."""

import base64
import re
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.ipynb"))
SLOW = {"ablation"}  # twenty runs


def read(name):
    return nbformat.read(FOLDER / f"{name}.ipynb", as_version=4)


@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in NAMES])
def test_a_notebook_works_from_top_to_bottom(name, tmp_path):
    notebook = read(name)
    stored = [kinds(cell) for cell in codes(notebook)]
    # A cell that raises ends it with CellExecutionError.
    NotebookClient(notebook, timeout=900, kernel_name="python3", resources={"metadata": {"path": tmp_path}}).execute()
    assert [kinds(cell) for cell in codes(notebook)] == stored  # printed text and pictures in the same places


def codes(notebook):
    return [cell for cell in notebook.cells if cell.cell_type == "code"]


def kinds(cell):
    """What a cell has shown: "stdout", "stderr", or the kinds of data of a picture."""
    return {output.get("name") or ",".join(sorted(output.data)) for output in cell.outputs}


@pytest.mark.parametrize("name", NAMES)
def test_what_is_stored_is_of_one_run_of_all_cells_small_and_knows_nothing_of_the_machine(name):
    notebook, text = read(name), (FOLDER / f"{name}.ipynb").read_text(encoding="utf-8")
    nbformat.validate(notebook)
    assert {*notebook.metadata} == {"kernelspec", "language_info"}
    assert notebook.metadata.kernelspec.name == "python3"
    assert not any(word in text for word in ("/home/", "/root/", "/tmp/", "/Users/", "http://"))
    assert [cell.execution_count for cell in codes(notebook)] == list(range(1, len(codes(notebook)) + 1))
    outputs = [output for cell in codes(notebook) for output in cell.outputs]
    assert {output.output_type for output in outputs} <= {"stream", "display_data", "execute_result"}  # no error
    assert {output.name for output in outputs if output.output_type == "stream"} == {"stdout"}  # no warning
    pictures = [output.data["image/png"] for output in outputs if "image/png" in output.get("data", {})]
    assert 0 < max(len(base64.b64decode(picture)) for picture in pictures) < 100_000
    links = re.findall(r"\]\(([^)#]+)\)", "".join(cell.source for cell in notebook.cells))
    assert links
    assert not [link for link in links if not (FOLDER / link).exists()]


def test_there_are_the_two_that_the_pages_name():
    assert NAMES == ["ablation", "first_learner"]
