"""What is changed in a page on its way to the site; building all of it is in test_site.py."""

import re

import pytest
from make_site import ROOT, copy_pages, notebook


@pytest.fixture(scope="module")
def copied(tmp_path_factory):
    place = tmp_path_factory.mktemp("pages")
    copy_pages(place)
    return place


def test_pages_lie_as_in_the_repository_with_the_files_that_they_link_to(copied):
    for name in (
        "README.md",
        "docs/own-robot.md",
        "results/RESULTS.md",
        "results/results.csv",
        "results/figures/learning.svg",
        "LICENSE",
    ):
        assert (copied / name).is_file(), name


def test_a_link_to_a_source_file_leads_to_its_api_page(copied):
    before = (ROOT / "docs/explained/method.md").read_text(encoding="utf-8")
    after = (copied / "docs/explained/method.md").read_text(encoding="utf-8")
    assert "[regions.py](../../sgimd_torch/goals/regions.py)" in before
    assert "[regions.py](../../api/sgimd_torch/goals/regions.md)" in after
    assert not re.search(r"\]\([^)]*\.py\)", after)


def test_a_block_that_is_saved_shows_its_name(copied):
    text = (copied / "docs/own-robot.md").read_text(encoding="utf-8")
    assert '```python title="thrower.py"\n' in text


def test_a_notebook_shows_its_code_and_what_it_printed_and_drew():
    page = notebook(ROOT / "docs/notebooks/first_learner.ipynb")
    assert page.startswith("# ")
    assert "```python\nimport" in page
    assert "```text\n" in page
    assert "](data:image/png;base64,iVBOR" in page
