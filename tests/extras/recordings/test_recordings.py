"""Recordings as people have them become demonstrations: text, LeRobot; and are checked against a robot."""

import dataclasses
import functools
import json
import os
import re
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sgimd_torch.__main__ import _call
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.environments.protocol import SimulationError
from sgimd_torch.extras.recordings.columns import ColumnNames, Sheet, recordings_of
from sgimd_torch.extras.recordings.text import read_text
from sgimd_torch.runs.program import command
from sgimd_torch.spaces import Demonstration

ARM = PlanarArm(7)
ONE = "time,a,b,x,y\n2.0,0.1,0.2,9,9\n2.5,0.3,0.4,9,9\n3.0,0.5,0.6,0.7,-0.8\n"
BARE = ONE.partition("\n")[2]
UNTIMED = "b,a,x,y\n0.2,0.1,9,9\n0.4,0.3,9,9\n0.6,0.5,0.7,-0.8\n"
POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:abc\nsize 9\n"
NAMED = "--joints a,b --outcome x,y"
SHOWN, DATASET = Path("shown.npz"), Path("arm")  # in the folder of a test


def sgimd(*words, view="demonstrations"):
    return command(_call, [view, *map(str, words)])


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def imported(source, *words):
    """The demonstrations that an import writes; None if it is refused."""
    SHOWN.unlink(missing_ok=True)
    try:
        code = sgimd("import", source, *words, "--out", SHOWN)
    except SystemExit as end:  # of the parser of options
        code = end.code
    assert (code, SHOWN.exists()) in ((0, True), (2, False))
    return load_demonstrations(SHOWN) if code == 0 else None


@st.composite
def texts(draw):
    """A recording, written in any layout, with the names that read it: (columns by name, text, names)."""
    n = draw(st.integers(2, 5))
    values = st.lists(st.integers(-9999, 9999), min_size=n, max_size=n)
    columns = {name: np.array(draw(values)) / 1000 for name in "abxy"}
    columns["time"] = np.cumsum(draw(st.lists(st.integers(1, 999), min_size=n, max_size=n))) / 1000
    timed, header = draw(st.booleans()), draw(st.sampled_from(["first row", "remark", "option"]))
    order = [name for name in draw(st.permutations(sorted(columns))) if timed or name != "time"]
    mark = draw(st.sampled_from(",;\t "))
    point = "." if mark == "," else draw(st.sampled_from(".,"))
    quote = "" if mark == " " else draw(st.sampled_from(["", '"']))
    pad = draw(st.sampled_from(["", " "]))
    style = draw(st.sampled_from(["{:.3f}", "{:+.4f}", "{:.6e}", "{:.5E}"]))

    def line(fields):
        return pad + f"{pad}{mark}{pad}".join(f"{quote}{field}{quote}" for field in fields) + pad

    rows = [line(style.format(columns[name][k]).replace(".", point) for name in order) for k in range(n)]
    remarks = draw(st.sampled_from([[], ["# arm 3", "% by hand"]]))
    named = {"first row": [line(order)], "remark": [f"# {line(order)}"], "option": []}[header]
    end = draw(st.sampled_from(["\n", "\r\n", "\r", "\n\n"]))
    text = (
        draw(st.sampled_from(["", "\ufeff"])) + end.join([*remarks, *named, *rows]) + draw(st.sampled_from(["", end]))
    )
    rate = {} if timed else {"rate": 2.0}
    return columns, text, ColumnNames(("a", "b"), ("x", "y"), header=tuple(order) * (header == "option"), **rate)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(texts())
def test_a_text_in_any_layout_reads_back_to_the_same_recording(tmp_path_factory, written):
    columns, text, names = written
    file = tmp_path_factory.getbasetemp() / "written.txt"
    file.write_bytes(text.encode())
    ((_, recording, joints, fault),) = read_text(file, names)
    assert (joints, fault) == (("a", "b"), "")
    times = columns["time"] - columns["time"][0] if names.rate is None else np.arange(len(columns["a"])) / 2
    np.testing.assert_allclose(recording.times, times, atol=1e-12)
    np.testing.assert_array_equal(recording.trajectory, np.stack([columns["a"], columns["b"]], axis=1))
    assert recording.outcome.tolist() == [columns["x"][-1], columns["y"][-1]]
    assert recording.context.shape == (0,)


