"""Tables of results: no row twice, none lost while others write, no foreign file changed."""

import math
import os
import signal
import subprocess
import sys
import time

import pytest

from runs import ROOT
from sgimd_torch.record import RunError
from tables import RESULTS, Table

COLUMNS = ("variant", "seed", "error_m")
KEY = ("variant", "seed")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "table.csv"


@pytest.fixture
def table(path):
    return Table(path, COLUMNS, KEY)


def test_numbers_read_back_exactly_and_what_was_not_measured_is_empty(table, path):
    table.merge([["grid", 0, 0.1 + 0.2], ["grid", 1, math.nan]])
    assert path.read_text() == "variant,seed,error_m\ngrid,0,0.30000000000000004\ngrid,1,\n"


def test_a_row_that_is_there_is_not_written_twice(table, path):
    table.merge([["grid", 0, 1.0], ["grid", 0, 1.0]])
    table.merge([["grid", 0, 1.0], ["grid", 1, 2.0]])
    assert path.read_text().splitlines()[1:] == ["grid,0,1.0", "grid,1,2.0"]


def test_a_row_made_again_takes_the_place_of_the_old_one_and_the_others_stay(table, path):
    table.merge([["grid", 0, 1.0], ["grid", 1, 2.0], ["random", 0, 3.0]])
    table.merge([["grid", 1, 2.5]])
    assert path.read_text().splitlines()[1:] == ["grid,0,1.0", "grid,1,2.5", "random,0,3.0"]


@pytest.mark.parametrize("name", ["paper.csv", "forward_model.csv"])
def test_a_shipped_table_merged_with_a_row_of_its_own_keeps_every_byte(tmp_path, name):
    content = (ROOT / "results" / name).read_bytes()
    (tmp_path / name).write_bytes(content)
    table = Table(tmp_path / name, *RESULTS)
    rows = list(table.rows().values())
    assert len(rows) == content.count(b"\n") - 1
    table.merge([rows[7]])
    assert (tmp_path / name).read_bytes() == content


@pytest.mark.parametrize("torn", ["grid,1,0.2", "grid", "\0\0\0"])
def test_a_torn_last_line_is_dropped_and_written_again(table, path, torn):
    table.merge([["grid", 0, 1.0]])
    path.write_text(path.read_text() + torn)
    assert set(table.rows()) == {("grid", "0")}
    table.merge([["grid", 1, 2.0]])
    assert path.read_text().splitlines()[1:] == ["grid,0,1.0", "grid,1,2.0"]


@pytest.mark.parametrize("start", ["", "vari", "variant,seed,error_m"])
def test_a_file_whose_first_line_was_torn_begins_anew(table, path, start):
    path.write_text(start)
    table.merge([])
    assert path.read_text() == "variant,seed,error_m\n"


@pytest.mark.parametrize("content", ["seed,variant,error_m\n", "my thesis", "variant,seed,error_m,more\n"])
def test_a_file_that_is_another_table_is_left_alone(table, path, content):
    path.write_text(content)
    for use in (table.rows, lambda: table.merge([["grid", 0, 1.0]])):
        with pytest.raises(RunError, match="must begin with variant,seed,error_m; is it another table"):
            use()
    assert path.read_text() == content


@pytest.mark.parametrize("line", ["grid,1,2,3", "grid", ",1,2"])
def test_a_line_that_is_no_row_is_named(table, path, line):
    path.write_text(f"variant,seed,error_m\ngrid,0,1\n{line}\n")
    with pytest.raises(RunError, match="line 3 is not a row of"):
        table.rows()


def writing(path, variant, n):
    program = (
        "import sys; from pathlib import Path; from tables import Table;"
        f"table = Table(Path({str(path)!r}), {COLUMNS}, {KEY});"
        f"[table.merge([[{variant!r}, seed, 1.0]]) for seed in range({n})]"
    )
    paths = os.pathsep.join([str(ROOT), str(ROOT / "experiments")])
    return subprocess.Popen([sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": paths})


def test_two_processes_that_write_at_once_lose_nothing_and_anyone_may_read(table, path):
    writers = [writing(path, variant, 60) for variant in ("grid", "random")]
    while any(writer.poll() is None for writer in writers):
        seen = set(table.rows())  # never half of a file
        assert seen <= set(table.rows())
        time.sleep(0.01)
    assert [writer.returncode for writer in writers] == [0, 0]
    assert set(table.rows()) == {(variant, str(seed)) for variant in ("grid", "random") for seed in range(60)}


def test_a_writer_that_is_killed_leaves_a_whole_file_and_stops_nobody(table, path):
    table.merge([["first", 0, 1.0]])
    writer = writing(path, "grid", 10_000)
    while len(table.rows()) < 20:
        assert writer.poll() is None
        time.sleep(0.01)
    writer.send_signal(signal.SIGKILL)
    writer.wait()
    there = set(table.rows())
    table.merge([["random", 0, 1.0]])
    assert set(table.rows()) == there | {("random", "0")}
    assert path.read_text().endswith("\n")


def test_looking_for_a_table_makes_none(table, path, tmp_path):
    assert table.rows() == {}
    assert not list(tmp_path.iterdir())


def test_a_word_with_a_comma_stays_one_field(table):
    table.merge([["few,old", 0, 1.0]])
    assert set(table.rows()) == {("few,old", "0")}
