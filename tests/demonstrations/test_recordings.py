"""Recordings of other formats become demonstrations: CSV, LeRobot; and are checked against a robot."""

import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sgimd_torch.__main__ import _call
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.columns import Columns, read_csv
from sgimd_torch.demonstrations.lerobot import read_lerobot
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.runs.process import command
from sgimd_torch.spaces import Demonstration

ARM = PlanarArm(7)
NAMES = Columns(joints=("a", "b"), outcome=("x", "y"))
ONE = "time,a,b,x,y\n2.0,0.1,0.2,9,9\n2.5,0.3,0.4,9,9\n3.0,0.5,0.6,0.7,-0.8\n"
LONG = "run,time,a,b,x,y,c\n" + "".join(
    f"{run},{k / 10},{k},{-k},{run == 'two'},{k},{k + 5}\n".replace("True", "1").replace("False", "0")
    for run in ("one", "two")
    for k in range(4)
)
EPISODES = Columns(
    joints=("observation.state[0:2]",),
    outcome=("observation.place[1]", "observation.place[0]"),
    time="timestamp",
    recording="episode_index",
)


def write(path, text):
    path.write_text(text)
    return path


def test_a_csv_file_is_one_recording(tmp_path):
    (shown,) = read_csv(write(tmp_path / "one.csv", ONE), NAMES)
    assert shown.times.tolist() == [0.0, 0.5, 1.0]  # it may begin at any time
    assert shown.trajectory.tolist() == [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]
    assert shown.outcome.tolist() == [0.7, -0.8]  # of the last row
    assert shown.context.shape == (0,)


def test_a_folder_of_csv_files_is_a_recording_each_in_the_order_of_their_names(tmp_path):
    write(tmp_path / "b.csv", ONE)
    write(tmp_path / "a.csv", ONE.replace("0.7", "0.1"))
    write(tmp_path / "notes.txt", "none of them")
    assert [each.outcome[0] for each in read_csv(tmp_path, NAMES)] == [0.1, 0.7]


def test_one_long_table_is_cut_where_the_recording_changes(tmp_path):
    columns = Columns(joints=("b", "a"), outcome=("x",), context=("c",), recording="run")
    one, two = read_csv(write(tmp_path / "long.csv", LONG), columns)
    assert one.trajectory[:, 0].tolist() == [0, -1, -2, -3]
    assert (one.outcome.tolist(), two.outcome.tolist()) == ([0.0], [1.0])
    assert one.context.tolist() == [5.0]  # of the first row


def test_degrees_become_rad(tmp_path):
    columns = Columns(joints=("a", "b"), outcome=("x",), degrees=True)
    (shown,) = read_csv(write(tmp_path / "one.csv", ONE.replace("0.5,0.6", "180,-90")), columns)
    np.testing.assert_allclose(shown.trajectory[-1], [np.pi, -np.pi / 2])


def test_a_file_of_a_spreadsheet_with_a_mark_of_bytes_and_spaces_is_read(tmp_path):
    (tmp_path / "one.csv").write_bytes(b"\xef\xbb\xbf" + ONE.replace(",", " , ").replace("\n", "\r\n").encode())
    assert read_csv(tmp_path / "one.csv", NAMES)[0].outcome.tolist() == [0.7, -0.8]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"one\.csv has no column a, b, x, y, time; it has"),
        (ONE.replace("a,b", "a,c"), r"one\.csv has no column b; it has time, a, c, x, y"),
        (ONE.replace("0.3", "some"), "a must be numbers: .* 'some'"),
        (ONE.replace("0.3", "nan"), r"one\.csv: a must be finite .*, but entry \[1, 0\] is nan"),
        (ONE.replace("2.5", "1.5"), r"one\.csv: time must increase from row to row; were the rows shuffled"),
        (ONE.replace(",9,9\n2.5", ",9,9,9\n2.5"), "row 1 has 6 fields instead of 5"),
        ("\n".join(ONE.splitlines()[:2]), "has 1 sample, but needs 2 or more"),
    ],
)
def test_a_csv_file_that_is_no_recording_is_refused_by_its_name(tmp_path, text, message):
    with pytest.raises(ValueError, match=message) as refused:
        read_csv(write(tmp_path / "one.csv", text), NAMES)
    assert "one.csv" in str(refused.value)


def test_rows_of_a_recording_that_are_apart_and_folders_without_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"holds no \.csv file"):
        read_csv(tmp_path, NAMES)
    columns = Columns(joints=("a",), outcome=("x",), recording="run")
    shuffled = LONG + "one,9,9,9,9,9,9\n"
    with pytest.raises(ValueError, match=r"long\.csv: the rows of recording one are not adjacent"):
        read_csv(write(tmp_path / "long.csv", shuffled), columns)
    with pytest.raises(FileNotFoundError):
        read_csv(tmp_path / "nothing.csv", columns)


