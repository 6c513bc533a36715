"""Recordings as people have them become demonstrations: text, LeRobot; and are checked against a robot."""

import json
import os
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from sgimd_torch.__main__ import _call
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.demonstrations.columns import ColumnNames
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.runs.signals import command
from sgimd_torch.spaces import Demonstration

ARM = PlanarArm(7)
ONE = "time,a,b,x,y\n2.0,0.1,0.2,9,9\n2.5,0.3,0.4,9,9\n3.0,0.5,0.6,0.7,-0.8\n"
BARE = ONE.partition("\n")[2]
UNTIMED = "b,a,x,y\n0.2,0.1,9,9\n0.4,0.3,9,9\n0.6,0.5,0.7,-0.8\n"
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 9\n"
NAMED = "--joints a,b --outcome x,y"


def sgimd(*words):
    return command(_call, ["demonstrations", *map(str, words)])


def degrees(text):
    """The joints of ``ONE`` in degrees."""
    for each in ("0.1,0.2", "0.3,0.4", "0.5,0.6"):
        text = text.replace(each, ",".join(repr(float(np.rad2deg(float(x)))) for x in each.split(",")))
    return text


def commas(text, divided):
    return text.replace(",", divided).replace(".", ",")


# Texts that hold the recording of ONE, and the options that read them.
RIGHT = {
    "commas": (ONE, NAMED),
    "another order of columns": (ONE.replace("a,b,x,y", "b,a,y,x"), "--joints b,a --outcome y,x"),
    "spaces around commas, a mark of bytes, ends of Windows": (
        "\ufeff" + ONE.replace(",", " , ").replace("\n", "\r\n"),
        NAMED,
    ),
    "blank lines": (ONE.replace("\n", "\n\n"), NAMED),
    "quotes": (ONE.replace("time", '"time"').replace("0.1", '"0.1"'), NAMED),
    "semicolons": (ONE.replace(",", ";"), NAMED),
    "tabs": (ONE.replace(",", "\t"), NAMED),
    "spaces": (ONE.replace(",", "   "), NAMED),
    "spaces at both ends": (ONE.replace(",", " ").replace("\n", " \n "), NAMED),
    "semicolons and decimal commas": (commas(ONE, ";"), NAMED),
    "tabs and decimal commas": (commas(ONE, "\t"), NAMED),
    "spaces and decimal commas": (commas(ONE, " "), NAMED),
    "names with spaces and units": (
        ONE.replace("time", "time (s)").replace("a,b", "joint a,joint b"),
        "--time=time_(s) --joints joint_a,joint_b --outcome x,y",
    ),
    "no names": (BARE, f"{NAMED} --columns time,a,b,x,y"),
    "no names, spaces": (BARE.replace(",", " "), f"{NAMED} --columns time,a,b,x,y"),
    "no names, decimal commas": (commas(BARE, ";"), f"{NAMED} --columns time,a,b,x,y"),
    "names in a remark, as numpy writes them": ("# " + ONE.replace(",", " "), NAMED),
    "remarks before the names": ("# arm 3\n% by hand\n" + ONE, NAMED),
    "no time": (UNTIMED, f"{NAMED} --rate 2"),
    "no names, no time": (UNTIMED.partition("\n")[2], f"{NAMED} --rate 2 --columns b,a,x,y"),
    "no zero before the point": (ONE.replace("0.", "."), NAMED),
    "a number for each row": (ONE.replace("\n", "\n7,")[:-2].replace("time", ",time", 1), NAMED),
    "a comma at each end": (ONE.replace("\n", ",\n"), NAMED),
    "ends of old machines": (ONE.replace("\n", "\r"), NAMED),
    "exponents": (ONE.replace("0.1", "1e-1").replace("0.7", "+7.0E-01"), NAMED),
    "degrees": (degrees(ONE), f"{NAMED} --unit deg"),
    "degrees by joint": (degrees(ONE), f"{NAMED} --unit a=deg,b=deg"),
    "degrees of all but one": (ONE.replace("0.2", "0.2"), f"{NAMED} --unit deg,a=rad,b=rad"),
    "twice as slow": (ONE.replace("2.5", "3.0").replace("3.0,0.5", "4.0,0.5"), f"{NAMED} --speed 2"),
    "a vector": (ONE, "--joints a,b[0] --outcome x,y"),
}
REFUSED = {
    "nothing": ("", NAMED, "it has no column a; it has"),
    "another name": (ONE.replace("a,b", "a,c"), NAMED, "it has no column b; it has time, a, c, x, y"),
    "a name twice": (
        ONE.replace("x,y", "b,y"),
        "--joints a,b --outcome y",
        "it has two columns b; it has time, a, b, b, y",
    ),
    "no time": (UNTIMED, NAMED, "it has no column time; .* without times, give --rate"),
    "no names": (BARE, NAMED, "its first row has numbers, no names; name its columns with --columns"),
    "names that were given, too": (
        ONE,
        f"{NAMED} --columns time,a,b,x,y",
        "row 1: a is 'a', no number; the first row names the columns, so leave out --columns",
    ),
    "numbers for names": (f"0,1,2,3,4\n{BARE}", f"{NAMED} --columns time,a,b,x,y", "0,1,2,3,4, may number the columns"),
    "too few names": (BARE, f"{NAMED} --columns time,a,b,x", "it has no column y"),
    "too many names": (BARE, f"{NAMED} --columns time,a,b,x,y,z", "row 1 has 5 fields instead of 6"),
    "a word": (ONE.replace("0.3", "some"), NAMED, "row 3: a is 'some', no number; is a field missing"),
    "a gap": (ONE.replace("0.3", ""), NAMED, "row 3: a is '', no number"),
    "no number": (ONE.replace("0.3", "nan"), NAMED, "row 3: a is 'nan', no number"),
    "a number of Python": (ONE.replace("0.3", "1_0"), NAMED, "row 3: a is '1_0', no number"),
    "hexadecimals": (ONE.replace("0.3", "0x3"), NAMED, "row 3: a is '0x3', no number"),
    "a minus that is none": (ONE.replace("0.1", "\u22120.1"), NAMED, "row 2: a is '\u22120.1', no number; is a field"),
    "dates": ("time,a,b,x,y\n" + "1-1 9:00,0.1,0.2,9,-\n" * 2, NAMED, "row 2: y is '-', no number"),
    "points and commas in a number": (
        ONE.replace(",", ";").replace("0.3", "1.000,3"),
        NAMED,
        "row 3: a is '1.000,3', no number",
    ),
    "decimal commas between commas": (ONE.replace("0.", "0,"), NAMED, "row 2 has 7 fields instead of 5"),
    "a remark between rows": (ONE.replace("\n2.5", "\n# lost\n2.5"), NAMED, "row 3 has 1 fields instead of 5"),
    "a name over two lines": (ONE.replace("time", '"time\ns"'), NAMED, "it has no column"),
    "a file of one sign": ("0" * 200_000, NAMED, "it is no table: field larger than"),
    "no end of digits": (ONE.replace("0.3", "9" * 400), NAMED, "row 3: a must be finite, got"),
    "a field without end": (ONE.replace("0.3", "9" * 200_000), NAMED, "it is no table: field larger than"),
    "times that fall": (ONE.replace("2.5", "1.5"), NAMED, "row 3: time must increase from row to row; were rows shuf"),
    "times that stay": (ONE.replace("2.5", "2.0"), NAMED, "row 3: time must increase"),
    "a field too many": (ONE.replace(",9,9\n2.5", ",9,9,9\n2.5"), NAMED, "row 2 has 6 fields instead of 5"),
    "one row": ("\n".join(ONE.splitlines()[:2]), NAMED, "it has 1 sample, but needs 2 or more"),
    "no rows": (ONE.splitlines()[0], NAMED, "it has no rows below the names"),
    "thousands": (ONE.replace(",", ";").replace("2.5", "2,500"), NAMED, "decimal commas beside points"),
    "quoted thousands": (ONE.replace(".", "").replace("25", '"2,500"'), NAMED, "or beside commas between columns"),
    "a pointer": (POINTER, NAMED, "it is a pointer of Git LFS, not the file itself; git lfs pull"),
    "UTF-16": (ONE.replace("", "\0"), NAMED, "it has a NUL, .* was it saved as UTF-16"),
    "degrees": (
        degrees(ONE),
        NAMED,
        "a reads up to 28.65 in one.txt, more than a turn in rad; say its unit: --unit a=deg",
    ),
    "degrees of one joint": (degrees(ONE), f"{NAMED} --unit a=deg", "b reads up to 34.38 .* --unit b=deg"),
    "an unknown unit": (ONE, f"{NAMED} --unit a=turns", "the unit of a must be rad, deg or a range .*, got turns"),
    "a range the wrong way": (
        ONE,
        f"{NAMED} --unit a=100:0",
        "the unit of a must be rad, deg or a range .*, got 100:0",
    ),
    "a range without a robot": (ONE, f"{NAMED} --unit a=0:100", "a=0:100 maps onto the range of a joint of a robot"),
    "a unit of no joint": (ONE, f"{NAMED} --unit c=deg", "no joint is named c; did you mean"),
    "stillness": (ONE.replace("0.3,0.4", "0.1,0.2").replace("0.5,0.6", "0.1,0.2"), f"{NAMED} --trim", "no joint moved"),
    "a jerk": (
        ONE.replace("2.0,", "1.999,9.1,0.2,9,9\n2.0,").replace("2.5", "8.5").replace("3.0,", "11.,"),
        f"{NAMED} --trim --unit rad",
        "it moves in 1 of 3 steps and else hardly; has it a jerk",
    ),
    "an entry of a number": (ONE, "--joints a[1] --outcome x", r"there is no a\[1\]: a has 1 entries"),
    "no outcome": (ONE, "--joints a,b", "needs outcomes: name their columns with --outcome .* with --environment"),
    "no joints": (ONE, "--outcome x,y", "name its columns of joints: --joints"),
    "times and a rate": (ONE, f"{NAMED} --time time --rate 5", "not allowed with argument"),
    "a rate of nothing": (ONE, f"{NAMED} --rate 0", "must be above 0, got 0"),
    "options of a robot without one": (
        ONE,
        f"{NAMED} --environment.noise 0",
        "is no option of .*, or needs --environment",
    ),
}


