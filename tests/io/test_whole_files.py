"""Files appear whole or not at all."""

import os
import stat

import pytest

from riemhuman.errors import ArgumentError, FileError
from riemhuman.io.files import atomic_file, new_folder


def test_a_file_is_replaced(tmp_path):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with atomic_file(file) as neighbour:
        neighbour.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def write_half(file, error):
    """Begin to write a file, and fail."""
    with atomic_file(file) as neighbour:
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
    with pytest.raises(FileError, match="^another file"), atomic_file(tmp_path / "a.txt"):
        raise FileError("another file")


def test_a_folder_that_is_not_there(tmp_path):
    with (
        pytest.raises(FileError, match="cannot be written"),
        atomic_file(tmp_path / "b" / "a") as n,
    ):
        n.write_text("x")


def test_what_a_killed_process_left_is_cleared_away(tmp_path):
    file = tmp_path / "a.txt"
    for number in (0, 1, 2):
        (tmp_path / f".a.{number}.part.txt").write_text("half")
    with atomic_file(file) as neighbour:
        assert neighbour.read_text() == ""
        neighbour.write_text("new")
        assert len(list(tmp_path.iterdir())) == 1
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


def test_two_writers_do_not_get_in_each_others_way(tmp_path):
    file = tmp_path / "a.txt"
    with atomic_file(file) as one:
        one.write_text("first")
        with atomic_file(file) as other:
            assert other != one
            other.write_text("second")
        assert file.read_text() == "second"
        assert one.read_text() == "first"
    assert file.read_text() == "first"
    assert list(tmp_path.iterdir()) == [file]


def test_a_link_in_the_way_is_not_followed(tmp_path):
    (tmp_path / "precious").write_text("kept")
    (tmp_path / ".a.0.part.txt").symlink_to(tmp_path / "precious")
    with atomic_file(tmp_path / "a.txt") as neighbour:
        neighbour.write_text("new")
    assert (tmp_path / "precious").read_text() == "kept"
    assert (tmp_path / "a.txt").read_text() == "new"


def test_a_link_is_not_replaced(tmp_path):
    (tmp_path / "precious").write_text("kept")
    for target in ("precious", "nowhere"):
        (tmp_path / target[0]).symlink_to(tmp_path / target)
        with pytest.raises(FileError, match="is a link"), atomic_file(tmp_path / target[0]):
            pass
        assert (tmp_path / target[0]).is_symlink()
    assert (tmp_path / "precious").read_text() == "kept"


@pytest.mark.skipif(os.name == "nt", reason="permissions are others there")
@pytest.mark.parametrize("mode", [0o600, 0o644, 0o400])
def test_a_file_keeps_its_permissions(tmp_path, mode):
    file = tmp_path / "a.txt"
    file.write_text("private")
    file.chmod(mode)
    with atomic_file(file) as neighbour:
        assert stat.S_IMODE(neighbour.stat().st_mode) == mode | 0o600
        neighbour.write_text("new")
    assert stat.S_IMODE(file.stat().st_mode) == mode
    assert file.read_text() == "new"


@pytest.mark.parametrize("error", [OSError(37, "No locks available"), None])
def test_a_file_system_without_locks(tmp_path, monkeypatch, error):
    def refuse(descriptor):
        raise error

    if error is None:
        monkeypatch.setattr("riemhuman.io.files._CAN_LOCK", False)
    else:
        monkeypatch.setattr("riemhuman.io.files.lock", refuse)
    (tmp_path / ".a.0.part.txt").write_text("another's")
    with atomic_file(tmp_path / "a.txt") as neighbour:
        neighbour.write_text("new")
    assert {entry.name for entry in tmp_path.iterdir()} == {"a.txt", ".a.0.part.txt"}
    assert (tmp_path / ".a.0.part.txt").read_text() == "another's"


def test_a_folder_to_take_a_place(tmp_path):
    with new_folder(tmp_path / "a") as folder:
        (folder / "b").touch()
        folder.rename(tmp_path / "a")
        folder.mkdir()  # by another process
    assert {entry.name for entry in tmp_path.iterdir()} == {"a", folder.name}


def test_a_folder_that_fails(tmp_path):
    def fail():
        with new_folder(tmp_path / "a") as folder:
            (folder / "b").touch()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert not list(tmp_path.iterdir())


def test_an_error_without_words_of_the_system(tmp_path):
    with pytest.raises(FileError, match=r"a\.txt cannot be written: 10 requested and 4 written"):
        write_half(tmp_path / "a.txt", OSError("10 requested and 4 written"))
