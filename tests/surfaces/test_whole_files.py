"""Files appear whole or not at all."""

import pytest

from riemhuman.errors import ArgumentError, FileError
from riemhuman.surfaces.whole_files import whole_file


def test_a_file_is_replaced(tmp_path):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with whole_file(file) as neighbour:
        neighbour.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def write_half(file, error):
    """Begin to write a file, and fail."""
    with whole_file(file) as neighbour:
        neighbour.write_text("half")
        raise error


@pytest.mark.parametrize("error", [ArgumentError("wrong"), KeyboardInterrupt()])
def test_nothing_is_left_of_what_fails(tmp_path, error):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with pytest.raises(type(error)):
        write_half(file, error)
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_a_full_disk_is_named(tmp_path):
    file = tmp_path / "a.txt"
    with pytest.raises(FileError, match=r"a\.txt cannot be written: No space left"):
        write_half(file, OSError(28, "No space left on device"))
    assert list(tmp_path.iterdir()) == []


def test_an_error_of_ours_is_left_as_it_is(tmp_path):
    with pytest.raises(FileError, match="^another file"), whole_file(tmp_path / "a.txt"):
        raise FileError("another file")


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="cannot be written"), whole_file(tmp_path / "b" / "a") as n:
        n.write_text("x")
