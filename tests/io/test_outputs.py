"""Places of outputs are checked before the work, and folders appear whole or not at all."""

import errno
import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from riemhuman.errors import FileError, FileFormatError
from riemhuman.io.files import write_text
from riemhuman.io.job_folder import JobFolder
from riemhuman.io.outputs import (
    FolderContent,
    atomic_folder,
    check_output_file,
    check_output_folder,
    files_together,
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


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("new", FileFormatError, "ending must be .npz; found none"),
        ("new.txt", FileFormatError, "ending must be .npz; found '.txt'"),
        ("old.npz", FileError, "exists; --force replaces it"),
        ("link.npz", FileError, "exists; --force replaces it"),
        ("folder.npz", FileError, "is a folder"),
        ("absent/new.npz", FileError, "make it first: mkdir -p '.*absent'"),
        ("old.npz/new.npz", FileError, "old.npz is a file, not a folder"),
    ],
)
def test_files_that_cannot_be_written(tmp_path, name, error, message):
    (tmp_path / "old.npz").touch()
    (tmp_path / "folder.npz").mkdir()
    os.symlink(tmp_path / "nowhere", tmp_path / "link.npz")
    with pytest.raises(error, match=message):
        check_output_file(tmp_path / name, [".npz"], force=False)


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


@pytest.mark.parametrize("name", [".DS_Store", "Thumbs.db"])
def test_folders_that_somebody_looked_into(tmp_path, name):
    """File managers add files, which neither make a result nor somebody's own folder."""
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
        (BrokenPipeError(), BrokenPipeError),
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


