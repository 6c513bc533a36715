"""The run directory's files: exact numbers, lines that show whether they were changed, clear refusals."""

import tracemalloc
import zlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sgimd_torch.runs.log import Columns, RunError
from sgimd_torch.runs.tables import sealed, small_table

from sgimd_torch.runs.read import find_runs, read_run
from sgimd_torch.spaces import Demonstration, Episode, Move

COLUMNS = Columns(1, 2, 1)
numbers = st.floats(allow_nan=False, allow_infinity=False)


def write(path, lines, config="{}"):
    path.mkdir(parents=True)
    (path / "config.json").write_text(config)
    (path / "episodes.csv").write_bytes(COLUMNS.header + b"".join(lines))
    return path


def whole_lines(body):
    return COLUMNS.table(Path()).parse(COLUMNS.header + body).lines


def moved(index, theta, goal=None, outcome=0.5):
    goal = None if goal is None else np.array([goal])
    return Episode(index, np.array([0.25]), Move(np.array(theta), goal, "local"), np.array([outcome]), None)


def test_a_line_names_what_was_done_and_ends_in_its_checksum():
    line = COLUMNS.line(moved(7, [0.1, 0.2], goal=-0.5), 12)
    assert line.startswith(b"7,local,12,0.25,0.1,0.2,-0.5,0.5,")
    assert COLUMNS.header == b"index,origin,demonstration,context_0,theta_0,theta_1,goal_0,outcome_0,crc32\n"


@given(st.lists(st.tuples(numbers, numbers, st.none() | numbers, numbers), max_size=5))
def test_numbers_are_read_back_exactly(tmp_path_factory, rows):
    lines = [COLUMNS.line(moved(k, [a, b], goal, outcome), None) for k, (a, b, goal, outcome) in enumerate(rows)]
    run = read_run(write(tmp_path_factory.mktemp("run") / "here", lines))
    wanted = np.array([[0.25, a, b, np.nan if goal is None else goal, outcome] for a, b, goal, outcome in rows])
    found = np.concatenate((run.contexts, run.thetas, run.goals, run.outcomes), axis=1)
    assert found.tobytes() == wanted.reshape(-1, 5).tobytes()


def test_a_replay_reads_its_log_in_memory_of_a_few_times_its_size(tmp_path):
    """The content, its lines and the numbers of each; the fields of all lines at once would take twice as much."""
    columns = Columns(0, 7, 2)
    thetas = np.random.default_rng(0).random((5000, 7))
    moves = (Episode(k, np.zeros(0), Move(t, t[:2], "local"), t[2:4], None) for k, t in enumerate(thetas))
    path = tmp_path / "episodes.csv"
    path.write_bytes(columns.header + b"".join(columns.line(move, None) for move in moves))
    tracemalloc.start()
    recorded = columns.recorded(columns.table(tmp_path).read().lines)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert len(recorded) == 5000
    assert most < 5 * path.stat().st_size


def test_a_movement_at_rest_has_neither_theta_nor_outcome(tmp_path):
    demonstration = Demonstration(np.zeros(1), np.zeros(2), np.zeros((2, 1)), np.zeros(1))
    line = COLUMNS.line(Episode(0, np.array([0.5]), None, None, demonstration), 3)
    assert line.startswith(b"0,,3,0.5,,,,,")
    assert COLUMNS.recorded([line]) == [(None, None)]
    run = read_run(write(tmp_path / "run", [line]))
    assert run.origin.tolist() == [""]
    assert run.demonstration.tolist() == [3]
    assert np.isnan(run.thetas).all()


@given(st.data())
def test_no_changed_byte_passes_for_a_whole_line(data):
    lines = [COLUMNS.line(moved(k, [0.1 * k, 0.2]), None) for k in range(3)]
    body = bytearray(b"".join(lines))
    place = data.draw(st.integers(0, len(body) - 1))
    body[place] = data.draw(st.integers(0, 255).filter(lambda byte: byte != body[place]))
    whole = whole_lines(bytes(body))
    assert whole == lines[: len(whole)]
    assert sum(map(len, whole)) <= place  # all before the change, none from it on


def test_lines_out_of_order_are_not_a_log():
    lines = [COLUMNS.line(moved(k, [0.1, 0.2]), None) for k in (0, 2, 1)]
    assert whole_lines(b"".join(lines)) == lines[:1]


ROWS = {  # of each table, two that can be: dimensions, and rows
    "evaluation.csv": (0, ["30,own,0.25,0.2,0.5,nan,2", "60,own,0.125,0.1,0.25,0.01,3"]),
    "by_context.csv": (0, ["30,own,0,-1.0,1.0,7,0.25", "60,own,0,-1.0,1.0,7,0.125"]),
    "regions.csv": (1, ["30,R0,-1.0,0.0,7,5,-0.5,0.25", "30,R1,0.0,1.0,0,0,nan,0.0"]),
    "predictions.csv": (1, ["50,0.5,0.25,0.1,0.2", "51,-0.5,-0.25,0.1,0.2"]),
    "refreshes.csv": (0, ["50,50,15,-0.25,0.5,0", "100,98,15,0.75,0.25,1"]),
}


