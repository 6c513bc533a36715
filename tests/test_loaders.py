"""Files: damaged and impossible ones are refused by name, others read as they were saved; a file is replaced whole."""

import io
import os
import zipfile
from contextlib import nullcontext

import numpy as np
import pytest

from sgimd_torch.algorithms.practice import practice
from sgimd_torch.demonstrations import load_demonstrations, save_demonstrations
from sgimd_torch.environments.planar_arm import PlanarArm
from sgimd_torch.evaluation import Benchmark, load_benchmark, save_benchmark
from sgimd_torch.files import (
    check_writable,
    checksum,
    make_folder,
    read_csv,
    read_npz,
    replacing,
    write_bytes,
    write_npz,
    write_text,
)
from sgimd_torch.record import Record
from sgimd_torch.record.replay import save_life
from sgimd_torch.spaces import Demonstration

LESSON = Demonstration(np.zeros(0), np.arange(3.0), np.ones((3, 2)), np.zeros(2))
LOADERS = {
    "benchmark": (lambda path: save_benchmark(path, Benchmark("PlanarArm", np.ones((3, 2)), 0.1)), load_benchmark),
    "demonstrations": (lambda path: save_demonstrations(path, [LESSON, LESSON]), load_demonstrations),
}


def npy(array):
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def zipped(**members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    return buffer.getvalue()


def headed(shape, dtype="<f8"):
    """An npy file of 48 bytes that says that it is of this shape."""
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + bytes(48)


FILES = {
    "empty": b"",
    "text": b"theta, outcome\n",
    "half a zip file": zipped(numbers=npy(np.zeros(9)))[:90],
    "one array": npy(np.zeros(3)),
    "another array": zipped(others=npy(np.zeros(3))),
    "objects": zipped(numbers=npy(np.array([{}]))),
    "nothing inside": zipped(numbers=b""),
    "fewer numbers than it says": zipped(numbers=headed((7,))),
    "objects by the header alone": zipped(numbers=headed((6,), "|O")),
    "a flipped bit": zipped(numbers=npy(np.zeros(99))).replace(bytes(64), bytes(63) + b"\x01", 1),
}


@pytest.mark.parametrize("content", FILES.values(), ids=FILES)
def test_what_holds_no_such_array_is_refused_by_name(tmp_path, content):
    path = tmp_path / "file.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"file\.npz is no list: .*; was it written by a test, and whole"):
        read_npz(path, "list", "a test", ("numbers",))


def test_what_is_written_is_read_and_cannot_be_changed(tmp_path):
    for values in (np.array(3), np.arange(6.0).reshape(2, 3), np.zeros((0, 4)), np.array("name"), np.arange(3) > 1):
        write_npz(tmp_path / "file.npz", {"numbers": values, "more": np.zeros(2)})
        (found,) = read_npz(tmp_path / "file.npz", "list", "a test", ("numbers",))
        assert found.dtype == values.dtype
        np.testing.assert_array_equal(found, values)
        assert not found.flags.writeable


@pytest.mark.parametrize("name", LOADERS)
def test_a_file_cut_short_anywhere_is_refused_by_name(tmp_path, name):
    save, load = LOADERS[name]
    path = tmp_path / "saved"
    save(path)
    whole = path.read_bytes()
    for length in [*range(0, len(whole), 1 + len(whole) // 60), len(whole) - 1]:
        path.write_bytes(whole[:length])
        with pytest.raises(ValueError, match="saved is no"):
            load(path)


@pytest.mark.parametrize("name", LOADERS)
def test_a_missing_file_and_a_folder_are_called_so(tmp_path, name):
    save, load = LOADERS[name]
    with pytest.raises(FileNotFoundError, match="nothing"):
        load(tmp_path / "nothing")
    for use in (save, load):
        with pytest.raises(IsADirectoryError, match="directory"):
            use(tmp_path)
    assert list(tmp_path.iterdir()) == []


WRITERS = [save for save, _ in LOADERS.values()]
WRITERS += [lambda path: write_bytes(path, b"new\n"), lambda path: write_text(path, "new\n")]


@pytest.mark.parametrize("write", WRITERS)
def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path, write):
    (tmp_path / "saved").write_text("old")
    write(tmp_path / "saved")
    assert (tmp_path / "saved").read_bytes() not in (b"old", b"")
    assert os.listdir(tmp_path) == ["saved"]


@pytest.mark.parametrize("write", WRITERS)
def test_a_link_stays_and_no_pipe_device_or_record_is_replaced(tmp_path, write):
    (tmp_path / "far").mkdir()
    (tmp_path / "link").symlink_to("far/saved")
    for _ in range(2):  # the file to which a link leads may be missing
        write(tmp_path / "link")
        assert (tmp_path / "link").is_symlink()
        assert os.listdir(tmp_path / "far") == ["saved"]
        (tmp_path / "far/saved").write_text("old")
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to(os.devnull)
    Record.make(tmp_path / "run.sqlite", (0, 1, 1), {"settings": {}}).close()
    Record.make(tmp_path / "life.sqlite", (0, 1, 1), {}).close()
    (tmp_path / "run.sqlite-wal").write_bytes(bytes.fromhex("377f0682"))
    for name in ("pipe", "device", "run.sqlite", "life.sqlite", "run.sqlite-wal"):
        before = [os.stat(tmp_path / name).st_ino, os.stat(tmp_path / name).st_mtime_ns]
        what = "a pipe or a device, not a file" if name in ("pipe", "device") else "the record of a run"
        for use in (write, check_writable):
            with pytest.raises(OSError, match=f"{name} is {what}"):
                use(tmp_path / name)
        assert [os.stat(tmp_path / name).st_ino, os.stat(tmp_path / name).st_mtime_ns] == before
    assert not [name for name in os.listdir(tmp_path) if name.endswith(".part")]


def test_a_life_replaces_a_life_but_no_run(tmp_path):
    arm = PlanarArm(2)
    for about in ({}, {"settings": {}}):
        path = tmp_path / f"{len(about)}.sqlite"
        Record.make(path, (0, 2, 2), about).close()
        with pytest.raises(OSError, match="is the record of a run") if about else nullcontext():
            save_life(practice(arm, 0), path)
        with Record(path) as record:
            assert ("settings" in record.about) == bool(about)


def test_a_file_whose_writing_fails_stays_as_it_was(tmp_path):
    path = tmp_path / "film.mp4"
    path.write_text("old")

    def fail():
        with replacing(path) as partial:
            partial.write_text("half")
            assert path.read_text() == "old"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["film.mp4"]


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"file/runs/x cannot be made: .*a file in its place"):
        make_folder(tmp_path / "file" / "runs" / "x")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"environment": np.array("\ud800")}, "environment"),
        ({"environment": np.array("x" * 10**6 + " ")}, "environment"),
        ({"goals": np.zeros((0, 2))}, "goals"),
        ({"goals": np.zeros(2)}, "goals"),
        ({"goals": np.full((2, 2), np.nan)}, "goals"),
        ({"goals": np.full((2, 2), "far")}, "goals"),
        ({"side": np.array(0.0)}, "side"),
        ({"side": np.array(np.nan)}, "side"),
        ({"side": np.array("1" * 10**6)}, "side"),
    ],
)
def test_a_benchmark_that_cannot_be_is_refused_in_few_words_and_not_saved(tmp_path, changes, words):
    path = tmp_path / "goals.npz"
    goals = {"environment": np.array("PlanarArm"), "goals": np.zeros((3, 2)), "side": np.array(0.1)} | changes
    with pytest.raises(ValueError, match=words):
        save_benchmark(path, Benchmark(**goals))
    assert not path.exists()
    write_npz(path, goals)
    with pytest.raises(ValueError, match=rf"goals\.npz: .*{words}") as raised:
        load_benchmark(path)
    assert len(str(raised.value)) < 400


@pytest.mark.parametrize("load", [load_benchmark, load_demonstrations, checksum, read_csv])
def test_a_named_pipe_is_refused_and_keeps_nobody_waiting(tmp_path, load):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(OSError, match="pipe is a pipe or a device, not a file"):
        load(tmp_path / "pipe")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"x,y\n" + b"1" * 200_000, "is no csv file: field larger than field limit"),
        (b"x\xff,y", "is no csv file: 'utf-8' codec can't decode"),
    ],
)
def test_what_is_no_table_is_refused_by_name(tmp_path, content, said):
    path = tmp_path / "goals.csv"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=rf"goals\.csv {said}"):
        read_csv(path)
