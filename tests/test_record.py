"""The record: floats come back exactly, one writer at a time, all of a commit or nothing; no damage goes unnoticed."""

import shutil
import sqlite3

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from runs import MOVEMENTS, edit, end, start, stopped
from sgimd_torch.evaluation import Benchmark, save_benchmark
from sgimd_torch.record import DERIVED, Event, InUseError, Kind, Record, RunError, layout
from sgimd_torch.runs.command_line import main
from sgimd_torch.runs.directory import FILE
from sgimd_torch.runs.process import command
from sgimd_torch.runs.read import read_run
from sgimd_torch.spaces import Demonstration, stream

DIMS = 1, 3, 2
numbers = st.floats(allow_nan=False)


def moved(theta, goal=None, context=(0.25,), outcome=(0.5, -0.5)):
    vectors = [None if each is None else np.array(each) for each in (context, theta, goal, outcome)]
    return Event(Kind.MOVED, *vectors, origin="local")


def shown(k=0.0, n_joints=2):
    trajectory = np.arange(4.0 * n_joints).reshape(4, n_joints) + k
    return Demonstration(np.array([k]), np.linspace(0, 1, 4), trajectory, np.array([0.1, k]))


def fill(path, seed=0, n=40):
    """A record with rows in all tables."""
    rng = stream(seed, "record")
    with Record.make(path, DIMS, {"settings": {"seed": seed, "movements": n}, "versions": {"numpy": "2"}}) as record:
        for k in range(n):
            if k % 10 == 5:
                record.add(Event(Kind.SHOWN, lesson=shown(rng.random()), who="teacher"))
            record.add(moved(rng.random(3), rng.random(2), rng.random(1), rng.random(2)))
        for table in DERIVED:
            record.add_rows(table, rows_for(table, rng))
        record.commit()
    return path


def rows_for(table, rng, n=12):
    def cell(column):
        return {"INTEGER": int(rng.integers(100)), "REAL": rng.random(), "TEXT": "own"}[column.split()[1]]

    return [[cell(column) for column in layout(DIMS)[table][:-1]] for _ in range(n)]


def read(path):
    """All that a record says."""
    with Record(path) as record:
        return {table: list(record.rows(table)) for table in layout(record.dims)}


def same(found, event):
    for name, value in event._asdict().items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(getattr(found, name), value)
        elif isinstance(value, Demonstration):
            assert all(np.array_equal(getattr(found.lesson, each), getattr(value, each)) for each in vars(value))
        else:
            assert getattr(found, name) == value
    return True


def test_a_row_is_one_thing_its_columns_have_names_and_a_seal():
    columns = layout(DIMS)
    assert columns["events"] == [
        *("movement INTEGER", "kind TEXT", "origin TEXT", "context_0 REAL", "theta_0 REAL", "theta_1 REAL"),
        *("theta_2 REAL", "goal_0 REAL", "goal_1 REAL", "outcome_0 REAL", "outcome_1 REAL", "demonstration INTEGER"),
        *("who TEXT", "strategy TEXT", "reply TEXT", "seal INTEGER"),
    ]
    assert all(each[-1] == "seal INTEGER" for each in columns.values())
    assert {*DERIVED} < {*columns}


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(st.lists(numbers, min_size=6, max_size=6), st.booleans()), max_size=5))
def test_numbers_come_back_exactly(tmp_path_factory, rows):
    path = tmp_path_factory.mktemp("record") / "run.sqlite"
    events = [
        moved(values[:3], goal=values[3:5] if aimed else None, outcome=values[4:6], context=values[:1])
        for values, aimed in rows
    ]
    with Record.make(path, DIMS, {}) as record:
        for event in events:
            record.add(event)
        record.commit()
    with Record(path) as record:
        assert record.movements == len(events)
        assert all(same(*pair) for pair in zip(record.events(), events, strict=True))