def content_of(name, rows, *, checked=True):
    """The file of a table, as it is written today, or by versions without checksums."""
    table = small_table(Path(name), ROWS[name][0])
    if checked:
        return table.header + b"".join(sealed(row.split(",")) for row in rows)
    return "".join(f"{line}\n" for line in (",".join(table.names), *rows)).encode()


def run_with(path, name, content):
    (write(path / "run", []) / name).write_bytes(content)
    return read_run(path / "run")


@pytest.mark.parametrize("name", ROWS)
@given(data=st.data())
def test_no_changed_byte_of_a_table_passes_for_a_whole_line(name, data):
    dims, rows = ROWS[name]
    table, content = small_table(Path(name), dims), bytearray(content_of(name, rows))
    place = data.draw(st.integers(len(table.header), len(content) - 1))
    content[place] = data.draw(st.integers(0, 255).filter(lambda byte: byte != content[place]))
    found = table.parse(bytes(content))
    whole = [sealed(row.split(",")) for row in rows][: len(found.lines)]
    assert found.lines == whole
    assert found.size == len(table.header) + sum(map(len, whole)) <= place
    assert found.bad == 2 + len(whole)


@pytest.mark.parametrize("checked", [True, False])
@pytest.mark.parametrize("name", ROWS)
def test_a_table_is_read_with_its_checksums_and_without(tmp_path, name, checked):
    dims, rows = ROWS[name]
    run = run_with(tmp_path, name, content_of(name, rows, checked=checked))
    assert run.damage == {}
    assert run.unchecked == (() if checked else (name,))
    columns = getattr(run, name.removesuffix(".csv"))
    apart = {"answer"} if name == "evaluation.csv" else set()  # a set of columns for each answer
    assert tuple(columns) == tuple(each for each in small_table(Path(name), dims).names if each not in apart)
    for k, row in enumerate(rows):
        fields = row.replace(",own", "") if apart else row
        for field, column in zip(fields.split(","), columns.values(), strict=True):
            assert column[k] == (field if column.dtype.kind == "U" else pytest.approx(float(field), nan_ok=True))


@pytest.mark.parametrize("checked", [True, False])
def test_an_error_edited_to_below_zero_is_noticed(tmp_path, checked):
    """Its line, and all after it, are left out."""
    content = content_of("evaluation.csv", ROWS["evaluation.csv"][1], checked=checked)
    run = run_with(tmp_path, "evaluation.csv", content.replace(b"0.125", b"-5"))
    assert run.damage == {"evaluation.csv": 3}
    assert run.evaluation["movements"].tolist() == [30]


@pytest.mark.parametrize(
    ("name", "was", "edited"),
    [
        ("evaluation.csv", "own,0.125", "own,nan"),
        ("evaluation.csv", "own,", ","),
        ("evaluation.csv", "0.125", "inf"),
        ("evaluation.csv", "60,", "6e1,"),
        ("evaluation.csv", "60,", ""),
        ("regions.csv", "R1", "R2"),
        ("regions.csv", "nan,0.0", "nan,nan"),
        ("regions.csv", "0,0,nan", "0,0,0.5"),
        ("predictions.csv", "51,-0.5", "51,nan"),
        ("predictions.csv", "-0.25,0.1", "-0.25,-0.1"),
        ("predictions.csv", "51,", "51.5,"),
        ("refreshes.csv", "0.75", "nan"),
    ],
)
def test_without_checksums_impossible_values_are_refused_with_their_line(tmp_path, name, was, edited):
    first, second = ROWS[name][1]
    assert was in second
    run = run_with(tmp_path, name, content_of(name, [first, second.replace(was, edited)], checked=False))
    assert run.damage == {name: 2 if name == "regions.csv" else 3}  # half a map is none
    assert run.unchecked == (name,)


def test_a_last_line_without_its_end_is_damage_only_where_a_file_is_replaced_whole(tmp_path):
    path = write(tmp_path / "run", [COLUMNS.line(moved(k, [0.1, 0.2]), None) for k in range(3)])
    for name, (_, rows) in ROWS.items():
        (path / name).write_bytes(content_of(name, rows)[:-1])
    (path / "episodes.csv").write_bytes((path / "episodes.csv").read_bytes()[:-9])
    run = read_run(path)
    assert len(run.index) == 2
    assert len(run.predictions["exemplar"]) == len(run.refreshes["movements"]) == 1
    assert run.damage == {"evaluation.csv": 3, "by_context.csv": 3, "regions.csv": 2}