def degrees(text):
    """The joints of ``ONE`` in degrees."""
    for pair in ("0.1,0.2", "0.3,0.4", "0.5,0.6"):
        text = text.replace(pair, ",".join(repr(float(np.rad2deg(float(x)))) for x in pair.split(",")))
    return text


def timed(*times):
    """``ONE`` with times of a day."""
    rows = zip(("2.0", "2.5", "3.0"), times, strict=True)
    return functools.reduce(lambda text, row: text.replace(f"\n{row[0]}", f"\n2014-05-01T{row[1]}"), rows, ONE)


# Texts that hold the recording of ONE, and the options that read them.
RIGHT = {
    "names with spaces and units": (
        ONE.replace("time", "time (s)").replace("a,b", "joint a,joint b"),
        "--time=time_(s) --joints joint_a,joint_b --outcome x,y",
    ),
    "no zero before the point": (ONE.replace("0.", "."), NAMED),
    "a number for each row": (ONE.replace("\n", "\n7,")[:-2].replace("time", ",time", 1), NAMED),
    "a comma at each end": (ONE.replace("\n", ",\n"), NAMED),
    "no names": (BARE, f"{NAMED} --columns time,a,b,x,y"),
    "no time": (UNTIMED, f"{NAMED} --rate 2"),
    "degrees": (degrees(ONE), f"{NAMED} --unit deg"),
    "degrees by joint": (degrees(ONE), f"{NAMED} --unit a=deg,b=deg"),
    "degrees of all but these": (ONE, f"{NAMED} --unit deg,a=rad,b=rad"),
    "twice as slow": (ONE.replace("2.5", "3.0").replace("3.0,0.5", "4.0,0.5"), f"{NAMED} --speed 2"),
    "a vector": (ONE, "--joints a,b[0] --outcome x,y"),
    "ISO times with zones": (timed("08:00:02+02:00", "08:00:02.5+02:00", "06:00:03Z"), NAMED),
    "ISO times without zones": (timed("08:59:59.9", "09:00:00.4", "09:00:00.9"), NAMED),
    "an outcome in the last row alone": (ONE.replace(",9,9", ",,"), NAMED),
}
SEMICOLONS = ONE.replace(",", ";")
JERK = ONE.replace("2.0,", "1.999,9.1,0.2,9,9\n2.0,").replace("2.5", "8.5").replace("3.0,", "11.,")
NO_OUTCOME = "needs outcomes: name their columns with --outcome .* with --environment"
REFUSED = {
    "nothing": ("", NAMED, "it has no column a; it has"),
    "another name": (ONE.replace("a,b", "a,c"), NAMED, "it has no column b; it has time, a, c, x, y"),
    "a name twice": (ONE.replace("x", "b"), "--joints a,b --outcome y", "has two columns b; it has time, a, b, b, y"),
    "no time": (UNTIMED, NAMED, "it has no column time; .* without times, give --rate"),
    "no names": (BARE, NAMED, "its first row has numbers, no names; name its columns with --columns"),
    "names twice": (ONE, f"{NAMED} --columns time,a,b,x,y", "row 1: a is 'a', no number; .* so leave out --columns"),
    "numbers for names": (f"0,1,2,3,4\n{BARE}", f"{NAMED} --columns time,a,b,x,y", "0,1,2,3,4, may number the columns"),
    "too few names": (BARE, f"{NAMED} --columns time,a,b,x", "it has no column y"),
    "too many names": (BARE, f"{NAMED} --columns time,a,b,x,y,z", "row 1 has 5 fields instead of 6"),
    "a word": (ONE.replace("0.3", "some"), NAMED, "row 3: a is 'some', no number; is a field missing"),
    "a gap": (ONE.replace("0.3", ""), NAMED, "row 3: a is '', no number"),
    "no number": (ONE.replace("0.3", "nan"), NAMED, "row 3: a is 'nan', no number"),
    "a number of Python": (ONE.replace("0.3", "1_0"), NAMED, "row 3: a is '1_0', no number"),
    "hexadecimals": (ONE.replace("0.3", "0x3"), NAMED, "row 3: a is '0x3', no number"),
    "a minus that is none": (ONE.replace("0.1", "\u22120.1"), NAMED, "row 2: a is '\u22120.1', no number; is a field"),
    "dates": ("time,a,b,x,y\n" + "1-1 9:00,0.1,0.2,9,-\n" * 2, NAMED, "row 3: y is '-', no number"),
    "days": (
        "time,a,b,x,y\n" + "1-1 9:00,0.1,0.2,9,9\n" * 2,
        NAMED,
        "row 2: time is '1-1 9:00', neither a number of s",
    ),
    "some zones": (timed("08:00:02Z", "08:00:02.5", "08:00:03"), NAMED, "some times of time have a zone, others have"),
    "points and commas": (SEMICOLONS.replace("0.3", "1.000,3"), NAMED, "row 3: a is '1.000,3', no number"),
    "decimal commas between commas": (ONE.replace("0.", "0,"), NAMED, "row 2 has 7 fields instead of 5"),
    "a remark between rows": (ONE.replace("\n2.5", "\n# lost\n2.5"), NAMED, "row 3 has 1 fields instead of 5"),
    "a name over two lines": (ONE.replace("time", '"time\ns"'), NAMED, "it has no column"),
    "a file of one sign": ("0" * 200_000, NAMED, "it is no table: field larger than"),
    "no end of digits": (ONE.replace("0.3", "9" * 400), NAMED, "row 3: a must be finite, got"),
    "times that fall": (
        ONE.replace("2.5", "1.5"),
        NAMED,
        "row 3: time must increase .* at 1.5 s, after 2 s; were rows",
    ),
    "a time twice": (ONE.replace("2.5", "2.0"), NAMED, "row 3: .* at 2 s, as the one before; was it written twice"),
    "float32 epochs": (
        *(re.sub(r"\n\d[.]\d", "\n1700000000", ONE), NAMED),
        "row 3: .* at 1700000000 s, as the one before, and so are 1 more; are times epochs in float32",
    ),
    "a field too many": (ONE.replace(",9,9\n2.5", ",9,9,9\n2.5"), NAMED, "row 2 has 6 fields instead of 5"),
    "one row": ("\n".join(ONE.splitlines()[:2]), NAMED, "it has 1 sample, but needs 2 or more"),
    "no rows": (ONE.splitlines()[0], NAMED, "it has no rows below the names"),
    "thousands": (SEMICOLONS.replace("2.5", "2,500"), NAMED, "decimal commas beside points"),
    "quoted thousands": (ONE.replace(".", "").replace("25", '"2,500"'), NAMED, "or beside commas between columns"),
    "a pointer": (POINTER, NAMED, "it is a pointer of Git LFS, not the file itself; git lfs pull"),
    "UTF-16": (ONE.replace("", "\0"), NAMED, "it has a NUL, .* was it saved as UTF-16"),
    "degrees": (degrees(ONE), NAMED, "a reads up to 28.65 in one.txt, more than a turn in rad; .* --unit a=deg"),
    "degrees of one joint": (degrees(ONE), f"{NAMED} --unit a=deg", "b reads up to 34.38 .* --unit b=deg"),
    "digits of another script": (degrees(ONE).replace("0", "\u0660"), NAMED, "is .*, no number"),
    "an unknown unit": (ONE, f"{NAMED} --unit a=turns", "the unit of a must be rad, deg or a range .*, got turns"),
    "a range of nothing": (ONE, f"{NAMED} --unit a=5:5.0", "the unit of a must be rad, deg or a range .*, got 5:5.0"),
    "a range without a robot": (ONE, f"{NAMED} --unit a=0:100", "a=0:100 maps onto the range of a joint of a robot"),
    "a unit of no joint": (ONE, f"{NAMED} --unit c=deg", "no joint is named c; did you mean"),
    "stillness": (ONE.replace("0.3,0.4", "0.1,0.2").replace("0.5,0.6", "0.1,0.2"), f"{NAMED} --trim", "no joint moved"),
    "a jerk": (JERK, f"{NAMED} --trim --unit rad", "it moves in 1 of 3 steps and else hardly; has it a jerk"),
    "an entry of a number": (ONE, "--joints a[1] --outcome x", r"there is no a\[1\]: a has 1 entries"),
    "no outcome": (ONE, "--joints a,b", NO_OUTCOME),
    "no joints": (ONE, "--outcome x,y", "name its columns of joints: --joints"),
    "times and a rate": (ONE, f"{NAMED} --time time --rate 5", "not allowed with argument"),
    "a rate of nothing": (ONE, f"{NAMED} --rate 0", "must be above 0, got 0"),
    "options of no robot": (ONE, f"{NAMED} --environment.noise 0", "is no option of .*, or needs --environment"),
}