def test_nan_is_null_and_minus_zero_is_zero(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    with Record(path, write=True) as record:
        record.add_rows("refreshes", [(50, 50, np.int64(7), np.float64("nan"), -0.0, 0)])
        record.add(moved([-0.0, 0.5, 1.0], goal=[np.nan, 0.5]))  # of a strategy of one's own
        record.commit()
    with Record(path) as record:
        assert list(record.rows("refreshes"))[-1] == (50, 50, 7, None, 0.0, 0)
        *_, event = record.events()
        assert event.goal is None
        assert event.theta.tolist() == [0.0, 0.5, 1.0]


def test_vectors_that_are_too_long_for_columns_are_one_cell(tmp_path):
    long = [stream(0, "long").random(500) for _ in range(4)]
    with Record.make(tmp_path / "run.sqlite", (500, 500, 500), {}) as record:
        record.add(moved(long[0], long[1], long[2], long[3]))
        record.add(Event(Kind.RESTED, long[2]))
        record.commit()
    with Record(tmp_path / "run.sqlite") as record:
        assert "theta_values BLOB" in layout(record.dims)["events"]
        first, second = record.events()
    assert same(first, moved(long[0], long[1], long[2], long[3]))
    assert same(second, Event(Kind.RESTED, long[2]))


def test_events_of_every_kind_come_back(tmp_path):
    context, theta, goal = np.array([0.5]), np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0])
    events = [
        moved(theta, goal),
        Event(Kind.RESTED, context),
        Event(Kind.SHOWN, lesson=shown(1.0), who="teacher"),
        Event(Kind.SHOWN, lesson=shown(1.0)),
        Event(Kind.ASKED, context),
        Event(Kind.ASKED, context, goal=goal, who="all", strategy="imitate all", reply="again"),
        Event(Kind.FAILED, context, theta),
        Event(Kind.INTERRUPTED),
    ]
    assert {event.kind for event in events} == {*Kind}
    with Record.make(tmp_path / "run.sqlite", DIMS, {}) as record:
        for event in events:
            record.add(event)
        record.commit()
        assert all(same(*pair) for pair in zip(record.events(), events, strict=True))
    assert [row[0] for row in read(tmp_path / "run.sqlite")["events"]] == [0, 1, 2, 2, 2, 2, 2, 2]


def test_a_demonstration_is_kept_once_also_when_it_is_shown_again_after_a_break(tmp_path):
    with Record.make(tmp_path / "run.sqlite", DIMS, {}) as record:
        for k in (0, 1, 0):
            record.add(Event(Kind.SHOWN, lesson=shown(k)))
        record.commit()
    with Record(tmp_path / "run.sqlite", write=True) as record:
        for k in (1, 2):
            record.add(Event(Kind.SHOWN, lesson=shown(k)))
        record.commit()
        assert [event.lesson.context.tolist() for event in record.events()] == [[0], [1], [0], [1], [2]]
        assert [each.context.tolist() for each in record.demonstrations()] == [[0], [1], [2]]
    with Record(tmp_path / "run.sqlite", write=True) as record, pytest.raises(ValueError, match="n_times"):
        record.add(Event(Kind.SHOWN, lesson=Demonstration(np.zeros(1), np.arange(4.0), np.zeros(4), np.zeros(2))))