def imported(tmp_path, text, words):
    """The exit code of an import of a text."""
    (tmp_path / "one.txt").write_bytes(text.encode())
    words = [word.replace("_", " ") for word in words.split()]
    return sgimd("import", tmp_path / "one.txt", *words, "--out", tmp_path / "shown.npz")


@pytest.mark.parametrize("kind", RIGHT)
def test_a_text_is_read_whatever_divides_its_columns_and_names_them(tmp_path, kind):
    assert imported(tmp_path, *RIGHT[kind]) == 0
    (shown,) = load_demonstrations(tmp_path / "shown.npz")
    np.testing.assert_allclose(shown.times, [0.0, 0.5, 1.0])  # they may begin at any time
    np.testing.assert_allclose(shown.trajectory, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], rtol=1e-12)
    assert shown.outcome.tolist() == [0.7, -0.8]  # of the last row
    assert shown.context.shape == (0,)


@pytest.mark.parametrize("kind", REFUSED)
def test_a_text_that_could_be_read_wrongly_is_refused_in_a_line(tmp_path, capsys, kind):
    text, words, told = REFUSED[kind]
    try:
        code = imported(tmp_path, text, words)
    except SystemExit as end:  # of the parser of options
        code = end.code
    assert code == 2
    said = capsys.readouterr().err
    assert re.search(f"error: .*{told}", said), said
    assert said.count("error:") == 1
    assert not (tmp_path / "shown.npz").exists()


