"""Damage of a record, of every kind, in every table: it never reads as something else, and no command is misled."""

import shutil

import numpy as np
import pytest

from records import fill, read
from runs import MOVEMENTS, content_of, edit
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.options.command_line import main
from sgimd_torch.record import Record, RunError, layout
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.read import read_run
from sgimd_torch.runs.signals import command
from sgimd_torch.spaces import stream

ONE, OTHER = "SELECT * FROM {table} WHERE rowid = {first}", "SELECT * FROM other.{table}"
TAKE = ("DELETE FROM {table}", f"INSERT INTO {{table}} {OTHER}")
SQL = {  # what happens to rows; ``other`` is another run of the same layout
    "delete": ("DELETE FROM {table} WHERE rowid = {first}",),
    "delete_last": ("DELETE FROM {table} WHERE rowid > {first}",),
    "double": (f"INSERT INTO {{table}} {ONE}",),
    "swap_rows": (
        "UPDATE {table} SET rowid = -1 WHERE rowid = {first}",
        "UPDATE {table} SET rowid = {first} WHERE rowid = {second}",
        "UPDATE {table} SET rowid = {second} WHERE rowid = -1",
    ),
    "reorder": ("UPDATE {table} SET rowid = -rowid",),
    "update": (
        "UPDATE {table} SET {column} = (SELECT {column} FROM {table} WHERE rowid = {second}) WHERE rowid = {first}",
    ),
    "forget": ("UPDATE {table} SET {column} = NULL WHERE rowid = {first}",),
    "take_table": TAKE,
    "take_table_and_seal": (
        *TAKE,
        "DELETE FROM seals WHERE name = '{table}'",
        "INSERT INTO seals SELECT * FROM other.seals WHERE name = '{table}'",
    ),
    "take_row": (
        "DELETE FROM {table} WHERE rowid = {n}",
        f"INSERT INTO {{table}} {OTHER} WHERE rowid = {{first}}",
    ),
    "fewer": ("UPDATE seals SET n_rows = n_rows - 1 WHERE name = '{table}'",),
    "edit_seal": ("UPDATE seals SET seal = seal + 1 WHERE name = '{table}'",),
    "rename_seal": ("UPDATE seals SET name = 'events' WHERE name = '{table}'",),
    "lose_seal": ("DELETE FROM seals WHERE name = '{table}'",),
    "drop": ("DROP TABLE {table}",),
}


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
TOLD_ALWAYS = {"delete", "double", "swap_rows", "take_table", "take_table_and_seal", "take_row", "lose_seal", "drop"}


def damaged(path, whole, other, what, k):
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
    names = {"table": table, "column": column, "first": first, "second": second, "n": n_rows[table]}
    edit(path, f"ATTACH '{other}' AS other", *(statement.format(**names) for statement in SQL[what]))


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


def test_a_file_that_sqlite_has_written_anew_is_the_same_record(tmp_path, two):
    shutil.copy(two[0], tmp_path / "run.sqlite")
    edit(tmp_path / "run.sqlite", "VACUUM")
    assert unnoticed(tmp_path / "run.sqlite", read(two[0]))


@pytest.mark.parametrize("what", DAMAGES)
def test_no_damage_reads_as_something_else(tmp_path, two, what):
    content = read(two[0])
    for k in range(6):
        damaged(tmp_path / "run.sqlite", *two, what, k)
        found = unnoticed(tmp_path / "run.sqlite", content)
        assert found is None or what not in TOLD_ALWAYS


# Runs with rows in every table: with contexts, a model, and teachers who are asked.
ALL = "--environment experiments.toys:toss --algorithm sgim-acts-search --teachers all --inverse model"
SHORT = "--movements 110 --evaluate_at 60 --repeats 2 --inverse.rate 0.5 --inverse.members 2"


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