def of_text(text, words):
    """The demonstrations that an import of a text writes."""
    Path("one.txt").write_bytes(text.encode())
    return imported("one.txt", *(word.replace("_", " ") for word in words.split()))


@pytest.mark.parametrize("kind", RIGHT)
def test_a_text_is_imported_as_its_options_say(kind):
    (shown,) = of_text(*RIGHT[kind])
    np.testing.assert_allclose(shown.times, [0.0, 0.5, 1.0])  # they may begin at any time
    np.testing.assert_allclose(shown.trajectory, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]], rtol=1e-12)
    assert shown.outcome.tolist() == [0.7, -0.8]  # of the last row


@pytest.mark.parametrize("kind", REFUSED)
def test_a_text_that_could_be_read_wrongly_is_refused_in_a_line(capsys, kind):
    text, words, message = REFUSED[kind]
    assert of_text(text, words) is None
    printed = capsys.readouterr().err
    assert re.search(f"error: .*{message}", printed), printed
    assert printed.count("error:") == 1


LONG = "run,time,a,b,x,y,c\n" + "".join(
    f"{run},{k / 10},{k},{-k},{int(run == 'two')},{k},{k + 5}\n" for run in ("one", "two") for k in range(4)
)
OF_LONG = ("--joints=b,a", "--outcome=x", "--context=c", "--recording=run")


