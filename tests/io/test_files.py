"""Files and folders are written atomically; outputs are checked before the work begins."""

import json
import os
import stat
from pathlib import Path

import pytest

import riemhuman as rh
from riemhuman.errors import ArgumentError, FileError, FileFormatError
from riemhuman.io.files import (
    atomic_file,
    format_errors,
    lock_file,
    read_bytes,
    read_text,
    short_message,
    visible_files,
    write_text,
)


def test_a_file_is_replaced(tmp_path):
    file = tmp_path / "a.txt"
    file.write_text("old")
    with atomic_file(file) as temporary:
        assert temporary.suffix == ".txt"
        temporary.write_text("new")
        assert file.read_text() == "old"
    assert file.read_text() == "new"
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    ("error", "expected", "message"),
    [
        (ArgumentError("wrong"), ArgumentError, "wrong"),
        (KeyboardInterrupt(), KeyboardInterrupt, None),
        (FileError("another file"), FileError, "^another file"),
        (OSError(28, "No space left on device"), FileError, r"a\.txt cannot be written: No space"),
        (OSError("4 written"), FileError, r"a\.txt cannot be written: 4 written"),
    ],
)
def test_what_fails_leaves_the_old_file(tmp_path, error, expected, message):
    file = tmp_path / "a.txt"
    file.write_text("old")

    def write_half():
        with atomic_file(file) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(expected, match=message):
        write_half()
    assert file.read_text() == "old"
    assert list(tmp_path.iterdir()) == [file]


def test_places_where_no_file_can_be_written(tmp_path):
    for place in (tmp_path / "b" / "a", tmp_path, Path(os.devnull)):
        with pytest.raises(FileError, match="cannot be written"):
            write_text(place, "text")


@pytest.mark.skipif(os.name == "nt", reason="permissions are others there")
def test_permissions_and_links(tmp_path):
    file, link = tmp_path / "a.txt", tmp_path / "link.txt"
    for mode in (0o600, 0o644, 0o400):
        file.unlink(missing_ok=True)
        file.touch()
        file.chmod(mode)
        write_text(file, "new")
        assert stat.S_IMODE(file.stat().st_mode) == mode
    (tmp_path / "plain").touch()
    write_text(tmp_path / "new.txt", "text")
    assert (tmp_path / "new.txt").stat().st_mode == (tmp_path / "plain").stat().st_mode
    link.symlink_to(file)
    write_text(link, "through the link")
    assert link.is_symlink()
    assert file.read_text() == "through the link"


def test_only_regular_files_are_read(tmp_path):
    (tmp_path / "text").write_bytes(b"\xef\xbb\xbfZo\xc3\xab")
    assert read_text(tmp_path / "text") == "Zoë"
    (tmp_path / "text").write_bytes("Zoë".encode("utf-16"))
    assert read_text(tmp_path / "text") == "Zoë"
    (tmp_path / "latin").write_bytes(b"Zo\xeb")
    with pytest.raises(FileFormatError, match="is not text in UTF-8"):
        read_text(tmp_path / "latin")
    os.mkfifo(tmp_path / "pipe.ply")
    for read, place, message in [
        (read_bytes, tmp_path, "it is a folder"),
        (read_bytes, Path("/dev/zero"), "it is a device or a pipe"),
        # Opening it would wait for a writer.
        (rh.io.is_registered_scan, tmp_path / "pipe.ply", "it is a device or a pipe"),
        (read_bytes, tmp_path / "none", "there is no file .*none"),
    ]:
        with pytest.raises(FileError, match=message):
            read(place)
    assert len(short_message(ValueError("x" * 9999))) == 300


def test_hidden_files_are_left_out(tmp_path):
    for name in ("b.npz", "a.NPZ", "a.txt", "._a.npz", "in/c.npz", ".git/d.npz"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    names = [file.name for file in visible_files(tmp_path, ".npz")]
    assert names == ["a.NPZ", "b.npz"]
    deep = [file.name for file in visible_files(tmp_path, ".npz", deep=True)]
    assert sorted(deep) == ["a.NPZ", "b.npz", "c.npz"]


def test_damage_is_named_with_its_file():
    message = r"a\.json: damaged, or not a document: .*recursion"
    with pytest.raises(FileFormatError, match=message), format_errors("a.json", "a document"):
        json.loads("[" * 50_000 + "]" * 50_000)
    with pytest.raises(MemoryError), format_errors("a.json", "a document"):
        raise MemoryError


def test_a_lock_is_for_one_process(tmp_path):
    file = tmp_path / "a.lock"
    with lock_file(file, "busy with it"):
        with pytest.raises(FileError, match="^busy with it$"), lock_file(file, "busy with it"):
            pass
        assert file.exists()
    assert not file.exists()
    # The lock of a process that was killed is free, although its file is left.
    file.touch()
    with lock_file(file, "busy"):
        pass
    assert not file.exists()