LONG = "run,time,a,b,x,y,c\n" + "".join(
    f"{run},{k / 10},{k},{-k},{int(run == 'two')},{k},{k + 5}\n" for run in ("one", "two") for k in range(4)
)
OF_LONG = ("--joints=b,a", "--outcome=x", "--context=c", "--recording=run")


def test_a_folder_is_a_recording_for_each_file_in_the_order_of_their_names(tmp_path):
    for name, text in (("b", ONE), ("a", ONE.replace("0.7", "0.1"))):
        (tmp_path / f"{name}.csv").write_text(text)
    (tmp_path / "notes.txt").write_text("none of them")
    assert sgimd("import", tmp_path, *NAMED.split(), "--out", tmp_path / "shown.npz") == 0
    assert [each.outcome[0] for each in load_demonstrations(tmp_path / "shown.npz")] == [0.1, 0.7]


def test_recordings_of_a_file_of_ours_are_mended_too(tmp_path):
    times = np.arange(30) / 10
    joints = np.rad2deg(np.clip(times - 1, 0, 1))[:, None]
    save_demonstrations(tmp_path / "deg.npz", [Demonstration(np.zeros(0), times, joints, np.zeros(2))])
    words = ("--unit", "deg", "--trim", "--speed", 2)
    assert sgimd("import", tmp_path / "deg.npz", *words, "--out", tmp_path / "shown.npz") == 0
    (shown,) = load_demonstrations(tmp_path / "shown.npz")
    np.testing.assert_allclose(shown.times, np.arange(11) / 20, atol=1e-12)
    np.testing.assert_allclose(shown.trajectory[[0, -1], 0], [0, 1], atol=1e-12)


