"""The table of results: numbers kept exactly, no row twice, what makes no sense refused; and the pages made of it."""

import re
from pathlib import Path

import pytest
from quoted import TEMPLATES

from claims import PAGES, main
from made_up import row, write
from sgimd_torch.runs.process import command
from table import FILE, ResultsError, merge, read_table, write_table

SHIPPED = Path(__file__).parents[2] / "results"


@pytest.mark.parametrize("name", [FILE, "goals.csv", "rivals.csv"])
def test_a_shipped_table_read_and_written_again_keeps_every_byte(tmp_path, name):
    (tmp_path / "model").mkdir()
    write_table(tmp_path, name, read_table(SHIPPED, name))
    assert (tmp_path / name).read_bytes() == (SHIPPED / name).read_bytes()


def test_a_row_made_again_takes_the_place_of_the_old_one_and_the_others_stay(tmp_path):
    rows = [row("learners", "grid", seed, 20, "linear", 0.1 + 0.2) for seed in (1, 0)]
    merge(tmp_path, FILE, rows)
    merge(tmp_path, FILE, [{**rows[0], "error": 0.5}])
    table = read_table(tmp_path)
    assert [*table.seed] == [0, 1]
    assert [*table.error] == [0.1 + 0.2, 0.5]
    assert table.floor.isna().all()


def test_without_a_file_a_table_is_empty_and_none_is_made(tmp_path):
    assert read_table(tmp_path).empty
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: text.replace("variant,seed", "seed,variant", 1), "must begin with experiment,variant"),
        (lambda text: "", "must begin with experiment,variant"),
        (lambda text: text.replace(",0,20,", ",0.5,20,"), "cannot be read"),
        (lambda text: text.replace("0.25", "much"), "cannot be read"),
        (lambda text: text.replace("0.25", ""), "line 2 makes no sense"),
        (lambda text: text.replace("0.25", "-1"), "line 2 makes no sense"),
        (lambda text: text.replace("0.25", "inf"), "line 2 makes no sense"),
        (lambda text: text + text.splitlines()[1] + "\n", "line 3 makes no sense"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused_and_no_page_made(tmp_path, capsys, spoil, message):
    write(tmp_path, [row("learners", "grid", 0, 20, "linear", 0.25)])
    (tmp_path / FILE).write_text(spoil((tmp_path / FILE).read_text()))
    with pytest.raises(ResultsError, match=message):
        read_table(tmp_path)
    assert command(main, ["--results", str(tmp_path), "--out", str(tmp_path / "pages")]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "pages").exists()


def test_the_shipped_pages_are_what_the_shipped_rows_and_templates_make(tmp_path):
    """Change a template or the rows in results/, then run experiments/claims.py --readme README.md."""
    shipped = (SHIPPED.parent / "README.md").read_text(encoding="utf-8")
    readme = tmp_path / "README.md"
    readme.write_text(re.sub(r"\b0\.\d\d\d\b", "9.999", shipped), encoding="utf-8")
    assert command(main, ["--results", str(SHIPPED), "--out", str(tmp_path), "--readme", str(readme)]) == 0
    assert readme.read_text(encoding="utf-8") == shipped
    for name in PAGES:
        made, there = ((folder / f"{name}.md").read_text(encoding="utf-8") for folder in (tmp_path, SHIPPED))
        assert made == there


@pytest.mark.parametrize("name", [*PAGES, "README"])
def test_no_figure_is_written_by_hand_into_the_text_of_a_template(name):
    """Except in what no rows are kept of: the record of tuning, and the costs that a script measures."""
    text = (TEMPLATES / f"{name}.md.j2").read_text(encoding="utf-8").partition("## The record")[0]
    text = re.sub(r"\*\*What it costs\*\*.*?(?=\*\*The error)", "", text, flags=re.DOTALL)
    text = re.sub(r"\{\{.*?\}\}|`[^`]*`|\]\([^)]*\)|eqs?\. \([^)]*\)", "", text)
    lines = [line for line in text.splitlines() if not line.startswith("|")]
    by_hand = [found for line in lines for found in re.findall(r"\d*\.\d+|\d+ mm|\d+ %", line)]
    assert set(by_hand) <= {"95 %", "50 %", "80 %"}  # confidence, and what regions should hold


@pytest.mark.parametrize("name", PAGES)
def test_a_page_of_another_kind_is_left_alone(tmp_path, capsys, name):
    page = tmp_path / f"{name}.md"
    page.write_text("# My thesis\n")
    assert command(main, ["--results", str(SHIPPED), "--out", str(tmp_path)]) == 2
    assert f"{page} was not made by claims.py" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == [page.name]
