"""What the README and CONTRIBUTING show is run as it stands."""

import re
from pathlib import Path

import pytest

import sgimd_torch

ROOT = Path(__file__).parent.parent
BLOCK = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def blocks():
    for name in ("README.md", "CONTRIBUTING.md"):
        text = (ROOT / name).read_text(encoding="utf-8")
        for found in BLOCK.finditer(text):
            line = text.count("\n", 0, found.start(1)) + 1
            yield pytest.param(name, line, found[1], id=f"{name}:{line}")


@pytest.mark.parametrize(("name", "line", "code"), [*blocks()])
def test_a_python_block_runs_on_its_own(name, line, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec(compile("\n" * (line - 1) + code, ROOT / name, "exec"), {"__name__": "__main__"})
    assert not list(tmp_path.iterdir()), "an example leaves files behind"


def test_the_example_of_the_readme_is_short_enough_to_read():
    first = BLOCK.search((ROOT / "README.md").read_text(encoding="utf-8"))
    assert len([line for line in first[1].splitlines() if line.strip()]) <= 15
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120


@pytest.mark.parametrize(
    "name",
    [
        "README.md",
        "CONTRIBUTING.md",
        "CHANGELOG.md",
        "docs/clusters.md",
        "docs/runs.md",
        "experiments/README.md",
        "sgimd_torch/data/README.md",
    ],
)
def test_files_that_a_page_names_exist(name):
    page = ROOT / name
    text = page.read_text(encoding="utf-8")
    links = [link for link in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in link]
    paths = re.findall(r"`((?:experiments|scripts|tests|sgimd_torch)/[\w./-]+)`", text)
    missing = [link for link in links if not (page.parent / link).exists()]
    missing += [path for path in paths if not (ROOT / path).exists()]
    assert not missing


def test_the_version_to_cite_is_that_of_the_package():
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {sgimd_torch.__version__}\n" in cited