WRITE = """
import sys
from pathlib import Path
from riemhuman.io.outputs import atomic_folder
with atomic_folder(Path(sys.argv[1])) as temporary:
    (temporary / "time_0").touch()
    print("begun", flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("other", ["path", "other"])
def test_what_a_killed_writer_left_is_removed(tmp_path, other):
    """By the next writer of this folder or of one beside it, and not while the writer lives."""
    command = [sys.executable, "-c", WRITE, str(tmp_path / "path")]
    writer = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert writer.stdout.readline() == "begun\n"
    (hidden,) = (place for place in tmp_path.iterdir() if place.is_dir())
    with atomic_folder(tmp_path / "first", CONTENT) as temporary:
        (temporary / "time_0").touch()
    assert (hidden / "time_0").exists()
    writer.kill()
    writer.communicate()
    assert hidden.exists()
    with (
        pytest.warns(UserWarning, match=f"killed process had left in .*: {re.escape(hidden.name)}"),
        atomic_folder(tmp_path / other, CONTENT) as temporary,
    ):
        (temporary / "time_0").touch()
    assert {place.name for place in tmp_path.iterdir()} == {"first", other}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes of Unix")
@pytest.mark.parametrize("is_link", [False, True])
def test_pipes_and_devices_are_not_replaced(tmp_path, is_link):
    """Not even through links, as with ``ln -s /dev/null log.npz``."""
    special = tmp_path / ("pipe" if is_link else "pipe.npz")
    os.mkfifo(special)
    path = tmp_path / "pipe.npz"
    if is_link:
        path.symlink_to(special)
    with pytest.raises(FileError, match=r"pipe\.npz cannot be written: it is not a regular file"):
        check_output_file(path, [".npz"], force=True)


def test_a_link_is_written_where_it_points(tmp_path):
    (tmp_path / "link.npz").symlink_to(tmp_path / "absent" / "new.npz")
    with pytest.raises(FileError, match="make it first: mkdir -p '.*absent'"):
        check_output_file(tmp_path / "link.npz", [".npz"], force=True)


# The last two share the first letters of their names, which hidden names begin with.
@pytest.mark.parametrize("other", ["path", "other", "path.v2", "p" * 50])
def test_a_folder_that_was_to_be_replaced_is_put_back(tmp_path, monkeypatch, other):
    """Where its writer was killed between two renames, by the writer of any folder beside it."""
    path = tmp_path / ("p" * 51 if other == "p" * 50 else "path")
    path.mkdir()
    (path / "time_0").write_text("old")
    copy = tmp_path / "copy"
    rename = os.rename

    def copy_all(source, target):
        if target == path:  # the second rename: what a kill would leave
            copy.mkdir()
            for place in tmp_path.glob(".*"):
                if place.is_dir():
                    shutil.copytree(place, copy / place.name)
                else:
                    (copy / place.name).touch()
        rename(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "rename", copy_all)
        with atomic_folder(path, CONTENT) as temporary:
            (temporary / "time_0").write_text("new")
    thesis = copy / ".thesis.part.lock"
    thesis.touch()
    with (
        pytest.raises(KeyboardInterrupt),
        pytest.warns(UserWarning, match="killed") as warned,
        atomic_folder(copy / other, CONTENT),
    ):
        raise KeyboardInterrupt
    assert any(f": {path.name}" in str(warning.message) for warning in warned)
    assert {place.name for place in copy.iterdir()} == {path.name, thesis.name}
    assert (copy / path.name / "time_0").read_text() == "old"


def test_an_interruption_between_two_renames_leaves_the_old_folder(tmp_path, monkeypatch):
    path = tmp_path / "path"
    path.mkdir()
    (path / "time_0").write_text("old")
    rename = os.rename

    def interrupted(source, target):
        rename(source, target)
        if source == path:
            raise KeyboardInterrupt

    monkeypatch.setattr(os, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), atomic_folder(path, CONTENT) as temporary:
        (temporary / "time_0").write_text("new")
    assert [place.name for place in tmp_path.iterdir()] == ["path"]
    assert (path / "time_0").read_text() == "old"


def test_a_folder_that_cannot_be_renamed_leaves_the_old_one(tmp_path, monkeypatch):
    path = tmp_path / "path"
    path.mkdir()
    (path / "time_0").touch()
    rename = os.rename

    def refuse_new(source, target):
        if target == path and (source / "time_1").exists():
            raise OSError(28, "No space left on device")
        rename(source, target)

    monkeypatch.setattr(os, "rename", refuse_new)
    with pytest.raises(FileError, match="No space left"), atomic_folder(path, CONTENT) as temporary:
        (temporary / "time_1").touch()
    assert os.listdir(path) == ["time_0"]
    assert list(tmp_path.iterdir()) == [path]


WRITE_TWO = """
import sys
from pathlib import Path
from riemhuman.io.outputs import files_together
folder = Path(sys.argv[1])
with files_together({"table": folder / "D.csv", "matrix": folder / "D.npz"}) as places:
    places["table"].touch()
    print("begun", flush=True)
    sys.stdin.read()
