"""What is changed in a page on its way to the site, and the equations; building it all is in test_site.py."""

import re

import pytest
from equations import display, picture
from make_site import PACKAGE, ROOT, copy_pages, main, rooms


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


def test_a_link_to_a_source_file_leads_to_its_place_in_the_api(copied):
    before = (ROOT / "docs/explained/method.md").read_text(encoding="utf-8")
    after = (copied / "docs/explained/method.md").read_text(encoding="utf-8")
    assert "[regions.py](../../sgimd_torch/goals/regions.py)" in before
    assert "[regions.py](../../api/goals.md#sgimd_torch.goals.regions)" in after
    assert not re.search(r"\]\([^)]*\.py\)", after)


def test_a_block_that_is_saved_shows_its_name(copied):
    text = (copied / "docs/own-robot.md").read_text(encoding="utf-8")
    assert '```python title="thrower.py"\n' in text


def test_every_module_has_one_page_of_the_api_and_a_folder_shares_one():
    listed = [module for modules in rooms().values() for module in modules]
    assert len(listed) == len(set(listed)) == len(list((ROOT / PACKAGE).rglob("*.py")))
    assert rooms()["goals"][0] == "sgimd_torch.goals"
    assert "sgimd_torch.goals.regions" in rooms()["goals"]
    assert rooms()["spaces"] == ["sgimd_torch.spaces"]


def test_an_equation_is_drawn_once_for_light_and_dark_and_can_be_heard():
    drawn = picture(r"\theta_g < \tau")
    assert 'aria-label="\\theta_g &lt; \\tau"' in drawn
    assert "fill=" not in drawn  # the colour of the text, see site.css
    numbers = [float(each) for each in re.findall(r"-?\d+\.\d+", drawn.partition('d="')[2])]
    assert len(numbers) > 100
    assert max(map(abs, numbers)) < 200


def test_a_fraction_is_higher_than_its_parts_and_the_number_stands_beside_it():
    def height(text):
        return float(re.search(r"height:([\d.]+)em", text)[1])

    assert height(picture(r"\frac{a}{b}")) > 1.5 * height(picture("a"))
    assert '<span class="number">(7)</span>' in display("a = b \\tag{7}\n", "math", "", {}, None)


def test_an_equation_that_cannot_be_drawn_is_told():
    with pytest.raises(ValueError, match=r"\\nonsense"):
        picture(r"\nonsense{a}")


def test_something_else_in_the_place_of_the_site_is_left_alone(tmp_path, capsys):
    (tmp_path / "mine.txt").write_text("notes")
    assert main(["--out", str(tmp_path)]) == 2
    assert "move it away" in capsys.readouterr().err
    assert (tmp_path / "mine.txt").read_text() == "notes"