def test_a_folder_is_a_recording_for_each_file_in_the_order_of_their_names():
    for name, text in (("b", ONE), ("a", ONE.replace("0.7", "0.1"))):
        Path(f"{name}.csv").write_text(text)
    Path("notes.txt").write_text("none of them")
    assert [demonstration.outcome[0] for demonstration in imported(".", *NAMED.split())] == [0.1, 0.7]


def test_recordings_of_a_file_of_ours_are_mended_too():
    times = np.arange(30) / 10
    joints = np.rad2deg(np.clip(times - 1, 0, 1))[:, None]
    save_demonstrations("deg.npz", [Demonstration(np.zeros(0), times, joints, np.zeros(2))])
    (shown,) = imported("deg.npz", "--unit", "deg", "--trim", "--speed", 2)
    np.testing.assert_allclose(shown.times, np.arange(11) / 20, atol=1e-12)
    np.testing.assert_allclose(shown.trajectory[[0, -1], 0], [0, 1], atol=1e-12)


def test_a_joint_that_never_moves_or_jumps_by_a_turn_is_told_joined_when_asked_and_refused_when_strict(capsys):
    turns, times = np.linspace(2.5, 4.5, 9), np.linspace(0, 2, 9)
    logged = np.angle(np.exp(1j * turns))
    rows = [f"{t},{a},{b},0.0,0.1,0.2" for t, a, b in zip(times, logged, turns, strict=True)]
    Path("wrapped.csv").write_text("\n".join(["time,a,b,c,x,y", *rows]))
    words = ("wrapped.csv", "--joints", "a,b,c", "--outcome", "x,y")
    assert imported(*words)[0].trajectory[:, 0] == pytest.approx(logged)
    said = capsys.readouterr().err
    assert "a jumps by a turn: --unwrap a joins it (1 of 1" in said
    assert "c never moves while others do" in said
    assert "b " not in said
    assert imported(*words, "--unwrap", "a")[0].trajectory[:, 0] == pytest.approx(turns)
    assert "jumps" not in capsys.readouterr().err
    assert imported(*words, "--strict") is None
    assert "a jumps by a turn" in capsys.readouterr().err


def test_one_long_table_is_cut_where_the_recording_changes(capsys):
    Path("long.csv").write_text(LONG)
    one, two = imported("long.csv", *OF_LONG)
    assert one.trajectory[:, 0].tolist() == [0, -1, -2, -3]
    assert (one.outcome.tolist(), two.outcome.tolist()) == ([0.0], [1.0])
    assert one.context.tolist() == [5.0]  # of the first row
    Path("long.csv").write_text(LONG + "one,9,9,9,9,9,9\n")
    assert imported("long.csv", *OF_LONG) is None
    assert "the rows of recording one are not adjacent; sort them by run and time" in capsys.readouterr().err