"""


def test_what_a_killed_writer_of_files_left_is_removed(tmp_path):
    """By the next writer, and not while the first one lives."""
    command = [sys.executable, "-c", WRITE_TWO, str(tmp_path)]
    writer = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert writer.stdout.readline() == "begun\n"
    (hidden,) = (place for place in tmp_path.iterdir() if place.is_dir())
    with files_together({"table": tmp_path / "other.csv"}) as places:
        places["table"].touch()
    assert (hidden / "D.csv").exists()
    writer.kill()
    writer.communicate()
    with (
        pytest.warns(UserWarning, match=f"killed process had left in .*: {re.escape(hidden.name)}"),
        files_together({"table": tmp_path / "D.csv"}) as places,
    ):
        places["table"].touch()
    assert {place.name for place in tmp_path.iterdir()} == {"D.csv", "other.csv"}


@pytest.mark.skipif(sys.platform == "win32", reason="locks of Unix")
@pytest.mark.parametrize("number", [errno.ENOLCK, errno.EOPNOTSUPP])
def test_folders_without_locks_are_written_too(tmp_path, monkeypatch, number):
    """Some network folders have none: files and folders appear, and nothing hidden stays."""
    import fcntl

    def no_lock(descriptor, operation):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", no_lock)
    (tmp_path / "old.txt").write_text("old")
    with files_together({"text": tmp_path / "old.txt"}) as places:
        places["text"].write_text("new")
    with atomic_folder(tmp_path / "path") as folder:
        (folder / "0.ply").touch()
    assert sorted(os.listdir(tmp_path)) == ["old.txt", "path"]
    assert (tmp_path / "old.txt").read_text() == "new"


def test_disks_that_set_no_permissions(tmp_path, monkeypatch):
    """On memory sticks all files have the same; there, even setting these again is refused."""
    (tmp_path / "old.txt").write_text("old")
    (tmp_path / "time").mkdir()
    (tmp_path / "time" / "time_0").touch()

    def refused(path, mode, **options):
        raise PermissionError(errno.EPERM, os.strerror(errno.EPERM))

    monkeypatch.setattr(os, "chmod", refused)
    write_text(tmp_path / "old.txt", "newer")
    with files_together({"text": tmp_path / "old.txt"}) as places:
        places["text"].write_text("newest")
    with atomic_folder(tmp_path / "time", CONTENT) as folder:
        (folder / "time_0").write_text("new")
    assert (tmp_path / "old.txt").read_text() == "newest"
    assert (tmp_path / "time" / "time_0").read_text() == "new"
    assert sorted(os.listdir(tmp_path)) == ["old.txt", "time"]


def test_files_of_several_folders_appear_together(tmp_path):
    places = {name: tmp_path / name / "table.csv" for name in ("first", "second")}
    for place in places.values():
        place.parent.mkdir()

    def write(error=None):
        with files_together(places) as hidden:
            assert {file.name for file in hidden.values()} == {"table.csv"}
            for name, file in hidden.items():
                file.write_text(name)
            if error is not None:
                raise error

    with pytest.raises(KeyboardInterrupt):
        write(KeyboardInterrupt())
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]
    write()
    assert all(place.read_text() == name for name, place in places.items())
    assert not list(tmp_path.rglob(".*"))


@pytest.mark.parametrize("error", [OSError(errno.EACCES, "in use"), KeyboardInterrupt()])
@pytest.mark.parametrize("links", [True, False])
def test_no_file_appears_if_another_cannot_be_moved(tmp_path, monkeypatch, error, links):
    """As on Windows, where a table that another program shows cannot be replaced."""
    places = {name: tmp_path / f"{name}.txt" for name in ("old", "new", "shown")}
    before = {"old.txt": "old", "shown.txt": "shown"}
    for name, text in before.items():
        (tmp_path / name).write_text(text)
    replace = os.replace

    def replace_others(source, target):
        if target == places["shown"]:
            raise error
        replace(source, target)

    def no_link(*names):
        raise OSError(errno.EPERM, "no links")

    def write():
        with files_together(places) as hidden:
            for file in hidden.values():
                file.write_text("written")

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", replace_others)
        if not links:
            patch.setattr(os, "link", no_link)
        with pytest.raises((FileError, KeyboardInterrupt)):
            write()
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == before
    write()
    assert {file.read_text() for file in tmp_path.iterdir()} == {"written"}
    assert sorted(os.listdir(tmp_path)) == ["new.txt", "old.txt", "shown.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps working folders")
def test_working_folders_that_are_gone(tmp_path, monkeypatch):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    message = "out.* cannot be .*: "
    with pytest.raises(FileError, match=f"{message}the working folder exists no longer"):
        check_output_file(Path("out.npz"), [".npz"], force=False)
    with pytest.raises(FileError, match=f"{message}the working folder exists no longer"):
        check_output_folder(Path("out"), CONTENT, force=False)
    with (
        pytest.raises(FileError, match=f"{message}the working folder exists no longer"),
        atomic_folder(Path("out")),
    ):
        pass
    with pytest.raises(FileError, match=f"{message}.*No such file"):
        JobFolder("out")


def test_errors_within_a_folder_name_its_place(tmp_path):
    with (
        pytest.raises(
            FileError, match=re.escape(f"{tmp_path / 'path' / 'no' / '0.txt'} cannot be")
        ),
        atomic_folder(tmp_path / "path") as folder,
    ):
        write_text(folder / "no" / "0.txt", "never written")
