"""Outputs are looked at before the work begins, and appear whole or not at all."""

import os
import stat

import pytest

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.outputs import atomic_folder, check_output_file, check_output_folder, lock_output


def is_ours(name):
    return name.startswith("time_")


@pytest.fixture
def unwritable(monkeypatch):
    """Let no folder be writable, whoever runs the tests."""
    monkeypatch.setattr(os, "access", lambda path, mode: False)


def interrupted(path):
    path.write_text("half", encoding="utf-8")
    raise KeyboardInterrupt


def test_files_that_can_be_written(tmp_path, monkeypatch):
    check_output_file(tmp_path / "new.npz", [".npz"], force=False)
    (tmp_path / "old.NPZ").touch()
    check_output_file(tmp_path / "old.NPZ", [".npz"], force=True)
    monkeypatch.chdir(tmp_path)
    check_output_file(tmp_path.relative_to(tmp_path) / "here.npz", [".npz"], force=False)


def test_files_that_cannot_be_written(tmp_path):
    (tmp_path / "old.npz").touch()
    (tmp_path / "folder.npz").mkdir()
    os.symlink(tmp_path / "nowhere", tmp_path / "link.npz")
    for name, error, message in [
        ("new", FileFormatError, "ending must be .npz; found none"),
        ("new.txt", FileFormatError, "ending must be .npz; found '.txt'"),
        ("old.npz", FileError, "exists; --force replaces it"),
        ("link.npz", FileError, "exists; --force replaces it"),
        ("folder.npz", FileError, "is a folder"),
        ("absent/new.npz", FileError, "make it first: mkdir -p '.*absent'"),
        ("old.npz/new.npz", FileError, "old.npz is a file, not a folder"),
    ]:
        with pytest.raises(error, match=message):
            check_output_file(tmp_path / name, [".npz"], force=False)


def test_no_permission(tmp_path, unwritable):
    with pytest.raises(FileError, match="no permission in .*; name another place"):
        check_output_file(tmp_path / "new.npz", [".npz"], force=True)
    with pytest.raises(FileError, match="no permission in"):
        check_output_folder(tmp_path / "new", is_ours, force=True)


def test_folders(tmp_path):
    check_output_folder(tmp_path / "new", is_ours, force=False)
    (tmp_path / "old").mkdir()
    check_output_folder(tmp_path / "old", is_ours, force=False)
    (tmp_path / "old" / "time_0.ply").touch()
    check_output_folder(tmp_path / "old", is_ours, force=True)
    with pytest.raises(FileError, match="holds an earlier result; --force"):
        check_output_folder(tmp_path / "old", is_ours, force=False)
    (tmp_path / "old" / "thesis.tex").touch()
    with pytest.raises(FileError, match=r"holds something else \(thesis.tex\)"):
        check_output_folder(tmp_path / "old", is_ours, force=True)
    with pytest.raises(FileError, match="is a file; name a folder"):
        check_output_folder(tmp_path / "old" / "thesis.tex", is_ours, force=True)


def anything(name):
    return True


def test_folders_that_hold_links_and_folders_are_left_alone(tmp_path):
    precious = tmp_path / "precious"
    precious.mkdir()
    (precious / "time_0.ply").write_text("kept")
    folder = tmp_path / "old"
    folder.mkdir()
    for make in (lambda path: path.symlink_to(precious / "time_0.ply"), os.mkdir):
        make(folder / "time_0.ply")
        with pytest.raises(FileError, match=r"holds something else \(time_0.ply\)"):
            check_output_folder(folder, is_ours, force=True)
        assert os.path.lexists(folder / "time_0.ply")
        (folder / "time_0.ply").unlink() if make is not os.mkdir else None
    (tmp_path / "link").symlink_to(precious)
    with pytest.raises(FileError, match="link is a link"):
        check_output_folder(tmp_path / "link", is_ours, force=True)