def test_one_long_table_is_cut_where_the_recording_changes(tmp_path, capsys):
    table = tmp_path / "long.csv"
    table.write_text(LONG)
    assert sgimd("import", table, *OF_LONG, "--out", tmp_path / "shown.npz") == 0
    one, two = load_demonstrations(tmp_path / "shown.npz")
    assert one.trajectory[:, 0].tolist() == [0, -1, -2, -3]
    assert (one.outcome.tolist(), two.outcome.tolist()) == ([0.0], [1.0])
    assert one.context.tolist() == [5.0]  # of the first row
    table.write_text(LONG + "one,9,9,9,9,9,9\n")
    assert sgimd("import", table, *OF_LONG, "--out", tmp_path / "shown.npz") == 2
    assert "the rows of recording one are not adjacent; sort them by run and time" in capsys.readouterr().err


def test_recordings_that_cannot_be_used_are_named_and_left_out_when_asked(tmp_path, capsys):
    (tmp_path / "long.csv").write_text(LONG.replace("two,0.2,2", "two,0.2,?"))
    command = ("import", tmp_path / "long.csv", *OF_LONG, "--out", tmp_path / "shown.npz")
    assert sgimd(*command) == 2
    why = "long.csv: run two: row 8: a is '?', no number; is a field missing?"
    told = capsys.readouterr().err
    assert f"1 of 2 recordings of {tmp_path / 'long.csv'} cannot be used; the first is {why}" in told
    assert "--skip-unusable leaves such out" in told
    assert not (tmp_path / "shown.npz").exists()
    assert sgimd(*command, "--skip-unusable") == 0
    assert f"left out {why}" in capsys.readouterr().err
    assert len(load_demonstrations(tmp_path / "shown.npz")) == 1
    (tmp_path / "long.csv").write_text(LONG.replace("run,time", "run,t"))
    assert sgimd(*command, "--skip-unusable") == 2  # none is left


