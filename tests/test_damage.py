"""Damage of a record, of every kind, in every table: it never reads as something else, and no command is misled."""

import shutil
import sqlite3

import numpy as np
import pytest

from records import fill, read
from runs import MOVEMENTS, content_of, edit
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.record import Record, RunError, layout
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import stream


class Damage:
    """Something that happens to a file, drawn at random; ``other`` is the file of another run of the same layout."""

    def __init__(self, path, other, rng):
        self.path, self.other, self.rng = path, other, rng
        self.content = bytearray(path.read_bytes())
        with Record(path) as record:
            tables = {table: len(list(record.rows(table))) for table in layout(record.dims)}
            self.columns = {table: [*record.columns(table), "seal"] for table in tables}
        self.table = str(rng.choice([table for table, n in tables.items() if n > 2]))
        self.n = tables[self.table]
        self.column = str(rng.choice(self.columns[self.table]))
        self.first, self.second = map(int, rng.choice(self.n, 2, replace=False) + 1)
        self.place = int(rng.integers(len(self.content)))

    def write(self):
        self.path.write_bytes(self.content)

    def flip(self):
        self.content[self.place] ^= int(self.rng.integers(1, 256))
        self.write()

    def flip_something(self):
        """A byte that is used; most of a small file is empty."""
        used = np.flatnonzero(self.content)
        self.place = int(self.rng.choice(used))
        self.flip()

    def flip_header(self):
        self.place %= 600
        self.flip()

    def cut(self):
        del self.content[self.place :]
        self.write()

    def lose_pages(self):
        pages = len(self.content) // 4096
        first, last = sorted(self.rng.choice(pages + 1, 2, replace=False) * 4096)
        self.content[first:last] = bytes(last - first)
        self.write()

    def swap_pages(self):
        first, second = self.rng.choice(len(self.content) // 4096, 2, replace=False) * 4096
        a, b = self.content[first : first + 4096], self.content[second : second + 4096]
        self.content[first : first + 4096], self.content[second : second + 4096] = b, a
        self.write()

    def mix_pages(self):
        """A page of the other run, at the same place."""
        other = self.other.read_bytes()
        page = self.place // 4096 * 4096
        self.content[page : page + 4096] = other[page : page + 4096].ljust(4096, b"\0")
        self.write()

    def delete(self):
        edit(self.path, f"DELETE FROM {self.table} WHERE rowid = {self.first}")

    def delete_last(self):
        edit(self.path, f"DELETE FROM {self.table} WHERE rowid > {self.first}")

    def double(self):
        edit(self.path, f"INSERT INTO {self.table} SELECT * FROM {self.table} WHERE rowid = {self.first}")

    def swap_rows(self):
        moves = ((self.first, -1), (self.second, self.first), (-1, self.second))
        edit(self.path, *(f"UPDATE {self.table} SET rowid = {new} WHERE rowid = {old}" for old, new in moves))

    def reorder(self):
        edit(self.path, f"UPDATE {self.table} SET rowid = -rowid")

    def update(self):
        value = f"(SELECT {self.column} FROM {self.table} WHERE rowid = {self.second})"
        edit(self.path, f"UPDATE {self.table} SET {self.column} = {value} WHERE rowid = {self.first}")

    def forget(self):
        edit(self.path, f"UPDATE {self.table} SET {self.column} = NULL WHERE rowid = {self.first}")

    def from_other(self, *statements):
        edit(self.path, f"ATTACH '{self.other}' AS other", *statements)

    def take_table(self):
        self.from_other(f"DELETE FROM {self.table}", f"INSERT INTO {self.table} SELECT * FROM other.{self.table}")

    def take_table_and_seal(self):
        seals = f"INSERT INTO seals SELECT * FROM other.seals WHERE name = '{self.table}'"
        self.take_table()
        self.from_other(f"DELETE FROM seals WHERE name = '{self.table}'", seals)

    def take_row(self):
        wanted = f"SELECT * FROM other.{self.table} WHERE rowid = {self.first}"
        self.from_other(f"DELETE FROM {self.table} WHERE rowid = {self.n}", f"INSERT INTO {self.table} {wanted}")

    def edit_seals(self):
        change = self.rng.choice(["n_rows = n_rows - 1", "n_rows = n_rows + 1", "seal = seal + 1", "name = 'events'"])
        edit(self.path, f"UPDATE seals SET {change} WHERE name = '{self.table}'")

    def lose_seal(self):
        edit(self.path, f"DELETE FROM seals WHERE name = '{self.table}'")

    def drop(self):
        edit(self.path, f"DROP TABLE {self.table}")

    def vacuum(self):
        """No damage: SQLite writes the file anew."""
        with sqlite3.connect(self.path) as connection:
            connection.execute("VACUUM")
        connection.close()


DAMAGES = sorted(name for name in vars(Damage) if not name.startswith("_") and name not in ("write", "from_other"))
TOLD_ALWAYS = {"delete", "double", "swap_rows", "take_table", "take_table_and_seal", "take_row", "lose_seal", "drop"}


def damaged(path, whole, other, what, k):
    path.unlink(missing_ok=True)
    shutil.copy(whole, path)
    getattr(Damage(path, other, stream(k, what)), what)()


def unnoticed(path, content):
    """Whether it reads as before; None if it is refused. It never reads as anything else."""
    try:
        found = read(path)
    except RunError:
        return None
    assert found == content
    return True


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """The records of two runs."""
    out = tmp_path_factory.mktemp("two")
    return fill(out / "first.sqlite"), fill(out / "second.sqlite", seed=1)


@pytest.mark.parametrize("what", DAMAGES)
def test_no_damage_reads_as_something_else(tmp_path, two, what):
    content = read(two[0])
    for k in range(6):
        damaged(tmp_path / "run.sqlite", *two, what, k)
        found = unnoticed(tmp_path / "run.sqlite", content)
        assert found is None or what not in TOLD_ALWAYS
        assert found or what != "vacuum"


@pytest.mark.slow
def test_no_flipped_byte_reads_as_something_else(tmp_path, two):
    path, content, whole = tmp_path / "run.sqlite", read(two[0]), two[0].read_bytes()
    told = 0
    for place in range(0, len(whole), 17):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x5A]) + whole[place + 1 :])
        told += unnoticed(path, content) is None
    assert told > 100