def test_recordings_that_cannot_be_used_are_named_and_left_out_when_asked(capsys):
    Path("long.csv").write_text(LONG.replace("two,0.2,2", "two,0.2,?"))
    assert imported("long.csv", *OF_LONG) is None
    fault = "long.csv: run two: row 8: a is '?', no number; is a field missing?"
    printed = capsys.readouterr().err
    assert f"1 of 2 recordings of long.csv cannot be used; the first is {fault}" in printed
    assert "--skip-unusable leaves such out" in printed
    assert len(imported("long.csv", *OF_LONG, "--skip-unusable")) == 1
    assert f"left out {fault}" in capsys.readouterr().err
    Path("long.csv").write_text(LONG.replace("run,time", "run,t"))
    assert imported("long.csv", *OF_LONG, "--skip-unusable") is None  # none is left


def test_folders_without_texts_and_places_without_a_file_are_refused(capsys):
    os.mkfifo("pipe.npz")
    for place, message in (
        (".", r"holds no \.csv, \.tsv, \.txt, \.dat file"),
        ("no.csv", r"no\.csv cannot be read or written: No such file"),
        ("\udcff\x1b[31m\n.csv", r"'\\udcff\\x1b\[31m\\n\.csv' cannot be read or written: No such file"),
        ("pipe.npz", "pipe.npz is a pipe or a device, not a file"),
    ):
        assert imported(place, *NAMED.split()) is None
        printed = capsys.readouterr().err
        assert re.fullmatch(f"error: .*{message}.*\n", printed), printed


def test_names_of_columns_are_checked_before_anything_is_read():
    with pytest.raises(ValueError, match=r"'state\[a\]' does not name a column"):
        ColumnNames(joints=("state[a]",), outcome=("x",))


STATE, PLACE = "observation.state", "observation.place"
FEATURES = {
    "action": {"shape": [3], "names": {"motors": ["pan.pos", "x", "grip"]}},
    STATE: {"shape": [3], "names": ["pan.pos", "lift.pos", "gripper.pos"]},
    PLACE: {"shape": [2], "names": [["x", "y"]]},
    "timestamp": {"shape": [1], "names": 7},
    "episode_index": {"shape": [1], "names": None},
}


@pytest.fixture(params=["v3.0", "v2.1"])
def dataset(request):
    """Three episodes in the layout of LeRobot: in two files of v3, or in three of v2.1."""
    root, v3 = DATASET, request.param == "v3.0"
    info = {"codebase_version": request.param, "total_episodes": 3, "total_frames": 15, "features": FEATURES}
    for folder in ("meta", "data/chunk-000"):
        (root / folder).mkdir(parents=True)
    (root / "meta/info.json").write_text(json.dumps(info))
    for file, episodes in enumerate([(0, 1), (2,)] if v3 else [(0,), (1,), (2,)]):
        rows = [(episode, frame) for episode in episodes for frame in range(5)]
        columns = (
            pa.array([[frame, 5.0, 6.0] for _, frame in rows], pa.list_(pa.float32())),
            pa.array([[episode, frame / 8, 7.0] for episode, frame in rows], pa.list_(pa.float32(), 3)),
            pa.array([[frame, episode / 2] for episode, frame in rows], pa.list_(pa.float32())),
            pa.array([frame / 10 for _, frame in rows], pa.float32()),
            pa.array([episode for episode, _ in rows], pa.int64()),
        )
        name = f"file-00{file}" if v3 else f"episode_00000{file}"
        pq.write_table(pa.table(dict(zip(FEATURES, columns, strict=True))), root / f"data/chunk-000/{name}.parquet")
    return root


def of_dataset(joints, outcome=PLACE, *words):
    return imported(DATASET, "--joints", joints, "--outcome", outcome, *words)


def test_a_lerobot_dataset_is_a_recording_for_each_episode(dataset, capsys):
    shown = of_dataset(f"{STATE}[0:2]", f"{PLACE}[1],{PLACE}[0]")
    assert [demonstration.outcome.tolist() for demonstration in shown] == [[0.0, 4.0], [0.5, 4.0], [1.0, 4.0]]
    assert shown[2].trajectory.tolist() == [[2.0, frame / 8] for frame in range(5)]
    np.testing.assert_allclose(shown[1].times, np.arange(5) / 10, atol=1e-7)
    assert "3 recordings, 2 joints" in capsys.readouterr().out
    assert of_dataset(STATE)[0].trajectory.shape == (5, 3)  # all entries of a vector are its bare name


def test_entries_of_a_dataset_have_names(dataset):
    assert of_dataset("lift.pos,pan.pos")[2].trajectory[1].tolist() == [1 / 8, 2.0]  # of the state
    assert of_dataset("grip", "y")[1].outcome.tolist() == [0.5]