def test_folders_without_texts_and_places_without_a_file_are_refused(tmp_path, capsys):
    os.mkfifo(tmp_path / "pipe.npz")
    for place, told in (
        (".", r"holds no \.csv, \.tsv, \.txt, \.dat file"),
        ("no.csv", r"no\.csv cannot be read or written: No such file"),
        ("\udcff\x1b[31m\n.csv", r"'.*\\udcff\\x1b\[31m\\n\.csv' cannot be read or written: No such file"),
        ("pipe.npz", "pipe.npz is a pipe or a device, not a file"),
    ):
        assert sgimd("import", tmp_path / place, *NAMED.split(), "--out", tmp_path / "shown.npz") == 2
        said = capsys.readouterr().err
        assert re.fullmatch(f"error: .*{told}.*\n", said), said


def test_columns_are_checked_before_anything_is_read():
    with pytest.raises(ValueError, match=r"'state\[a\]' does not name a column"):
        ColumnNames(joints=("state[a]",), outcome=("x",))


STATE, PLACE = "observation.state", "observation.place"
FEATURES = {
    STATE: {"shape": [3], "names": ["pan.pos", "lift.pos", "gripper.pos"]},
    PLACE: {"shape": [2], "names": [["x", "y"]]},
    "action": {"shape": [3], "names": {"motors": ["pan.pos", "x", "grip"]}},
    "timestamp": {"shape": [1], "names": 7},
    "episode_index": {"shape": [1], "names": None},
}


@pytest.fixture(params=["v3.0", "v2.1"])
def dataset(request, tmp_path):
    """Three episodes in the layout of LeRobot: in two files of v3, or in three of v2.1."""
    root, v3 = tmp_path / "arm", request.param == "v3.0"
    info = {"codebase_version": request.param, "total_episodes": 3, "total_frames": 15, "features": FEATURES}
    for folder in ("meta", "data/chunk-000"):
        (root / folder).mkdir(parents=True)
    (root / "meta/info.json").write_text(json.dumps(info))
    for file, episodes in enumerate([(0, 1), (2,)] if v3 else [(0,), (1,), (2,)]):
        rows = [(episode, frame) for episode in episodes for frame in range(5)]
        columns = (
            pa.array([[episode, frame / 8, 7.0] for episode, frame in rows], pa.list_(pa.float32(), 3)),
            pa.array([[frame, episode / 2] for episode, frame in rows], pa.list_(pa.float32())),
            pa.array([[frame, 5.0, 6.0] for _, frame in rows], pa.list_(pa.float32())),
            pa.array([frame / 10 for _, frame in rows], pa.float32()),
            pa.array([episode for episode, _ in rows], pa.int64()),
        )
        name = f"file-00{file}" if v3 else f"episode_00000{file}"
        pq.write_table(pa.table(dict(zip(FEATURES, columns, strict=True))), root / f"data/chunk-000/{name}.parquet")
    return root


def of_dataset(dataset, joints, outcome=PLACE, *words):
    """The demonstrations that an import of a dataset writes; None if it is refused."""
    out = dataset / "shown.npz"
    out.unlink(missing_ok=True)
    code = sgimd("import", dataset, "--joints", joints, "--outcome", outcome, *words, "--out", out)
    assert (code == 0) == out.exists()
    return load_demonstrations(out) if code == 0 else None


def test_a_lerobot_dataset_is_a_recording_for_each_episode(dataset, capsys):
    shown = of_dataset(dataset, f"{STATE}[0:2]", f"{PLACE}[1],{PLACE}[0]")
    assert [each.outcome.tolist() for each in shown] == [[0.0, 4.0], [0.5, 4.0], [1.0, 4.0]]
    assert shown[2].trajectory.tolist() == [[2.0, frame / 8] for frame in range(5)]
    np.testing.assert_allclose(shown[1].times, np.arange(5) / 10, atol=1e-7)
    assert "3 recordings, 2 joints" in capsys.readouterr().out
    assert of_dataset(dataset, STATE)[0].trajectory.shape == (5, 3)  # all entries of a vector are its bare name


