"""Places of outputs are checked before the work, and folders appear whole or not at all."""

import errno
import os
import re
import stat
from pathlib import Path

import pytest

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import write_text
from riemhuman.io.outputs import (
    FolderContent,
    atomic_folder,
    check_output_file,
    check_output_folder,
)

CONTENT = FolderContent(r"time_.*", always="time_0")


def test_files_that_can_be_written(tmp_path, monkeypatch):
    check_output_file(tmp_path / "new.npz", [".npz"], force=False)
    (tmp_path / "old.NPZ").touch()
    check_output_file(tmp_path / "old.NPZ", [".npz"], force=True)
    monkeypatch.chdir(tmp_path)
    check_output_file(Path("here.npz"), [".npz"], force=False)
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(FileError, match="no permission in .*; name another place"):
        check_output_file(tmp_path / "new.npz", [".npz"], force=True)
    with pytest.raises(FileError, match="no permission in"):
        check_output_folder(tmp_path / "new", CONTENT, force=True)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("new", FileFormatError, "ending must be .npz; found none"),
        ("old.npz", FileError, "exists; --force replaces it"),
        ("link.npz", FileError, "exists; --force replaces it"),
        ("absent.npz", FileError, "make it first: mkdir -p '.*absent'"),
        ("folder.npz", FileError, "is a folder"),
        ("absent/new.npz", FileError, "make it first: mkdir -p '.*absent'"),
        ("old.npz/new.npz", FileError, "old.npz is a file, not a folder"),
    ],
)
def test_files_that_cannot_be_written(tmp_path, name, error, message):
    (tmp_path / "old.npz").touch()
    (tmp_path / "folder.npz").mkdir()
    os.symlink(tmp_path / "nowhere", tmp_path / "link.npz")
    os.symlink(tmp_path / "absent" / "new.npz", tmp_path / "absent.npz")
    with pytest.raises(error, match=message):
        check_output_file(tmp_path / name, [".npz"], force=name == "absent.npz")


def test_folders(tmp_path):
    old = tmp_path / "old"
    check_output_folder(tmp_path / "new", CONTENT, force=False)
    old.mkdir()
    check_output_folder(old, CONTENT, force=False)
    (old / "time_0").touch()
    check_output_folder(old, CONTENT, force=True)
    with pytest.raises(FileError, match="holds an earlier result; --force"):
        check_output_folder(old, CONTENT, force=False)
    with pytest.raises(FileError, match="is a file; name a folder"):
        check_output_folder(old / "time_0", CONTENT, force=True)
    for add in (
        lambda: (old / "thesis.tex").touch(),
        lambda: (old / "time_1.ply").mkdir(),
        lambda: (old / "time_1.ply").symlink_to(old / "time_0"),
    ):
        add()
        with pytest.raises(FileError, match=r"holds something else"):
            check_output_folder(old, CONTENT, force=True)
        for entry in old.iterdir():
            entry.rmdir() if entry.is_dir() else entry.unlink()
    # Files whose names match, but without the one that a result always has, are the user's own.
    (old / "time_of_my_life.ply").touch()
    for force in (False, True):
        with pytest.raises(FileError, match=r"holds time_of_my_life\.ply, but no time_0"):
            check_output_folder(old, CONTENT, force=force)
    (tmp_path / "link").symlink_to(old)
    with pytest.raises(FileError, match="link is a link"):
        check_output_folder(tmp_path / "link", CONTENT, force=True)


def test_folders_that_somebody_looked_into(tmp_path):
    """File managers add files, which neither make a result nor somebody's own folder."""
    name = "Thumbs.db"
    (tmp_path / name).touch()
    check_output_folder(tmp_path, CONTENT, force=False)
    (tmp_path / "time_0").touch()
    check_output_folder(tmp_path, CONTENT, force=True)
    with pytest.raises(FileError, match="holds an earlier result; --force"):
        check_output_folder(tmp_path, CONTENT, force=False)
    (tmp_path / name).unlink()
    (tmp_path / name).mkdir()
    with pytest.raises(FileError, match="holds something else"):
        check_output_folder(tmp_path, CONTENT, force=True)


def test_a_folder_is_replaced_as_a_whole(tmp_path):
    path = tmp_path / "path"
    for content in ("first", "second"):
        with atomic_folder(path, CONTENT) as temporary:
            (temporary / "time_0").write_text(content)
            assert content == "first" or (path / "time_0").read_text() == "first"
        assert (path / "time_0").read_text() == content
        path.chmod(0o700)

    def fail(error):
        with atomic_folder(path, CONTENT) as temporary:
            (temporary / "time_0").write_text("half")
            raise error

    for error, expected in (
        (KeyboardInterrupt(), KeyboardInterrupt),
        (OSError(28, "No space left on device"), FileError),
    ):
        with pytest.raises(expected):
            fail(error)
        assert (path / "time_0").read_text() == "second"
        assert list(tmp_path.iterdir()) == [path]
    with atomic_folder(path, CONTENT) as temporary:
        (temporary / "time_1").touch()
    assert os.listdir(path) == ["time_1"]
    with pytest.raises(FileError, match=r"something else \(thesis"), atomic_folder(path, CONTENT):
        (path / "thesis.tex").touch()  # by somebody else, meanwhile
    assert sorted(os.listdir(path)) == ["thesis.tex", "time_1"]
    assert stat.S_IMODE(path.stat().st_mode) == 0o700


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of Unix")
def test_pipes_and_devices_are_not_replaced(tmp_path):
    """Not even through links, as with ``ln -s /dev/null log.npz``."""
    os.mkfifo(tmp_path / "pipe")
    path = tmp_path / "pipe.npz"
    path.symlink_to(tmp_path / "pipe")
    with pytest.raises(FileError, match=r"pipe\.npz cannot be written: it is not a regular file"):
        check_output_file(path, [".npz"], force=True)


def test_a_folder_that_cannot_be_moved_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "path"
    path.mkdir()
    (path / "time_0").write_text("old")
    rename = os.rename

    def stopped(source, target):
        if target == path and (source / "time_0").read_text() == "new":
            raise KeyboardInterrupt
        rename(source, target)

    monkeypatch.setattr(os, "rename", stopped)
    with pytest.raises(KeyboardInterrupt), atomic_folder(path, CONTENT) as temporary:
        (temporary / "time_0").write_text("new")
    assert [place.name for place in tmp_path.iterdir()] == ["path"]
    assert (path / "time_0").read_text() == "old"


def test_disks_that_set_no_permissions(tmp_path, monkeypatch):
    """On memory sticks all files have the same; there, even setting these again is refused."""
    (tmp_path / "old.txt").write_text("old")
    (tmp_path / "time").mkdir()
    (tmp_path / "time" / "time_0").touch()

    def refused(path, mode, **options):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "chmod", refused)
    write_text(tmp_path / "old.txt", "newer")
    with atomic_folder(tmp_path / "time", CONTENT) as folder:
        (folder / "time_0").write_text("new")
    assert (tmp_path / "old.txt").read_text() == "newer"
    assert (tmp_path / "time" / "time_0").read_text() == "new"
    assert sorted(os.listdir(tmp_path)) == ["old.txt", "time"]


def test_errors_within_a_folder_name_its_place(tmp_path):
    with (
        pytest.raises(
            FileError, match=re.escape(f"{tmp_path / 'path' / 'no' / '0.txt'} cannot be")
        ),
        atomic_folder(tmp_path / "path") as folder,
    ):
        write_text(folder / "no" / "0.txt", "never written")