def test_columns_are_checked_before_anything_is_read():
    with pytest.raises(ValueError, match="at least one column for joints"):
        Columns(joints=(), outcome=("x",))
    with pytest.raises(ValueError, match=r"'state\[a\]' does not name a column"):
        Columns(joints=("state[a]",), outcome=("x",))


@pytest.fixture
def dataset(tmp_path):
    """Three episodes in two files, in the layout of LeRobot's v3."""
    root = tmp_path / "arm"
    names = ("observation.state", "observation.place", "timestamp", "episode_index")
    info = {"codebase_version": "v3.0", "total_episodes": 3, "total_frames": 15, "features": dict.fromkeys(names)}
    for folder in ("meta", "data/chunk-000"):
        (root / folder).mkdir(parents=True)
    (root / "meta/info.json").write_text(json.dumps(info))
    for file, episodes in enumerate([(0, 1), (2,)]):
        rows = [(episode, frame) for episode in episodes for frame in range(5)]
        columns = (
            pa.array([[episode, frame / 8, 7.0] for episode, frame in rows], pa.list_(pa.float32(), 3)),
            pa.array([[frame, episode / 2] for episode, frame in rows], pa.list_(pa.float32())),
            pa.array([frame / 10 for _, frame in rows], pa.float32()),
            pa.array([episode for episode, _ in rows], pa.int64()),
        )
        table = pa.table(dict(zip(names, columns, strict=True)))
        pq.write_table(table, root / f"data/chunk-000/file-00{file}.parquet")
    return root


def test_a_lerobot_dataset_is_a_recording_for_each_episode(dataset):
    shown = read_lerobot(dataset, EPISODES)
    assert [each.outcome.tolist() for each in shown] == [[0.0, 4.0], [0.5, 4.0], [1.0, 4.0]]
    assert shown[2].trajectory.tolist() == [[2.0, frame / 8] for frame in range(5)]
    np.testing.assert_allclose(shown[1].times, np.arange(5) / 10, atol=1e-7)


def test_all_entries_of_a_vector_are_its_bare_name(dataset):
    columns = Columns(("observation.state",), ("observation.place",), time="timestamp", recording="episode_index")
    assert read_lerobot(dataset, columns)[0].trajectory.shape == (5, 3)


def change(dataset, **changes):
    path = dataset / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (
            lambda root: change(root, codebase_version="v2.1"),
            r"has format v2\.1, this library reads v3; lerobot",
        ),
        (lambda root: change(root, features={"action": {}}), r"has no feature observation\.state, .*; it has action"),
        (lambda root: change(root, total_episodes=4), "says 4 episodes, but 3 were found; is a file missing"),
        (lambda root: (root / "data/chunk-000/file-001.parquet").unlink(), "says 15 frames, but 10 were found"),
        (lambda root: (root / "meta/info.json").unlink(), r"is no LeRobot dataset: it has no meta/info\.json"),
        (lambda root: (root / "meta/info.json").write_text("{"), r"info\.json is no json"),
        (
            lambda root: [file.unlink() for file in (root / "data/chunk-000").iterdir()],
            "were only its videos copied",
        ),
        (
            lambda root: (root / "data/chunk-000/file-001.parquet").write_bytes(b"PAR1 of another kind"),
            r"file-001\.parquet cannot be read",
        ),
    ],
)
def test_a_dataset_that_is_damaged_or_of_another_kind_is_refused(dataset, harm, message):
    harm(dataset)
    with pytest.raises(ValueError, match=message):
        read_lerobot(dataset, EPISODES)


@pytest.mark.parametrize("entry", ["observation.state[2:4]", "observation.state[3]", "observation.state[2:2]"])
def test_an_entry_that_a_vector_does_not_have_is_refused(dataset, entry):
    columns = Columns((entry,), ("observation.place",), time="timestamp", recording="episode_index")
    with pytest.raises(ValueError, match=re.escape(f"there is no {entry}: observation.state has 3 entries")):
        read_lerobot(dataset, columns)


def sgimd(*words):
    return command(_call, ["demonstrations", *map(str, words)])