def test_robots_that_record_shares_of_ranges_must_say_their_units(dataset, capsys):
    change(dataset, robot_type="so101_follower")
    for words in ((), ("--unit", "gripper=deg")):
        assert of_dataset(STATE, PLACE, *words) is None
        assert "a robot so101_follower records degrees or shares" in capsys.readouterr().err
    (first, *_) = of_dataset(STATE, PLACE, "--unit", "rad,gripper=deg")
    np.testing.assert_allclose(first.trajectory[1], [0, 1 / 8, np.deg2rad(7)])


def change(dataset, **changes):
    path = dataset / "meta/info.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def name_entries(dataset, *names):
    change(dataset, features={**FEATURES, STATE: {"shape": [len(names)], "names": names}})


def last(root):
    return sorted((root / "data/chunk-000").iterdir())[-1]


def rewrite(root, name, values):
    """The last episode of a dataset has other values in one column."""
    rows = pq.read_table(last(root))
    columns = rows.slice(rows.num_rows - 5).to_pydict()
    pq.write_table(pa.table({**columns, name: values}), last(root))


UNKNOWN = {
    "x": r"x is an entry of several features; write action\[1\] or observation\.place\[0\]",
    "lft.pos": r"has no feature lft\.pos; did you mean lift\.pos",
    f"{STATE}[2:4]": r"there is no observation\.state\[2:4\]: observation\.state has 3 entries",
    f"{STATE}[3]": r"there is no observation\.state\[3\]",
    f"{STATE}[2:2]": r"there is no observation\.state\[2:2\]",
}
HARMS = {
    "has 3 entries, but names of 2: pan.pos, lift": lambda root: name_entries(root, "pan.pos", "lift.pos"),
    r"has format v2\.0, v2\.1 and v3 can be read; lerobot": lambda root: change(root, codebase_version="v2.0"),
    r"is no LeRobot .*: it has no meta/info\.json": lambda root: (root / "meta").rename(root / "meta_data"),
    r"no feature observation\.state; .* It has action": lambda root: change(root, features={"action": None}),
    "says 4 episodes, but 3 were found; is a file missing": lambda root: change(root, total_episodes=4),
    "says 14 frames, but 15 were found; was meta/info.json written": lambda root: change(root, total_frames=14),
    "says 15 frames, but 10 were found": lambda root: last(root).unlink(),
    r"info\.json is no json": lambda root: (root / "meta/info.json").write_text("{"),
    r"info\.json must hold an object": lambda root: (root / "meta/info.json").write_text("[]"),
    "were only its videos copied": lambda root: [file.unlink() for file in last(root).parent.iterdir()],
    r"\.parquet cannot be read": lambda root: last(root).write_bytes(b"PAR1 of another kind"),
    "timestamp is 'late', neither a number of s nor an ISO time": lambda root: rewrite(root, "timestamp", ["late"] * 5),
    r"row \d+: timestamp must be finite": lambda root: rewrite(root, "timestamp", [0.0, None, 2, 3, 4]),
    "cannot be read: setting an array": lambda root: rewrite(root, STATE, [[[0.0, 1.0], [1.0]]] * 5),
    r"\.parquet is a pointer of Git LFS, .*; git lfs pull gets": lambda root: last(root).write_text(POINTER),
}


@pytest.mark.parametrize(
    ("joints", "harm", "message"),
    [
        *((joints, None, message) for joints, message in UNKNOWN.items()),
        *((STATE, harm, message) for message, harm in HARMS.items()),
        ("pan.pos", lambda root: name_entries(root, "pan.pos", "pan.pos", "grip"), "has two entries pan.pos; write .*"),
    ],
)
def test_a_dataset_that_is_damaged_or_of_another_kind_is_refused(dataset, capsys, joints, harm, message):
    if harm is not None:
        harm(dataset)
    assert of_dataset(joints) is None
    assert re.search(f"error: .*{message}", capsys.readouterr().err)


def test_a_file_of_a_dataset_names_its_folder(dataset, capsys):
    assert imported(last(dataset), "--joints", STATE, "--outcome", PLACE) is None
    assert f"one file of a LeRobot dataset; name the dataset instead: {dataset.absolute()}\n" in capsys.readouterr().err


def bent(angle, outcome=(0.0, 0.0)):
    """A recording of the arm, led to a posture of equal bends."""
    times = np.linspace(0, 1, 6)
    return Demonstration(np.zeros(0), times, np.outer(times, np.full(7, angle)), np.asarray(outcome))


