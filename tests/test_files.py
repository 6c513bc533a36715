"""Files that are replaced whole or not at all, folders that cannot be made."""

import os

import pytest

from sgimd_torch.files import make_folder, replacing, write_bytes, write_text


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


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    make_folder(tmp_path / "a" / "b")
    make_folder(tmp_path / "a" / "b")
    (tmp_path / "file").touch()
    with pytest.raises(OSError, match=r"file/runs/x cannot be made: .*a file in its place"):
        make_folder(tmp_path / "file" / "runs" / "x")