def test_a_dataset_is_imported_into_a_file_of_ours(dataset, tmp_path, capsys):
    named = ("--joints", "observation.state[0:2]", "--outcome", "observation.place")
    assert sgimd("import", dataset, *named, "--out", tmp_path / "shown.npz") == 0
    assert "3 recordings, 2 joints" in capsys.readouterr().out
    shown = load_demonstrations(tmp_path / "shown.npz", n_joints=2, outcome_dim=2, context_dim=0)
    assert shown[1].trajectory.tolist() == read_lerobot(dataset, EPISODES)[1].trajectory.tolist()


def led(angle, ends_at=None, degrees=False):
    """The arm led to a posture of equal bends, as recorded."""
    posture = np.full(7, angle)
    times = np.linspace(0, 1, 6)
    outcome = np.zeros(2) if ends_at is None else np.asarray(ends_at)
    trajectory = np.outer(times, np.rad2deg(posture) if degrees else posture)
    return Demonstration(np.zeros(0), times, trajectory, outcome)


def lands(angle):
    return ARM.execute(
        np.zeros(0), ARM.correspondence([0.0, 1.0], np.outer([0, 1], np.full(7, angle))), np.random.default_rng(0)
    )


def test_check_says_where_each_lands(tmp_path, capsys):
    file = tmp_path / "shown.npz"
    save_demonstrations(file, [led(0.1, lands(0.1)), led(0.3, [0.5, 0.5])])
    assert sgimd("check", file, "--task", "planar-arm-7") == 0
    said = capsys.readouterr().out.splitlines()
    assert [word for line in said[1:3] for word in (line.split()[0], line.split()[1])] == ["0", "1", "1", "1"]
    assert "0.000" in said[1]
    assert f"{np.linalg.norm(lands(0.3) - 0.5):.3f}" in said[2]
    assert said[-1].startswith("2 of 2 can be used; they land")


def test_check_says_whose_movement_has_no_outcome(tmp_path, capsys, monkeypatch):
    def execute(self, context, theta, rng):
        raise SimulationError("it hit the table")

    save_demonstrations(tmp_path / "shown.npz", [led(0.1, lands(0.1))])
    monkeypatch.setattr(PlanarArm, "execute", execute)
    assert sgimd("check", tmp_path / "shown.npz", "--task", "planar-arm-7") == 2
    assert "cannot be used: it hit the table" in capsys.readouterr().out


def test_check_names_those_that_cannot_be_used_and_exits_with_2(tmp_path, capsys):
    save_demonstrations(tmp_path / "shown.npz", [led(0.1, lands(0.1)), led(0.8, [0.0, 0.0], degrees=True)])
    assert sgimd("check", tmp_path / "shown.npz", "--task", "planar-arm-7") == 2
    said = capsys.readouterr()
    assert "cannot be used: the first joint turns within" in said.out
    assert re.search(
        "error: 1 of 2 recordings of .*shown.npz cannot be used; the first is recording 1: .* in deg", said.err
    )


ROD = 'import numpy as np\nfrom sgimd_torch import GaussianPrimitive, PlanarArm, Box\n' \
    'class Slow(PlanarArm):\n' \
    '    primitive = GaussianPrimitive(Box.cube(-1, 1, 2), (0.8, 1.6))\n' \
    '    def __init__(self):\n        super().__init__(9)\n' \
    '    correspondence = staticmethod(primitive.correspondence)\n'  # fmt: skip


@pytest.fixture
def slow(module):
    """A robot with ranges and durations, in the working directory."""
    module("my_slow", ROD)
    return "my_slow:Slow"


def test_what_lies_outside_the_limits_of_speed_and_range_is_remarked(slow, tmp_path, capsys):
    def recording(seconds, top, outcome=(0.2, 0.2)):
        times = np.linspace(0, seconds, 20)
        return Demonstration(np.zeros(0), times, np.stack([top * np.sin(times), 0 * times], axis=1), np.array(outcome))

    file = tmp_path / "shown.npz"
    save_demonstrations(
        file, [recording(1.0, 0.5), recording(0.4, 0.5), recording(1.5, 2.0), recording(1.0, 0.5, (9, 9))]
    )
    assert sgimd("check", file, "--task", slow) == 0
    fine, fast, wide, far, _ = capsys.readouterr().out.splitlines()[1:]
    assert float(fine.split()[-1]) < 0.01  # the misfit, and no remark
    assert "too fast: movements last 0.8 to 1.6 s" in fast
    assert re.search(r"joint 0 is 1.\d+ at sample 7, outside its range \[-1, 1\]", wide)
    assert "its outcome is outside T: a learner imitates it, but never takes it as a goal" in far
    save_demonstrations(file, [recording(5.0, 0.5)])
    assert sgimd("check", file, "--task", slow) == 2
    assert "a movement lasts 1.6 s at most, the recording 5 s" in capsys.readouterr().out