def test_a_second_writer_is_refused_at_once_and_the_first_goes_on(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    program = "import sys; from sgimd_torch.record import Record; Record(sys.argv[1], write=True)"
    with Record(path, write=True) as record:
        with pytest.raises(InUseError, match="in use by another process"):
            Record(path, write=True)
        _, errors = start(program, path).communicate()
        assert "InUseError" in errors
        record.add(moved([0.1, 0.2, 0.3]))
        record.commit()
    with Record(path, write=True) as record:
        assert record.movements == 4


def test_a_reader_beside_a_writer_sees_whole_commits(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        record.add_rows("goals", [(0, 0.5, 0.5)])
        assert record.movements == 4
        assert len(read(path)["events"]) == 3
        record.commit()
        assert len(read(path)["events"]) == 4
        record.settle(seconds={"seconds_physics": 1.5})  # rows that were replaced are seen by the writer at once
        assert record.about["seconds"] == {"seconds_physics": 1.5}
        assert len(list(record.rows("about"))) == 5
        assert "seconds" not in dict(read(path)["about"])
    assert "seconds" not in dict(read(path)["about"])  # closed without a commit


@pytest.mark.parametrize("spilt", [False, True])
def test_of_a_commit_that_a_kill_cuts_short_nothing_is_there(tmp_path, spilt):
    """Also when SQLite had begun to write into the file, since its cache was full."""
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    program = (
        "import os, signal, sys, numpy as np; from sgimd_torch.record import Event, Kind, Record\n"
        f"record = Record(sys.argv[1], write=True); record._connection.execute('PRAGMA cache_size = {int(spilt)}')\n"
        "event = Event(Kind.MOVED, np.zeros(1), np.zeros(3), np.zeros(2), np.zeros(2), 'local')\n"
        "for k in range(2000): record.add(event)\n"
        "record._write(); os.kill(os.getpid(), signal.SIGSTOP)"
    )
    process = stopped(program, path)
    journal = path.with_name("run.sqlite-journal")
    assert journal.exists()
    assert end(process)[0] == -9
    assert read(path) == before
    assert not journal.exists() or not spilt
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        record.commit()
    assert len(read(path)["events"]) == len(before["events"]) + 1


def test_a_full_disk_is_told_and_what_was_committed_is_whole(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    with Record(path, write=True) as record:
        pages = record._connection.execute("PRAGMA page_count").fetchone()[0]
        record._connection.execute(f"PRAGMA max_page_count = {pages}")
        for _ in range(500):
            record.add(moved([0.1, 0.2, 0.3]))
        with pytest.raises(OSError, match="full"):
            record.commit()
        with pytest.raises(OSError, match="lost"):  # but it does not know what it had handed over
            record.commit()
    assert read(path) == before


def test_tables_that_a_replay_makes_again_keep_their_rows(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    with Record(path, write=True) as record:
        rows = list(record.rows("refreshes"))
        record.remake_rows("refreshes", [*rows, (1, 2, 3, 0.5, 0.25, 0)])
        record.commit()
    assert read(path)["refreshes"] == [*rows, (1, 2, 3, 0.5, 0.25, 0)]


@pytest.mark.parametrize(("n", "kept"), [(None, 40), (0, 0), (1, 1), (6, 5), (7, 6)])
def test_the_first_events_alone_are_a_record_of_the_same_run(tmp_path, n, kept):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    with Record(path, write=True) as record:
        assert record.rewrite(n_events=n, keep=("goals",)) == kept
    after = read(path)
    assert after["events"] == before["events"][:n]
    assert after["goals"] == before["goals"]
    assert after["errors"] == []
    assert dict(after["about"])["settings"] == dict(before["about"])["settings"]


def test_a_record_is_read_from_a_folder_that_cannot_be_written(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    path.chmod(0o444)
    tmp_path.chmod(0o555)
    try:
        assert read(path) == before
    finally:
        tmp_path.chmod(0o755)


def test_what_is_no_record_is_refused_in_one_line(tmp_path):
    (tmp_path / "empty").touch()
    (tmp_path / "text").write_text("index,origin\n" * 100)
    np.savez(tmp_path / "memory.npz", thetas=np.zeros((3, 2)))
    with sqlite3.connect(tmp_path / "other") as other:
        other.execute("CREATE TABLE seals (name TEXT)")
    other.close()
    fill(tmp_path / "renamed")
    edit(tmp_path / "renamed", "ALTER TABLE events RENAME COLUMN movement TO step")
    names = ("empty", "text", "memory.npz", "other", "renamed", "missing", "missing/run.sqlite", ".")
    for name in names:
        for write in (False, True):
            with pytest.raises(RunError) as caught:
                Record(tmp_path / name, write=write)
            assert str(tmp_path / name) in str(caught.value)
            assert "\n" not in str(caught.value)


def test_a_record_of_more_than_a_life_says_what_else_is_in_it_only_where_it_is_read(tmp_path):
    """So a table of evaluations that is damaged keeps nobody from loading the movements."""
    path = fill(tmp_path / "run.sqlite")
    edit(path, "UPDATE errors SET error = -5 WHERE rowid = 3")
    with Record(path) as record:
        assert len(list(record.events())) == 44
        found = []
        with pytest.raises(RunError, match="row 3 of errors is not what was written"):
            found.extend(record.rows("errors"))
        assert record.check().keys() == {"errors"}


def test_who_stopped_reading_keeps_nobody_from_writing(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    edit(path, "UPDATE events SET theta_1 = 0.5 WHERE rowid = 9")
    with Record(path) as record:
        events, rows = record.events(), record.rows("goals")
        assert next(events).kind == Kind.MOVED
        assert len(next(rows)) == 3
        with pytest.raises(RunError, match="row 9 of events") as caught:
            list(events)
    edit(path, "DELETE FROM events")
    assert caught.value.__traceback__ is not None  # the frames are still there


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
ALL = "--environment toss --algorithm sgim-acts --teachers all --base search --search gradient --inverse model"
SHORT = "--movements 110 --evaluate_at 60 --repeats 2 --training 0.5 --members 2"


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
    content = read(files[0])
    path = tmp_path / "run/seed-000" / FILE
    path.parent.mkdir(parents=True)
    for k in range(3 * len(DAMAGES)):
        damaged(path, *files, DAMAGES[k % len(DAMAGES)], k)
        code = live(tmp_path, "--resume")
        assert code in (0, 2)
        if code == 0:
            del (found := read(path))["about"]
            assert found == {table: rows for table, rows in content.items() if table != "about"}


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
        with Record(path) as record:
            assert {table: list(record.rows(table)) for table in reference if table != "about"} == reference


def test_the_file_of_another_seed_is_told_by_its_folder(tmp_path, go, undisturbed, capsys):
    path = tmp_path / "sgim-d/seed-004"
    shutil.copytree(undisturbed, path)
    with pytest.raises(RunError, match="seed 3"):
        read_run(path)
    assert go(tmp_path, "--seed", 4, "--resume") == 2
    assert "seed was 3, now 4" in capsys.readouterr().err
    assert len(read_run(undisturbed).index) == MOVEMENTS