# Runs with rows in every table: with contexts, a model, and teachers who are asked.
ALL = "--environment toss --algorithm sgim-acts --teachers all --base search --inverse model"
SHORT = "--movements 110 --evaluate_at 60 --repeats 2 --model.rate 0.5 --model.members 2"


@pytest.fixture(scope="module")
def lives(tmp_path_factory):
    """How to go on with such a run, the file of it, and that of the next seed."""
    out = tmp_path_factory.mktemp("all")
    save_benchmark(out / "toss.npz", Benchmark("Toy", np.array([[0.5, 0.5], [1.0, 0.5], [0.8, 0.2]]), 0.1))
    words = [*ALL.split(), *SHORT.split(), "--benchmark", str(out / "toss.npz"), "--name", "run"]

    def live(place, *options):
        return command(main, [*words, "--seed", "0", "--out", str(place), *map(str, options)])

    assert live(out) == live(out, "--seed", 1) == 0
    return live, *(out / f"run/seed-00{seed}/{FILE}" for seed in (0, 1))


@pytest.mark.slow
def test_no_damage_of_a_run_with_all_tables_reads_as_something_else(tmp_path, lives):
    _, *files = lives
    content = read(files[0])
    assert all(content.values())
    for k in range(1000):
        damaged(tmp_path / "run.sqlite", *files, DAMAGES[k % len(DAMAGES)], k)
        unnoticed(tmp_path / "run.sqlite", content)


@pytest.mark.slow
def test_a_damaged_run_is_refused_or_goes_on_to_the_same_record(tmp_path, lives):
    live, *files = lives
    content = content_of(files[0].parent)
    path = tmp_path / "run/seed-000" / FILE
    path.parent.mkdir(parents=True)
    for k in range(len(DAMAGES)):
        damaged(path, *files, DAMAGES[k % len(DAMAGES)], k)
        code = live(tmp_path, "--resume")
        assert code in (0, 2)
        if code == 0:
            assert content_of(path.parent) == content


@pytest.mark.parametrize("what", DAMAGES)
def test_a_damaged_run_of_the_rod_is_refused_or_goes_on_to_the_same_record(
    tmp_path, go, undisturbed, reference, what, capsys
):
    path = tmp_path / "sgim-d/seed-003" / FILE
    path.parent.mkdir(parents=True)
    damaged(path, undisturbed / FILE, undisturbed / FILE, what, 1)
    code = go(tmp_path, "--resume")
    assert code in (0, 2), capsys.readouterr().err
    assert "Traceback" not in capsys.readouterr().err
    if code == 0:
        assert content_of(path.parent) == reference


def test_the_file_of_another_seed_is_told_by_its_folder(tmp_path, go, undisturbed, capsys):
    path = tmp_path / "sgim-d/seed-004"
    shutil.copytree(undisturbed, path)
    with pytest.raises(RunError, match="seed 3"):
        read_run(path)
    assert go(tmp_path, "--seed", 4, "--resume") == 2
    assert "seed was 3, now 4" in capsys.readouterr().err
    assert len(read_run(undisturbed).index) == MOVEMENTS
