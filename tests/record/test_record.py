"""The record: floats come back exactly, one writer at a time, all of a commit or nothing; no damage goes unnoticed."""

import sqlite3
import subprocess

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from records import DIMS, fill, moved, read, shown
from runs import edit, end, stopped
from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.record import Record, RunError
from sgimd_torch.spaces import Demonstration

NUMBERS = st.floats(allow_nan=False)
DEMONSTRATIONS = st.builds(shown, st.integers(0, 2))
KINDS = [Kind.MOVED, Kind.RESTED, Kind.SHOWN, Kind.ASKED, Kind.INTERRUPTED, Kind.ADDED, Kind.FAILED, Kind.CHANGED]


def vectors(dim):
    return st.none() | st.lists(NUMBERS, min_size=dim, max_size=dim).map(np.array)


@st.composite
def events(draw):
    """Events of every kind, with and without each of their fields, and with texts of numpy."""
    kind, (c, p, t) = draw(st.sampled_from(KINDS)), DIMS
    in_context = kind not in (Kind.SHOWN, Kind.CHANGED, Kind.RESTARTED)
    numbers = (draw(vectors(c) if in_context else st.none()), *(draw(vectors(dim)) for dim in (p, t, t)))
    texts = [draw(st.none() | st.sampled_from(["local", "", "a\nb\0"]) | st.just(np.str_("own"))) for _ in range(4)]
    lesson = draw(DEMONSTRATIONS) if kind == Kind.SHOWN else None
    return Event(kind, *numbers, texts[0], lesson, *texts[1:], robot=draw(st.integers(-1, 9)))


def same(one, other):
    if isinstance(one, Demonstration):
        return all(np.array_equal(getattr(one, name), getattr(other, name)) for name in vars(one))
    return np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(events(), max_size=12), st.integers(0, 12))
def test_events_come_back_exactly_and_each_demonstration_is_kept_once(tmp_path_factory, life, pause):
    """Also if the record is closed and opened again on the way."""
    path = tmp_path_factory.mktemp("record") / "run.sqlite"
    Record.make(path, DIMS, {}).close()
    for part in (life[:pause], life[pause:]):
        with Record(path, write=True) as record:
            for event in part:
                record.add(event)
            record.commit()
    with Record(path) as record:
        found = list(record.events())
        assert len(found) == len(life)
        assert all(same(*fields) for pair in zip(found, life, strict=True) for fields in zip(*pair, strict=True))
        lessons = dict.fromkeys(float(event.lesson.context[0]) for event in life if event.lesson is not None)
        assert [float(each.context[0]) for each in record.demonstrations()] == list(lessons)
        counted = [event.kind in (Kind.MOVED, Kind.RESTED, Kind.FAILED) for event in life]
        assert record.movements == sum(counted)
        assert [row[0] for row in record.rows("events")] == [sum(counted[:k]) for k in range(len(life))]


def test_nan_is_null_and_minus_zero_is_zero(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    with Record(path, write=True) as record:
        record.add_rows("refreshes", [(50, 50, np.int64(7), np.float64("nan"), -0.0, 0, 1.0, 2.0, 0.01)])
        record.add(moved([-0.0, 0.5, 1.0], goal=[np.nan, 0.5]))  # of a strategy of one's own
        record.commit()
    with Record(path) as record:
        assert list(record.rows("refreshes"))[-1] == (50, 50, 7, None, 0.0, 0, 1.0, 2.0, 0.01)
        *_, event = record.events()
        assert event.goal is None
        assert event.theta.tolist() == [0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("event", "message"),
    [
        (moved([0.1, 0.2, 0.3])._replace(origin=5), "a record keeps origins, names and replies as text, got 5"),
        (moved([0.1, 0.2]), r"a record keeps vectors of 3 numbers here, got shape \(2,\); is it a goal"),
        (moved([0.1, 0.2, 0.3], goal=[0.1]), "a record keeps vectors of 2 numbers"),
    ],
)
def test_what_cannot_be_kept_is_refused_when_it_is_written(tmp_path, event, message):
    with Record.make(tmp_path / "run.sqlite", DIMS, {}) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        with pytest.raises(ValueError, match=message):
            record.add(event)
        record.commit()
    assert len(read(tmp_path / "run.sqlite")["events"]) == 1


def test_a_reader_beside_a_writer_sees_whole_commits(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        record.add_rows("goals", [(0, 0.5, 0.5)])
        assert record.movements == 4
        assert len(read(path)["events"]) == 3
        record.commit()
        assert len(read(path)["events"]) == 4
        record.replace_rows("goals", [(0, 0.25, 0.25)])
        record.about["seconds"] = 1.5
        assert list(record.rows("goals")) == [(0, 0.25, 0.25)]  # the writer sees what it has written
        assert "seconds" not in dict(read(path)["about"])
    assert "seconds" not in dict(read(path)["about"])  # closed without a commit


def test_a_copy_of_the_file_alone_has_all_commits_while_the_run_writes(tmp_path):
    path, copy = fill(tmp_path / "run.sqlite"), tmp_path / "copy" / "run.sqlite"
    copy.parent.mkdir()
    with Record(path, write=True) as record:
        for _ in range(3):
            record.add(moved([0.1, 0.2, 0.3]))
            record.commit()
        subprocess.run(["cp", path, copy], check=True)  # opened here, the file would lose its locks
        assert read(copy) == read(path)


@pytest.mark.parametrize("spilt", [False, True])
def test_of_a_commit_that_a_kill_cuts_short_nothing_is_there(tmp_path, spilt):
    """Also when SQLite had begun to write into the file, since its cache was full."""
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    program = (
        "import os, signal, sys, numpy as np\n"
        "from sgimd_torch.learner.events import Event, Kind; from sgimd_torch.record import Record\n"
        f"record = Record(sys.argv[1], write=True); record._connection.execute('PRAGMA cache_size = {int(spilt)}')\n"
        "event = Event(Kind.MOVED, np.zeros(1), np.zeros(3), np.zeros(2), np.zeros(2), 'local')\n"
        "for k in range(2000): record.add(event)\n"
        "os.kill(os.getpid(), signal.SIGSTOP)"
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
        with pytest.raises(OSError, match="full"):
            record.add_rows("goals", [(k, 0.5, 0.5) for k in range(5000)])
        with pytest.raises(OSError, match="full"):  # a row is missing, so no later one may follow
            record.commit()
    assert read(path) == before


def test_a_record_is_read_from_a_folder_that_cannot_be_written(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    edit(path, "PRAGMA journal_mode = WAL")  # as after a kill
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
        other.execute("CREATE TABLE about (name TEXT)")
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


def test_a_reader_that_thinks_for_long_keeps_no_lock_and_sees_one_state(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path) as reader, Record(path, write=True) as writer:
        before = list(reader.rows("events"))
        writer.add(moved([0.1, 0.2, 0.3]))
        writer.replace_rows("goals", [(0, 0.5, 0.5)])
        assert writer.commit()
        assert list(reader.rows("events")) == before


def test_another_writer_is_noticed(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        lock = record._lock

        def late():  # another process writes between a commit and the next lock
            edit(path, "DELETE FROM goals")
            lock()

        record._lock = late
        with pytest.raises(RunError, match="another process has written to it"):
            record.commit()


def test_what_a_viewer_adds_to_a_record_is_no_damage(tmp_path):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    view = "CREATE VIEW errors_of_goals AS SELECT goal, avg(error) FROM errors GROUP BY goal"
    edit(path, "CREATE INDEX quick ON events (kind)", "ANALYZE", view)
    assert read(path) == before
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        record.commit()
