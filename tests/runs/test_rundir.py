"""The run directory's files: exact numbers, lines that tell whether they are whole, and clear refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sgimd_torch.runs.log import Columns, RunError
from sgimd_torch.runs.read import find_runs, read_run
from sgimd_torch.spaces import Demonstration, Episode, Move

COLUMNS = Columns(1, 2, 1)
numbers = st.floats(allow_nan=False, allow_infinity=False)


def write(path, lines, config="{}"):
    path.mkdir(parents=True)
    (path / "config.json").write_text(config)
    (path / "episodes.csv").write_bytes(COLUMNS.header + b"".join(lines))
    return path


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


def test_a_movement_at_rest_has_neither_theta_nor_outcome(tmp_path):
    demonstration = Demonstration(np.zeros(1), np.zeros(2), np.zeros((2, 1)), np.zeros(1))
    line = COLUMNS.line(Episode(0, np.array([0.5]), None, None, demonstration), 3)
    assert line.startswith(b"0,,3,0.5,,,,,")
    assert COLUMNS.recorded(line) == (None, None)
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
    whole = COLUMNS.whole_lines(bytes(body))
    assert whole == lines[: len(whole)]
    assert sum(map(len, whole)) <= place  # all before the change, none from it on


def test_lines_out_of_order_are_not_a_log():
    lines = [COLUMNS.line(moved(k, [0.1, 0.2]), None) for k in (0, 2, 1)]
    assert COLUMNS.whole_lines(b"".join(lines)) == lines[:1]


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
