"""The pages of results: made of rows and templates alone, every row for a page, what is missing named."""

import re
from itertools import count
from pathlib import Path
from shutil import copytree, ignore_patterns

import pytest

import claims
import refinement
from claims import PAGES, README, TEMPLATES, filled, main
from evidence import LAST, Evidence
from made_up import row, write, write_rows
from page_tables import Page
from refinement import TABLE
from runs import ROOT
from sgimd_torch.runs.program import command
from table import LEARNING
from variants import VARIANTS

SHIPPED = ROOT / "results"
ROBOT = "planar-arm-7 by process"
CONSTANTS = {  # of the method, and of what no rows are kept of
    *("95 %", "50 %", "30 %", "2 %", ".25", ".05", ".95", "1.1"),
    *("1.6", ".01"),  # seconds of refining, noise of the arms of OTHERS
    *("3.11", "10.1007"),  # of Python, of the paper's doi
}


class Reading(Evidence):
    """Notes whose errors are read."""

    read: set[tuple[str, str]] = set()  # noqa: RUF012

    def at(self, name, movements=LAST, column="error"):
        variant, _, answer = name.partition(" by ")
        self.read.add((variant, answer or "process"))
        return super().at(name, movements, column)

    def curve(self, name):
        self.read.add((name, "process"))
        return super().curve(name)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The pages of the shipped rows."""
    out = tmp_path_factory.mktemp("pages")
    copytree(SHIPPED, out / "results", ignore=ignore_patterns("*.md"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "Evidence", Reading)
        patch.chdir(out)
        assert command(main, []) == 0
    return out


@pytest.mark.parametrize("name", PAGES)
def test_the_shipped_pages_are_what_the_shipped_rows_and_templates_make(made, name):
    """Change a template or the rows in results/, then run experiments/claims.py."""
    page = "README.md" if name == README else f"results/{name}.md"
    assert (made / page).read_text(encoding="utf-8") == (ROOT / page).read_text(encoding="utf-8")


def test_every_variant_is_on_a_page(made):
    assert {*VARIANTS} <= {variant for variant, _ in Reading.read}


@pytest.mark.parametrize("name", PAGES)
def test_no_number_is_written_by_hand_into_the_text_of_a_template(name):
    text = (TEMPLATES / f"{name}.md.j2").read_text(encoding="utf-8")
    text = re.sub(r"\{\{.*?\}\}|`[^`]*`|\]\([^)]*\)|eqs?\. \([^)]*\)", "", text)
    lines = [line for line in text.splitlines() if not line.startswith("|")]
    by_hand = {found for line in lines for found in re.findall(r"\d*\.\d+|\d+ mm|\d+ %", line)}
    assert by_hand <= CONSTANTS


def test_rows_of_ones_own_make_pages_and_leave_the_readme_alone(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_rows(Path("mine"))
    assert command(main, ["--results", "mine"]) == 0
    assert "| **holds** |" in Path("mine/CURIOSITY.md").read_text()
    said = capsys.readouterr()
    assert "mine/CURIOSITY.md\n" in said.out
    assert re.search("CURIOSITY: not run: .*; sgim-d-letter-large at 5000", said.err)
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


def test_a_folder_that_is_not_there_is_named_and_not_made(tmp_path, capsys):
    assert command(main, ["--results", str(tmp_path / "mien")]) == 2
    assert "mien; name one in which compare.py" in capsys.readouterr().err
    assert not [*tmp_path.iterdir()]


def test_a_page_names_the_groups_whose_rows_are_not_all_of_this_learning(tmp_path):
    write_rows(tmp_path)
    rows = [row("random", seed, 5000, "process", 0.1, learning="older" if seed else LEARNING) for seed in range(4)]
    rows.append(row("sgim-d-letter", 0, 5000, "process", 0.1, learning="older"))
    page = Page(Evidence.of(write(tmp_path, rows)), tmp_path)
    said = "**`paper`, `letter`: made by an earlier version, wholly or in part.**"
    assert page.older("paper", "letter", "large", "robots") == said
    page = Page(Evidence.of(write(tmp_path, rows[:1])), tmp_path)
    assert page.older("paper") == ""


@pytest.mark.usefixtures("few_draws")
def test_what_was_not_run_is_left_out_of_a_table_and_named(tmp_path):
    found = Evidence.of(write_rows(tmp_path, without=["practice-interest"]))
    text, page = filled("LEARNING", found, tmp_path)
    assert "| ... and goals within reach: `practice` | 0.0" in text
    assert "... but with goals by interest |" not in text
    assert "practice-interest at 1000" in page.missing


def test_the_page_of_searches_has_errors_over_those_of_the_simplex_and_the_cost_of_each(tmp_path):
    rows = [
        (ROBOT, seed, search, 200, ms * 0.2, error, made, 0.4, 2 * error)
        for search, ms, made, error in (("nelder-mead", 2, 200, 0.1), ("gradient", 8.04, 50, 0.05))
        for seed in (1000, 1001)
    ]
    write(write_rows(tmp_path), rows, TABLE)
    text, page = filled("FORWARD_MODEL", Evidence.of(tmp_path), tmp_path)
    usual = f"| {ROBOT} | `nelder-mead` | 0.1 | 2.0 | 200 | 0.2 |"
    assert f"{usual}\n|  | `gradient` | 0.50 | 8.0 | 50 | 0.50 |\n" in text
    assert "gradient on rod by paper" in page.missing


def test_searches_side_by_side_have_the_lives_that_each_has_alone(monkeypatch):
    monkeypatch.setattr(refinement, "WARM", 1)
    ticks = count()  # every movement takes as long, so equal time is equal movements
    rows = refinement.life(ROBOT, 3, movements=200, clock=lambda: next(ticks))
    alone = refinement.TimedLife({**refinement.ROBOTS[ROBOT], "search": "gradient", "seed": 3}, 200, lambda: 0)
    for _ in range(200):
        alone.move()
    assert rows["gradient"] == (200, 200, alone.now()[2], 199, 199, rows["gradient"][-1])
    assert [row[:2] for row in rows.values()] == [(200, 200)] * 2
    assert [row[3:5] for row in rows.values()] == [(200, 200), (199, 199)]
    assert len({row[2] for row in rows.values()}) == 2