def landing(angle):
    theta = ARM.correspondence([0.0, 1.0], np.outer([0, 1], np.full(7, angle)))
    return ARM.execute(np.zeros(0), theta, np.random.default_rng(0))


def test_check_prints_where_recordings_land_and_names_those_that_cannot_be_used(capsys, monkeypatch):
    words = ("check", SHOWN, "--environment", "planar-arm-7")
    save_demonstrations(SHOWN, [bent(0.1, landing(0.1)), bent(0.3, [0.5, 0.5])])
    assert sgimd(*words) == 0
    printed = capsys.readouterr().out.splitlines()
    assert [line.split()[:2] for line in printed[1:3]] == [["0", "1"], ["1", "1"]]
    assert "0.000" in printed[1]
    assert f"{np.linalg.norm(landing(0.3) - 0.5):.3f}" in printed[2]
    assert printed[-1].startswith("2 of 2 can be used; they land")
    save_demonstrations(SHOWN, [bent(0.1, landing(0.1)), bent(np.rad2deg(0.8))])
    assert sgimd(*words) == 2
    printed = capsys.readouterr()
    assert "cannot be used: the first joint turns within" in printed.out
    assert re.search("error: 1 of 2 recordings of shown.npz cannot be used; the first is 1: .* in deg", printed.err)

    def execute(self, context, theta, rng):
        raise failures.pop(0)

    monkeypatch.setattr(PlanarArm, "execute", execute)
    failures = [SimulationError("it hit the table"), SystemExit(0)]
    for reason in ("it hit the table", "SystemExit: 0"):
        assert sgimd(*words) == 2
        assert f"cannot be used: {reason}" in capsys.readouterr().out


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns"), (1, None)])
def test_times_in_another_unit_are_suspected_on_a_robot_of_any_speed(capsys, factor, unit):
    shown = bent(0.1, landing(0.1))
    save_demonstrations(SHOWN, [dataclasses.replace(shown, times=factor * shown.times)])
    assert sgimd("check", SHOWN, "--environment", "planar-arm-7") == 0
    said = f"lasts {factor:.2g} s, with {factor / 5:.2g} s between samples; are its times in {unit}?"
    assert (said in capsys.readouterr().out) == (unit is not None)
    words = "--environment planar-arm-7 --algorithm observation --movements 5 --evaluate-at [] --demonstrations"
    assert sgimd(*words.split(), SHOWN, "--out", ".", view="run") == 0
    assert (f"recording 0 {said}" in capsys.readouterr().err) == (unit is not None)


def test_a_table_may_have_moments_for_times():
    moments = np.array([datetime(2014, 5, 1, 8, tzinfo=UTC) + timedelta(seconds=k / 4) for k in range(3)])
    table = Sheet("dataset", {"time": moments, "a": np.arange(3.0)}, range(3), {})
    (recording,) = recordings_of(table, ColumnNames(("a",)))
    assert recording.demonstration.times.tolist() == [0, 0.25, 0.5]


SERVANT = """
import numpy as np
from sgimd_torch import Box, GaussianPrimitive, PlanarArm
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

class Halves(Replays):
    def execute(self, context, theta, rng):
        return super().execute(context, theta, rng) / 2

class Slow(PlanarArm):
    primitive = GaussianPrimitive(Box.cube(-1, 1, 2), (0.8, 1.6))
    correspondence = staticmethod(primitive.correspondence)

    def __init__(self):
        super().__init__(9)
"""
SHARES = "grip.pos,turn,b\n" + "".join(f"{100 * s},{100 - 200 * s},9\n" for s in np.linspace(0.2, 0.8, 11))


@pytest.fixture
def servant(module):
    module("my_servant", SERVANT)