def test_entries_of_a_dataset_have_names(dataset, capsys):
    assert of_dataset(dataset, "lift.pos,pan.pos")[2].trajectory[1].tolist() == [
        1 / 8,
        2.0,
    ]  # of the state, not of action
    assert of_dataset(dataset, "grip", "y")[1].outcome.tolist() == [0.5]
    assert of_dataset(dataset, "x") is None
    assert f"x is an entry of several features; write {PLACE}[0] or action[1]" in capsys.readouterr().err
    assert of_dataset(dataset, "lft.pos") is None
    assert "has no feature lft.pos; did you mean lift.pos" in capsys.readouterr().err
    for names, wanted, told in (
        (["pan.pos", "pan.pos", "gripper.pos"], "pan.pos", f"a feature has two entries pan.pos; write {STATE}"),
        (["pan.pos", "lift.pos"], f"{STATE}[0]", f"{STATE} has 3 entries, but names of 2: pan.pos, lift.pos"),
    ):
        change(dataset, features={**FEATURES, STATE: {"shape": [len(names)], "names": names}})
        assert of_dataset(dataset, wanted) is None
        assert told in capsys.readouterr().err


def test_robots_that_record_shares_of_ranges_must_say_their_units(dataset, capsys):
    change(dataset, robot_type="so101_follower")
    for words in ((), ("--unit", "gripper=deg")):
        assert of_dataset(dataset, STATE, PLACE, *words) is None
        assert "a robot so101_follower records degrees or shares" in capsys.readouterr().err
    (first, *_) = of_dataset(dataset, STATE, PLACE, "--unit", "rad,gripper=deg")
    np.testing.assert_allclose(first.trajectory[1], [0, 1 / 8, np.deg2rad(7)])


def change(dataset, **changes):
    path = dataset / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def last(root):
    return sorted((root / "data/chunk-000").iterdir())[-1]


def rewritten(root, name, values):
    """The last episode of a dataset has other values in one column."""
    rows = pq.read_table(last(root))
    columns = rows.slice(rows.num_rows - 5).to_pydict()
    pq.write_table(pa.table({**columns, name: values}), last(root))


def emptied(root):
    """The last file of a dataset is small, and would fill the memory."""
    pq.write_table(pa.table({"timestamp": np.zeros(2**25 + 1, np.int8)}), last(root))


def moved_to_v1(root):
    (root / "meta").rename(root / "meta_data")


@pytest.mark.parametrize(
    ("harm", "message"),
    [
        (
            lambda root: change(root, codebase_version="v2.0"),
            r"has format v2\.0, v2\.1 and v3 can be read; lerobot conv",
        ),
        (moved_to_v1, r"is no LeRobot dataset of v2\.1 or v3: it has no meta/info\.json"),
        (lambda root: change(root, features={"action": None}), r"has no feature observation\.state; .* It has action"),
        (lambda root: change(root, total_episodes=4), "says 4 episodes, but 3 were found; is a file missing"),
        (lambda root: last(root).unlink(), "says 15 frames, but 10 were found"),
        (lambda root: (root / "meta/info.json").write_text("{"), r"info\.json is no json"),
        (lambda root: (root / "meta/info.json").write_text("[]"), r"info\.json must hold an object"),
        (lambda root: [file.unlink() for file in last(root).parent.iterdir()], "were only its videos copied"),
        (lambda root: last(root).write_bytes(b"PAR1 of another kind"), r"\.parquet cannot be read"),
        (
            lambda root: rewritten(root, "timestamp", ["late"] * 5),
            r"\.parquet cannot be read: timestamp has BYTE_ARRAY, no numbers",
        ),
        (lambda root: rewritten(root, "timestamp", [0.0, 0.1, None, 0.3, 0.4]), r"row \d+: timestamp must be finite"),
        (lambda root: rewritten(root, STATE, [[[0.0, 1.0], [1.0]]] * 5), r"\.parquet cannot be read: setting an array"),
        (emptied, r"cannot be read: it would take \d+ bytes"),
        (lambda root: rewritten(root, STATE, [[True] * 3] * 5), r"state\.list\.element has BOOLEAN, no numbers"),
        (lambda root: last(root).write_text(POINTER), r"\.parquet is a pointer of Git LFS, .*; git lfs pull gets"),
    ],
)
def test_a_dataset_that_is_damaged_or_of_another_kind_is_refused(dataset, capsys, harm, message):
    harm(dataset)
    assert of_dataset(dataset, f"{STATE}[0:2]") is None
    assert re.search(f"error: .*{message}", capsys.readouterr().err)


