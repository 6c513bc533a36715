"""Damage of a record, of every kind, in every table: it never reads as something else, and no command is misled."""

import shutil

import numpy as np
import pytest

from records import DIMS, fill, read
from runs import edit
from sgimd_torch import __version__
from sgimd_torch.record import Record, RunError, layout
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import stream

SQL = {  # what happens to rows
    "delete": ("DELETE FROM {table} WHERE rowid = {first}",),
    "delete_last": ("DELETE FROM {table} WHERE rowid > {first}",),
    "double": ("INSERT INTO {table} SELECT * FROM {table} WHERE rowid = {first}",),
    "swap_rows": (
        "UPDATE {table} SET rowid = -1 WHERE rowid = {first}",
        "UPDATE {table} SET rowid = {first} WHERE rowid = {second}",
        "UPDATE {table} SET rowid = {second} WHERE rowid = -1",
    ),
    "reorder": ("UPDATE {table} SET rowid = -rowid",),
    "shift": ("UPDATE {table} SET rowid = rowid + 1000 WHERE rowid = {first}",),
    "update": (
        "UPDATE {table} SET {column} = (SELECT {column} FROM {table} WHERE rowid = {second}) WHERE rowid = {first}",
    ),
    "forget": ("UPDATE {table} SET {column} = NULL WHERE rowid = {first}",),
    "drop": ("DROP TABLE {table}",),
}
TOLD_ALWAYS = SQL.keys() - {"delete_last", "update", "forget"}  # these may change nothing


def flip(content, place, rng):
    content[place] ^= int(rng.integers(1, 256))


def cut(content, place, rng):
    del content[place:]


def lose_pages(content, place, rng):
    first, last = sorted(rng.choice(len(content) // 4096 + 1, 2, replace=False) * 4096)
    content[first:last] = bytes(last - first)


def swap_pages(content, place, rng):
    a, b = (slice(page, page + 4096) for page in rng.choice(len(content) // 4096, 2, replace=False) * 4096)
    content[a], content[b] = content[b], content[a]


BYTES = {  # what happens to the bytes of the file
    "flip": flip,
    "flip_something": lambda content, place, rng: flip(content, int(rng.choice(np.flatnonzero(content))), rng),
    "flip_header": lambda content, place, rng: flip(content, place % 600, rng),
    "cut": cut,
    "lose_pages": lose_pages,
    "swap_pages": swap_pages,
}
DAMAGES = [*SQL, *BYTES]


def damaged(path, whole, what, k):
    """A copy of a record to which something has happened, drawn at random."""
    path.unlink(missing_ok=True)
    shutil.copy(whole, path)
    rng = stream(k, what)
    if what in BYTES:
        content = bytearray(path.read_bytes())
        BYTES[what](content, int(rng.integers(len(content))), rng)
        path.write_bytes(content)
        return
    with Record(path) as record:
        n_rows = {table: len(list(record.rows(table))) for table in layout(record.dims)}
        table = str(rng.choice([table for table, n in n_rows.items() if n > 2]))
        column = str(rng.choice([column.split()[0] for column in layout(record.dims)[table]]))
    first, second = map(int, rng.choice(n_rows[table], 2, replace=False) + 1)
    edit(path, *(s.format(table=table, column=column, first=first, second=second) for s in SQL[what]))


def unnoticed(path, content):
    """Whether it reads as before; None if it is refused, also by a writer. It never reads as anything else."""
    try:
        rows = read(path)
    except RunError as error:
        said = str(error)
        with pytest.raises(RunError):
            Record(path, write=True)
        return None if str(path) in said and "\n" not in said else said
    if path.read_bytes()[18] <= 2:  # above, SQLite takes the file for one of a later version, and only reads it
        Record(path, write=True).close()
    assert rows == content
    return True


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return fill(tmp_path_factory.mktemp("whole") / "run.sqlite")


def test_a_file_that_sqlite_has_written_anew_is_the_same_record(tmp_path, whole):
    shutil.copy(whole, tmp_path / "run.sqlite")
    edit(tmp_path / "run.sqlite", "VACUUM")
    assert unnoticed(tmp_path / "run.sqlite", read(whole))


@pytest.mark.parametrize("what", DAMAGES)
def test_no_damage_reads_as_something_else(tmp_path, whole, what):
    content = read(whole)
    for k in range(12):
        damaged(tmp_path / "run.sqlite", whole, what, k)
        assert unnoticed(tmp_path / "run.sqlite", content) is None or what not in TOLD_ALWAYS


def test_damage_is_told_with_its_row_only_where_it_is_read(tmp_path):
    """So a table of evaluations that is damaged keeps nobody from loading the movements."""
    path = fill(tmp_path / "run.sqlite")
    edit(path, "UPDATE errors SET error = -5 WHERE rowid = 3", "DELETE FROM regions WHERE rowid > 7")
    with Record(path) as record:
        assert len(list(record.events())) == 44
        for table, message in (("errors", "row 3 of errors is not what"), ("regions", "has 7 rows, 12 were written")):
            with pytest.raises(RunError, match=rf"run.sqlite: .*{message}.*sqlite3 run.sqlite .recover"):
                list(record.rows(table))


@pytest.mark.parametrize(
    ("wrote", "message"), [("0.1.0", ": sgimd_torch 0.1.0 wrote it, and can"), (__version__, "; was it damaged")]
)
def test_a_record_of_another_version_is_not_taken_for_damage(tmp_path, wrote, message):
    path = tmp_path / "run.sqlite"
    Record.make(path, DIMS, {"versions": {"sgimd_torch": wrote}}).close()
    edit(path, "ALTER TABLE evaluations DROP COLUMN expected_error")
    with pytest.raises(RunError, match=rf"its tables are not those of sgimd_torch {__version__}{message}"):
        Record(path)


def test_the_file_of_another_seed_is_told_by_its_folder(tmp_path, go, undisturbed, capsys):
    path = tmp_path / "sgim-d/seed-004"
    shutil.copytree(undisturbed, path)
    with pytest.raises(RunError, match="seed 3"):
        read_run(path)
    assert go(tmp_path, "--seed", 4, "--resume") == 2
    assert "seed was 3, now 4" in capsys.readouterr().err