def test_what_lies_outside_the_limits_of_speed_and_range_is_remarked(servant, capsys):
    def recording(seconds, top, outcome=(0.2, 0.2)):
        times = np.linspace(0, seconds, 20)
        return Demonstration(np.zeros(0), times, np.stack([top * np.sin(times), 0 * times], axis=1), np.array(outcome))

    words = ("check", SHOWN, "--environment", "my_servant:Slow")
    shown = [recording(1.0, 0.5), recording(0.4, 0.5), recording(1.5, 2.0), recording(1.0, 0.5, (9, 9))]
    save_demonstrations(SHOWN, shown)
    assert sgimd(*words) == 0
    fine, fast, wide, far, _ = capsys.readouterr().out.splitlines()[1:]
    assert float(fine.split()[-1]) < 0.01  # the misfit, and no remark
    assert "too fast: movements last 0.8 to 1.6 s" in fast
    assert re.search(r"joint 0 is 1.\d+ at sample 7, outside its range \[-1, 1\]", wide)
    assert "its outcome is outside T: a learner imitates it, but never takes it as a goal" in far
    save_demonstrations(SHOWN, [recording(5.0, 0.5)])
    assert sgimd(*words) == 2
    assert "a movement lasts 1.6 s at most, the recording 5 s" in capsys.readouterr().out


def of_servant(texts, *words, robot="Servant"):
    Path("logs").mkdir(exist_ok=True)
    for number, text in enumerate(texts):
        Path(f"logs/{number}.csv").write_text(text)
    return imported("logs", "--environment", f"my_servant:{robot}", "--rate", 10, *words)


def test_shares_of_ranges_become_angles_of_the_robot_and_its_movement_gives_the_outcome(servant, capsys):
    words = ("--joints", "turn,grip.pos", "--unit=-100:100,grip=0:100")
    (shown,) = of_servant([SHARES], *words)
    np.testing.assert_allclose(shown.trajectory[[0, -1]], [[0.6, 0.8], [-0.6, 3.2]], atol=1e-12)
    np.testing.assert_allclose(shown.outcome, [-0.6, 3.2], atol=0.05)  # where the translated movement ends
    assert "1 of 1 can be used; they land 0.000 (median)" in capsys.readouterr().out
    (shown,) = of_servant([SHARES], *words, robot="Replays")
    np.testing.assert_allclose(shown.outcome, [0.4, 4.2])  # of the replay, which lasts 1 s
    (shown,) = of_servant([SHARES], *words, robot="Halves")
    np.testing.assert_allclose(shown.outcome, [-0.3, 1.6], atol=0.05)  # the replay is that of another robot
    assert of_servant([SHARES], "--joints", "turn", "--unit=-100:100") is None
    assert "the robot has 2 joints, the recordings have 1: turn" in capsys.readouterr().err


def test_joints_have_the_names_of_the_robots_joints_unless_they_are_named(servant, capsys):
    text = SHARES.replace("grip.pos", "grip")
    (shown,) = of_servant([text], "--unit=-100:100,grip=0:100")
    np.testing.assert_allclose(shown.trajectory[-1], [-0.6, 3.2], atol=1e-12)
    assert of_servant([text]) is None
    assert "turn reads up to 60 in 0.csv, more than a turn in rad" in capsys.readouterr().err


def turning(*angles):
    return "turn,grip\n" + "".join(f"{angle},{2 + 2 * angle}\n" for angle in angles)


RISE = list(np.sin(np.linspace(-1, 1, 12)))
SHAKEN = [0.9] * 4 + [-0.9, 0.9, -0.9, 0.9, -0.9, 0.9] + [-0.9] * 4


def test_what_a_robot_cannot_repeat_is_never_written(servant, capsys):
    texts = [turning(*angles) for angles in (RISE, SHAKEN, RISE[:2], RISE * 2, [9 * x for x in RISE])]
    assert of_servant(texts, "--unit", "rad") is None
    printed = capsys.readouterr()
    faults = ("with a jerk", "0.1 s, movements at least 0.5 s", "2 s at most", "in degrees")
    for number, fault in enumerate(faults, 1):
        assert re.search(rf"\n{number}\.csv .* cannot be used: .*{fault}", printed.out), printed.out
    assert "4 of 5 recordings of" in printed.err
    assert len(of_servant(texts, "--unit", "rad", "--skip-unusable")) == 1
    assert capsys.readouterr().err.count("left out ") == 4


@pytest.mark.parametrize(("words", "lasts"), [(("--trim",), 1.1), (("--speed", 3), 1.7)])
def test_a_recording_that_lasts_too_long_is_mended_when_asked(servant, capsys, words, lasts):
    texts = [turning(*[RISE[0]] * 20, *RISE, *[RISE[-1]] * 20)]
    assert of_servant(texts) is None
    assert "a movement lasts 2 s at most, the recording 5.1 s" in capsys.readouterr().err
    (shown,) = of_servant(texts, *words)
    assert shown.times[[0, -1]] == pytest.approx([0, lasts])