def test_a_file_of_a_dataset_names_its_folder(dataset, capsys):
    assert sgimd("import", last(dataset), "--joints", STATE, "--outcome", PLACE, "--out", dataset / "shown.npz") == 2
    assert f"is one file of a LeRobot dataset; name the dataset instead: {dataset}" in capsys.readouterr().err


@pytest.mark.parametrize("entry", ["observation.state[2:4]", "observation.state[3]", "observation.state[2:2]"])
def test_an_entry_that_a_vector_does_not_have_is_refused(dataset, capsys, entry):
    assert of_dataset(dataset, entry) is None
    assert f"there is no {entry}: observation.state has 3 entries" in capsys.readouterr().err


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
    assert sgimd("check", file, "--environment", "planar-arm-7") == 0
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
    assert sgimd("check", tmp_path / "shown.npz", "--environment", "planar-arm-7") == 2
    assert "cannot be used: it hit the table" in capsys.readouterr().out


def test_check_names_those_that_cannot_be_used_and_exits_with_2(tmp_path, capsys):
    save_demonstrations(tmp_path / "shown.npz", [led(0.1, lands(0.1)), led(0.8, [0.0, 0.0], degrees=True)])
    assert sgimd("check", tmp_path / "shown.npz", "--environment", "planar-arm-7") == 2
    said = capsys.readouterr()
    assert "cannot be used: the first joint turns within" in said.out
    assert re.search("error: 1 of 2 recordings of .*shown.npz cannot be used; the first is 1: .* in deg", said.err)


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
    assert sgimd("check", file, "--environment", slow) == 0
    fine, fast, wide, far, _ = capsys.readouterr().out.splitlines()[1:]
    assert float(fine.split()[-1]) < 0.01  # the misfit, and no remark
    assert "too fast: movements last 0.8 to 1.6 s" in fast
    assert re.search(r"joint 0 is 1.\d+ at sample 7, outside its range \[-1, 1\]", wide)
    assert "its outcome is outside T: a learner imitates it, but never takes it as a goal" in far
    save_demonstrations(file, [recording(5.0, 0.5)])
    assert sgimd("check", file, "--environment", slow) == 2
    assert "a movement lasts 1.6 s at most, the recording 5 s" in capsys.readouterr().out


SERVANT = """
import numpy as np
from sgimd_torch import Box, GaussianPrimitive
from sgimd_torch.environments.protocol import check_movement

class Servant:
    contexts, outcomes, rest, outcome_noise = Box.cube(0, 1, 0), Box.cube(-4, 4, 2), np.zeros(2), 0.0
    primitive = GaussianPrimitive(Box([-1, 0], [1, 4], names=("turn", "grip")), (0.5, 2.0))
    policies, correspondence = primitive.policies, staticmethod(primitive.correspondence)

    def observe(self, rng):
        return self.contexts.sample(rng)

    def execute(self, context, theta, rng):
        _, theta = check_movement(self, context, theta)
        return self.primitive.at(theta, np.array([9.0]))[0]

class Replays(Servant):
    def replay(self, times, trajectory):
        return trajectory[-1] + times[-1]
"""
SHARES = "grip.pos,turn,b\n" + "".join(f"{100 * s},{100 - 200 * s},9\n" for s in np.linspace(0.2, 0.8, 11))


