"""The tables of results: numbers kept exactly, no row twice, what makes no sense refused."""

from pathlib import Path

import pytest

from claims import main
from made_up import row, write
from sgimd_torch.runs.program import command
from table import FILE, LEARNING, TABLES, ResultsError, merge, read_table, write_table

SHIPPED = Path(__file__).parents[2] / "results"


@pytest.mark.parametrize("name", TABLES)
def test_a_shipped_table_read_and_written_again_keeps_every_byte(tmp_path, name):
    write_table(tmp_path, name, read_table(SHIPPED, name))
    assert (tmp_path / name).read_bytes() == (SHIPPED / name).read_bytes()


def test_a_row_made_again_takes_the_place_of_the_old_one_and_the_others_stay(tmp_path):
    rows = [row("grid", seed, 20, "linear", 0.1 + 0.2) for seed in (1, 0)]
    merge(tmp_path, FILE, rows)
    merge(tmp_path, FILE, [{**rows[0], "error": 0.5}])
    table = read_table(tmp_path)
    assert [*table.seed] == [0, 1]
    assert [*table.error] == [0.1 + 0.2, 0.5]
    assert table.floor.isna().all()


def test_rows_of_other_learning_give_way_to_the_first_new_row_of_their_variant_and_of_no_other(tmp_path):
    write(tmp_path, [row(name, seed, 20, "linear", 0.1, learning="older") for name in ("a", "b") for seed in (1, 2)])
    merge(tmp_path, FILE, [row("a", 7, 20, "linear", 0.3)])
    table = read_table(tmp_path)
    assert [*zip(table.variant, table.seed, table.learning, strict=True)] == [
        ("a", 7, LEARNING),
        ("b", 1, "older"),
        ("b", 2, "older"),
    ]


def test_without_a_file_a_table_is_empty_and_none_is_made(tmp_path):
    assert read_table(tmp_path).empty
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda text: text.replace("seed,movements", "movements,seed", 1), "must begin with variant,seed"),
        (lambda text: "", "must begin with variant,seed"),
        (lambda text: text.replace(",0,20,", ",0.5,20,"), "cannot be read"),
        (lambda text: text.replace("0.25", "much"), "cannot be read"),
        (lambda text: text.replace("0.25", ""), "line 2 makes no sense"),
        (lambda text: text.replace("0.25", "-1"), "line 2 makes no sense"),
        (lambda text: text.replace("0.25", "inf"), "line 2 makes no sense"),
        (lambda text: text + text.splitlines()[1] + "\n", "line 3 makes no sense"),
    ],
)
def test_a_table_that_makes_no_sense_is_refused_and_no_page_made(tmp_path, capsys, spoil, message):
    write(tmp_path, [row("grid", 0, 20, "linear", 0.25)])
    (tmp_path / FILE).write_text(spoil((tmp_path / FILE).read_text()))
    with pytest.raises(ResultsError, match=message):
        read_table(tmp_path)
    assert command(main, ["--results", str(tmp_path), "--out", str(tmp_path / "pages")]) == 2
    assert "Traceback" not in capsys.readouterr().err
    assert not (tmp_path / "pages").exists()