@pytest.mark.parametrize(
    ("name", "content", "damaged"),
    [
        ("evaluation.csv", b"", True),  # it is replaced whole, header and all
        ("regions.csv", b"", True),
        ("predictions.csv", b"", False),  # its header has not come yet
        ("predictions.csv", b"exemplar,outco", False),
        ("predictions.csv", b"exemplar,out\xff\x00", True),
        ("refreshes.csv", b"movements;", True),
    ],
)
def test_a_table_without_a_whole_header_is_damaged_unless_it_has_just_begun(tmp_path, name, content, damaged):
    path = write(tmp_path / "run", [])
    (path / name).write_bytes(content)
    assert read_run(path).damage == ({name: 1} if damaged else {})


@pytest.mark.parametrize("field", [b"x", b"", b"1e300", b"9" * 30, b"\xff"])
def test_a_line_that_no_run_writes_is_refused_by_the_name_of_the_run_though_its_checksum_is_right(tmp_path, field):
    path = write(tmp_path / "run", [])
    body = b",".join([field, b"100", b"15", b"0.5", b"0.2", b"0"])
    line = body + b",%08x\n" % zlib.crc32(body)
    (path / "refreshes.csv").write_bytes(b"movements,exemplars,steps,held_out,relative_error,diverged,crc32\n" + line)
    with pytest.raises(RunError, match=r"run has a table that holds what no run writes .*was it edited"):
        read_run(path)


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a": ' * 100_000, '{"a": ' + "1" * 5000 + "}", " " * (2**24 + 1)])
def test_json_that_is_too_deep_or_too_long_is_refused_by_its_name(tmp_path, content):
    path = write(tmp_path / "run", [], config=content)
    with pytest.raises(RunError, match=r"config\.json cannot be read"):
        read_run(path)


def test_a_bad_line_before_others_is_damage_of_the_log(tmp_path):
    lines = [COLUMNS.line(moved(k, [0.1, 0.2]), None) for k in range(3)]
    run = read_run(write(tmp_path / "run", [lines[0], lines[1].replace(b"0.1", b"0.2"), lines[2]]))
    assert len(run.index) == 1
    assert run.damage == {"episodes.csv": 3}


@pytest.mark.parametrize(
    ("paths", "whole"),
    [
        (["R"], True),
        (["R0", "R10", "R11"], True),
        (["R0", "R10"], False),
        (["R.0.0", "R.0.1", "R.1.0", "R.1.1"], True),
        (["R.0.0", "R.0.1", "R.1.0"], False),
        (["R.3.7"], False),
        (["left", "right"], True),  # names of a goal model that we do not know
    ],
)
def test_regions_of_a_tree_or_a_grid_are_all_there_or_count_as_damaged(tmp_path, paths, whole):
    rows = [f"{movements},{path},0.0,1.0,0,0,nan,0.0" for movements in (30, 60) for path in paths]
    rows[: len(paths)] = ["30,R,0.0,1.0,0,0,nan,0.0"]
    run = run_with(tmp_path, "regions.csv", content_of("regions.csv", rows))
    assert run.damage == ({} if whole else {"regions.csv": 3})
    assert run.regions["path"].tolist() == ["R", *paths * whole]


@pytest.mark.parametrize("origin", ["a,b", "two\nlines", "\x00"])
def test_a_name_that_would_be_read_back_as_something_else_is_refused(origin):
    with pytest.raises(ValueError, match="must be printable and without commas"):
        COLUMNS.line(Episode(0, np.zeros(1), Move(np.zeros(2), None, origin), np.zeros(1), None), None)


def test_what_is_no_run_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "nowhere"):
        with pytest.raises(RunError, match=r"no run directory.*config\.json"):
            read_run(path)
    with pytest.raises(RunError, match="holds no runs"):
        find_runs(tmp_path)
    with pytest.raises(RunError, match="cannot be read"):
        read_run(write(tmp_path / "torn", [], config='{"algo'))
    with pytest.raises(RunError, match="must hold a json object"):
        read_run(write(tmp_path / "list", [], config="[]"))
    (write(tmp_path / "edited", []) / "episodes.csv").write_text("time;theta\n")
    with pytest.raises(RunError, match="names of its columns"):
        read_run(tmp_path / "edited")


def test_a_run_that_has_just_begun_is_read_as_empty(tmp_path):
    run = read_run(write(tmp_path / "run", []))
    assert run.thetas.shape == (0, 2)
    assert run.evaluation["mean_error_m"].shape == (0,)
    assert run.regions is None
    (tmp_path / "run" / "episodes.csv").unlink()
    assert len(read_run(tmp_path / "run").index) == 0


def test_runs_are_found_by_name_and_seed(tmp_path):
    for name, seed in (("b", 10), ("b", 2), ("a", 0)):
        write(tmp_path / name / f"seed-{seed:03d}", [])
    found = find_runs(tmp_path)
    assert list(found) == ["a", "b"]
    assert [path.name for path in found["b"]] == ["seed-002", "seed-010"]
    assert find_runs(tmp_path / "b") == {"b": found["b"]}
    assert find_runs(found["b"][1]) == {"b": [found["b"][1]]}