def of_servant(tmp_path, module, text, *words, robot="Servant"):
    module("my_servant", SERVANT)
    (tmp_path / "logs").mkdir(exist_ok=True)
    for number, each in enumerate([text] if isinstance(text, str) else text):
        (tmp_path / f"logs/{number}.csv").write_text(each)
    robot = ("--environment", f"my_servant:{robot}", "--rate", 10)
    code = sgimd("import", tmp_path / "logs", *robot, *words, "--out", tmp_path / "shown.npz")
    return load_demonstrations(tmp_path / "shown.npz") if code == 0 else None


def test_shares_of_ranges_become_angles_of_the_robot_and_its_movement_gives_the_outcome(tmp_path, module, capsys):
    words = ("--joints", "turn,grip.pos", "--unit=-100:100,grip=0:100")
    (shown,) = of_servant(tmp_path, module, SHARES, *words)
    np.testing.assert_allclose(shown.trajectory[[0, -1]], [[0.6, 0.8], [-0.6, 3.2]], atol=1e-12)
    np.testing.assert_allclose(shown.outcome, [-0.6, 3.2], atol=0.05)  # where the translated movement ends
    assert "1 of 1 can be used; they land 0.000 (median)" in capsys.readouterr().out
    (shown,) = of_servant(tmp_path, module, SHARES, *words, robot="Replays")
    np.testing.assert_allclose(shown.outcome, [0.4, 4.2])  # of the replay, which lasts 1 s
    assert of_servant(tmp_path, module, SHARES, "--joints", "turn", "--unit=-100:100") is None
    assert "the robot has 2 joints, the recordings have 1: turn" in capsys.readouterr().err


def test_joints_have_the_names_of_the_robots_joints_unless_they_are_named(tmp_path, module, capsys):
    text = SHARES.replace("grip.pos", "grip")
    (shown,) = of_servant(tmp_path, module, text, "--unit=-100:100,grip=0:100")
    np.testing.assert_allclose(shown.trajectory[-1], [-0.6, 3.2], atol=1e-12)
    assert of_servant(tmp_path, module, text) is None
    assert "turn reads up to 60 in 0.csv, more than a turn in rad" in capsys.readouterr().err


def slow_rise(*values):
    return "turn,grip\n" + "".join(f"{each},{2 + 2 * each}\n" for each in values)


def test_what_a_robot_cannot_repeat_is_never_written(tmp_path, module, capsys):
    rise = list(np.sin(np.linspace(-1, 1, 12)))
    jerk = [0.9] * 4 + [-0.9, 0.9, -0.9, 0.9, -0.9, 0.9] + [-0.9] * 4
    texts = [slow_rise(*each) for each in (rise, jerk, rise[:2], rise * 2, [9 * x for x in rise])]
    assert of_servant(tmp_path, module, texts, "--unit", "rad") is None
    said = capsys.readouterr()
    for number, why in (
        (1, "with a jerk"),
        (2, "0.1 s, movements at least 0.5 s"),
        (3, "2 s at most"),
        (4, "in degrees"),
    ):
        assert re.search(rf"\n{number}\.csv .* cannot be used: .*{why}", said.out), said.out
    assert "4 of 5 recordings of" in said.err
    shown = of_servant(tmp_path, module, texts, "--unit", "rad", "--skip-unusable")
    assert len(shown) == 1
    assert capsys.readouterr().err.count("left out ") == 4


@pytest.mark.parametrize("words", [("--trim",), ("--speed", 3)])
def test_a_recording_that_lasts_too_long_is_mended_when_asked(tmp_path, module, capsys, words):
    rise = np.sin(np.linspace(-1, 1, 12))
    text = slow_rise(*[rise[0]] * 20, *rise, *[rise[-1]] * 20)
    assert of_servant(tmp_path, module, text) is None
    assert "a movement lasts 2 s at most, the recording 5.1 s" in capsys.readouterr().err
    (shown,) = of_servant(tmp_path, module, text, *words)
    assert shown.times[0] == 0
    assert shown.times[-1] == pytest.approx(1.1 if "--trim" in words else 1.7)