def test_what_came_into_a_folder_meanwhile_is_left_alone(tmp_path):
    path = tmp_path / "path"
    with atomic_folder(path, is_ours) as temporary:
        (temporary / "time_0.ply").write_text("old")

    def replace():
        with atomic_folder(path, is_ours) as temporary:
            (temporary / "time_0.ply").write_text("new")
            (path / "thesis.tex").write_text("years of work")

    with pytest.raises(FileError, match=r"holds something else \(thesis.tex\)"):
        replace()
    assert {entry.name for entry in path.iterdir()} == {"time_0.ply", "thesis.tex"}
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.skipif(os.name == "nt", reason="permissions are others there")
@pytest.mark.parametrize("can_exchange", [True, False])
def test_folders_and_their_files_keep_their_permissions(tmp_path, monkeypatch, can_exchange):
    if not can_exchange:
        monkeypatch.setattr("sys.platform", "plan9")
    path = tmp_path / "path"
    path.mkdir(0o700)
    (path / "time_0.ply").touch(0o600)
    with atomic_folder(path, is_ours) as temporary:
        (temporary / "time_0.ply").touch()
    assert stat.S_IMODE(path.stat().st_mode) == 0o700
    assert stat.S_IMODE((path / "time_0.ply").stat().st_mode) == 0o600


def test_a_lock_that_is_something_else_is_left_alone(tmp_path):
    (tmp_path / "precious").write_text("kept")
    lock = tmp_path / ".path.npz.lock"
    for make in (
        lambda: lock.symlink_to(tmp_path / "precious"),
        lambda: lock.symlink_to(tmp_path / "nowhere"),
        lambda: os.link(tmp_path / "precious", lock),
        lambda: lock.write_text("something"),
    ):
        make()
        with pytest.raises(FileError, match="move it away"), lock_output(tmp_path / "path.npz"):
            pass
        lock.unlink()
    assert (tmp_path / "precious").read_text() == "kept"
    assert not (tmp_path / "nowhere").exists()


def test_a_folder_takes_its_place_when_it_is_whole(tmp_path):
    path = tmp_path / "path"
    for content in ("first", "second"):
        with atomic_folder(path, anything) as temporary:
            (temporary / "a").write_text(content, encoding="utf-8")
        assert (path / "a").read_text(encoding="utf-8") == content
    with pytest.raises(KeyboardInterrupt), atomic_folder(path, anything) as temporary:
        interrupted(temporary / "a")
    assert (path / "a").read_text(encoding="utf-8") == "second"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("can_exchange", [True, False])
def test_a_folder_is_replaced_with_and_without_the_system_call(tmp_path, monkeypatch, can_exchange):
    path = tmp_path / "path"
    path.mkdir()
    (path / "a").write_text("old", encoding="utf-8")
    if not can_exchange:
        monkeypatch.setattr("sys.platform", "plan9")
    with atomic_folder(path, anything) as temporary:
        (temporary / "b").write_text("new", encoding="utf-8")
    assert [file.name for file in path.iterdir()] == ["b"]
    assert list(tmp_path.iterdir()) == [path]


def test_a_folder_that_cannot_take_its_place_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "path"
    path.mkdir()
    (path / "a").touch()
    rename = os.rename

    def refuse_new(source, target):
        if str(source).endswith(".folder"):
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr("sys.platform", "plan9")
    monkeypatch.setattr(os, "rename", refuse_new)
    with pytest.raises(FileError, match="No space left on device"), atomic_folder(path, anything):
        pass
    assert (path / "a").exists()
    assert list(tmp_path.iterdir()) == [path]


def test_refusals_of_writers_pass_unchanged(tmp_path):
    with pytest.raises(FileError, match="^mine$"), atomic_folder(tmp_path / "a", anything):
        raise FileError("mine")
    with pytest.raises(BrokenPipeError), atomic_folder(tmp_path / "a", anything):
        raise BrokenPipeError


def test_an_output_is_claimed_by_one(tmp_path):
    path = tmp_path / "path.npz"
    (tmp_path / ".path.npz.lock").touch()  # left by a process that was killed
    with lock_output(path):
        with (
            pytest.raises(FileError, match=r"path\.npz is in use: another process"),
            lock_output(path),
        ):
            pass
        with lock_output(tmp_path / "other.npz"):
            pass
    assert not list(tmp_path.iterdir())
    with lock_output(tmp_path / "absent" / "path.npz"):
        pass
