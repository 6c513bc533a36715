"""The record: floats come back exactly, one writer at a time, all of a commit or nothing; no damage goes unnoticed."""

import sqlite3

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from records import DIMS, fill, moved, read, shown
from runs import edit, end, start, stopped
from sgimd_torch.learner.events import Event, Kind
from sgimd_torch.record import Record, RunError
from sgimd_torch.spaces import Demonstration

numbers = st.floats(allow_nan=False)


def same(found, event):
    for name, value in event._asdict().items():
        if isinstance(value, np.ndarray):
            assert np.array_equal(getattr(found, name), value)
        elif isinstance(value, Demonstration):
            assert all(np.array_equal(getattr(found.lesson, each), getattr(value, each)) for each in vars(value))
        else:
            assert getattr(found, name) == value
    return True


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


def test_events_of_every_kind_come_back(tmp_path):
    context, theta, goal = np.array([0.5]), np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0])
    events = [
        moved(theta, goal),
        Event(Kind.RESTED, context),
        Event(Kind.SHOWN, lesson=shown(1.0), who="teacher"),
        Event(Kind.SHOWN, lesson=shown(1.0)),
        Event(Kind.ASKED, context),
        Event(Kind.ASKED, context, goal=goal, who="all", strategy="imitate all", reply="again"),
        Event(Kind.INTERRUPTED, context, theta),
        Event(Kind.INTERRUPTED),
        Event(Kind.ADDED, context, theta, outcome=goal),
        Event(Kind.FAILED, context, theta, goal, origin="local", reply="lost"),
        Event(Kind.FAILED, reply="no camera"),
        Event(Kind.CHANGED, reply="since movement 3 outcomes are not what they were"),
    ]
    assert {event.kind for event in events} == {*Kind}
    with Record.make(tmp_path / "run.sqlite", DIMS, {}) as record:
        for event in events:
            record.add(event)
        record.commit()
        assert all(same(*pair) for pair in zip(record.events(), events, strict=True))
    assert [row[0] for row in read(tmp_path / "run.sqlite")["events"]] == [0, 1, 2, 2, 2, 2, 2, 2, 2, 2, 3, 4]


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
        with pytest.raises(RunError, match="in use by another process"):
            Record(path, write=True)
        _, errors = start(program, path).communicate()
        assert "in use by another process" in errors
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


def test_a_reader_that_thinks_for_long_keeps_no_lock_and_sees_one_state(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path) as reader, Record(path, write=True) as writer:
        before = list(reader.rows("events"))
        writer.add(moved([0.1, 0.2, 0.3]))
        writer.replace_rows("goals", [(0, 0.5, 0.5)])
        assert writer.commit(wait=False)
        assert list(reader.rows("events")) == before
        assert reader.check() == {}


def test_a_commit_that_another_program_holds_up_is_made_later_and_nothing_is_lost(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    viewer = sqlite3.connect(path, isolation_level=None)
    with Record(path, write=True) as record:
        viewer.execute("BEGIN")
        viewer.execute("SELECT * FROM events").fetchall()
        for k in range(3):
            record.add(moved([0.1, 0.2, k]))
            record.settle(seconds={"seconds_physics": k})
            assert not record.commit(wait=False)
        viewer.close()
        assert record.commit(wait=False)
        record.add(moved([0.1, 0.2, 9.0]))
        record.commit()
    with Record(path) as record:
        assert record.check() == {}
        assert [event.theta[2] for event in record.events() if event.kind == Kind.MOVED][3:] == [0, 1, 2, 9]
        assert record.about["seconds"] == {"seconds_physics": 2}


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


@pytest.mark.parametrize(
    "statements",
    [
        ["ANALYZE"],
        ["CREATE INDEX quick ON events (kind)", "ANALYZE"],
        ["CREATE VIEW errors_of_goals AS SELECT goal, avg(error) FROM errors GROUP BY goal"],
    ],
)
def test_what_a_viewer_adds_to_a_record_is_no_damage(tmp_path, statements):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    edit(path, *statements)
    assert read(path) == before
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3]))
        record.commit()
        assert record.check() == {}


@pytest.mark.parametrize("name", ["run", "dims", "settings", "versions"])
@pytest.mark.parametrize("column", ["name", "value", "seal"])
def test_one_damaged_entry_about_a_run_leaves_its_movements_whole(tmp_path, name, column):
    path = fill(tmp_path / "run.sqlite")
    before = read(path)
    edit(path, f"UPDATE about SET {column} = substr({column}, 2) WHERE name = '{name}'")
    with Record(path) as record:
        assert record.check().keys() == {"about"}
        assert list(record.rows("events")) == before["events"]
        assert {"run", "dims", "settings", "versions"} - record.about.keys() <= {name, "dims", "settings", "versions"}
    with Record(path, write=True) as record, record.rewrite() as whole:
        assert whole.check() == {}
        assert list(whole.rows("events")) == before["events"]


def test_a_request_is_kept_with_its_demonstration_or_not_at_all(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    asked = Event(Kind.ASKED, np.zeros(1), goal=np.zeros(2), who="left", strategy="imitate left", reply="shown")
    alone = asked._replace(reply="nothing")
    with Record(path, write=True) as record:
        for event in (alone, moved([0.1, 0.2, 0.3]), asked, Event(Kind.SHOWN, lesson=shown(7.0), who="left")):
            record.add(event)
        record.commit()
    edit(path, "DELETE FROM events WHERE rowid = (SELECT max(rowid) FROM events)")
    with Record(path, write=True) as record, record.rewrite() as cut:
        assert [event.kind for event in cut.events()][3:] == [Kind.ASKED, Kind.MOVED]


def test_texts_of_other_kinds_come_back_as_text_and_what_cannot_be_kept_is_refused_when_it_is_written(tmp_path):
    path = fill(tmp_path / "run.sqlite", n=3)
    with Record(path, write=True) as record:
        record.add(moved([0.1, 0.2, 0.3])._replace(origin=np.str_("local")))
        for wrong in (
            moved([0.1, 0.2, 0.3])._replace(origin=5),
            moved([0.1, 0.2]),
            moved([0.1, 0.2, 0.3], goal=[0.1]),
        ):
            with pytest.raises(ValueError, match="a record keeps"):
                record.add(wrong)
        record.commit()
    with Record(path) as record:
        assert record.check() == {}
        assert [event.origin for event in record.events()][-1] == "local"
