"""Files that are replaced whole or not at all, locks that nobody waits for, folders that cannot be made."""

import json
import math
import os
import subprocess
import sys

import pytest

from sgimd_torch.files import lock, locked, make_folder, replacing, write_bytes, write_json, write_text


@pytest.mark.parametrize("write", [lambda path: write_bytes(path, b"new\n"), lambda path: write_text(path, "new\n")])
def test_a_file_is_replaced_and_nothing_else_is_left(tmp_path, write):
    path = tmp_path / "a.txt"
    path.write_text("old")
    write(path)
    assert path.read_bytes() == b"new\n"
    assert os.listdir(tmp_path) == ["a.txt"]


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


def test_a_folder_is_not_replaced(tmp_path):
    with pytest.raises(IsADirectoryError, match="was the name of the file left out"):
        write_text(tmp_path, "x")
    assert os.listdir(tmp_path) == []


def test_what_is_not_finite_becomes_null_in_json(tmp_path):
    write_json(tmp_path / "a.json", {"error": math.nan, "floor": math.inf, "n": 3, "name": "ä"})
    assert json.loads((tmp_path / "a.json").read_text()) == {"error": None, "floor": None, "n": 3, "name": "ä"}


def test_a_lock_has_one_holder_until_it_is_closed(tmp_path):
    path = tmp_path / "lock"
    assert not locked(path)
    assert not path.exists()  # to ask makes no file
    file = lock(path)
    assert locked(path)
    with pytest.raises(BlockingIOError):
        lock(path)
    os.close(file)
    assert not locked(path)
    os.close(lock(path))


def test_a_folder_that_cannot_be_made_names_what_is_in_the_way(tmp_path):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"file/runs/x cannot be made: .*file is no folder; choose another --out"):
        make_folder(tmp_path / "file" / "runs" / "x")


def test_a_system_without_flock_imports_all_and_is_told_what_it_lacks(tmp_path):
    program = (
        "import sys; sys.modules['fcntl'] = None\n"
        "import sgimd_torch, sgimd_torch.runs.directory, sgimd_torch.runs.read\n"
        "from sgimd_torch.files import lock, locked\n"
        f"assert not locked({str(tmp_path)!r})\n"
        f"lock({str(tmp_path / 'lock')!r})"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert "OSError" in done.stderr
    assert "lock cannot be locked: this system has no flock; runs need Linux or macOS" in done.stderr
