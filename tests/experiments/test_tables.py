"""Tables that results are appended to: no row twice, none lost, and nobody else's file harmed."""

import math

import pytest

from sgimd_torch.runs.log import RunError
from tables import Table, read_keys

COLUMNS = ("variant", "seed", "error_m")
KEY = ("variant", "seed")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "table.csv"


@pytest.fixture
def opened(path):
    """Opens the table; closes it afterwards, and before it is opened again."""
    tables = []

    def opened():
        while tables:
            tables.pop().close()
        tables.append(Table(path, COLUMNS, KEY))
        return tables[-1]

    yield opened
    while tables:
        tables.pop().close()


def test_numbers_read_back_exactly_and_what_was_not_measured_is_empty(opened, path):
    opened().append([["grid", 0, 0.1 + 0.2], ["grid", 1, math.nan]])
    assert path.read_text() == "variant,seed,error_m\ngrid,0,0.30000000000000004\ngrid,1,\n"


def test_a_row_that_is_there_is_not_written_twice(opened, path):
    opened().append([["grid", 0, 1.0], ["grid", 0, 1.0]])
    opened().append([["grid", 0, 1.0], ["grid", 1, 2.0]])  # found on disk by another writer
    assert path.read_text().splitlines()[1:] == ["grid,0,1.0", "grid,1,2.0"]


@pytest.mark.parametrize("torn", ["grid,1,0.2", "grid", "\0\0\0"])
def test_a_torn_last_line_is_dropped_and_written_again(opened, path, torn):
    opened().append([["grid", 0, 1.0]])
    path.write_text(path.read_text() + torn)
    table = opened()
    assert table.keys == {("grid", "0")}
    table.append([["grid", 1, 2.0]])
    assert path.read_text().splitlines()[1:] == ["grid,0,1.0", "grid,1,2.0"]


@pytest.mark.parametrize("start", ["", "vari", "variant,seed,error_m"])
def test_a_file_whose_first_line_was_torn_begins_anew(opened, path, start):
    path.write_text(start)
    opened()
    assert path.read_text() == "variant,seed,error_m\n"


@pytest.mark.parametrize("content", ["seed,variant,error_m\n", "my thesis", "variant,seed,error_m,more\n"])
def test_a_file_that_is_another_table_is_left_alone(opened, path, content):
    path.write_text(content)
    with pytest.raises(RunError, match="must begin with variant,seed,error_m; is it another table"):
        opened()
    assert path.read_text() == content


@pytest.mark.parametrize("line", ["grid,1,2,3", "grid", ",1,2"])
def test_a_line_that_is_no_row_is_named(opened, path, line):
    path.write_text(f"variant,seed,error_m\ngrid,0,1\n{line}\n")
    with pytest.raises(RunError, match="line 3 is not a row of"):
        opened()


def test_a_table_has_one_writer_at_a_time_and_anyone_may_look(opened, path):
    opened().append([["grid", 0, 1.0]])
    with pytest.raises(RunError, match="is being written by another"):
        Table(path, COLUMNS, KEY)
    assert read_keys(path, COLUMNS, KEY)[0] == {("grid", "0")}


def test_who_was_refused_holds_nothing(opened, path):
    path.write_text("my thesis\n")
    with pytest.raises(RunError):
        opened()
    path.write_text("")
    opened()


def test_looking_for_a_table_makes_none(path):
    assert read_keys(path, COLUMNS, KEY) == (set(), 0)
    assert not path.exists()


def test_a_word_with_a_comma_stays_one_field(opened):
    opened().append([["few,old", 0, 1.0]])
    assert opened().keys == {("few,old", "0")}
