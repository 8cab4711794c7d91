"""Files are read if they are files."""

import os
from pathlib import Path

import pytest

from riemhuman.errors import ArgumentTypeError, FileError
from riemhuman.io.files import check_file, file_path, read_bytes, short_message


def test_files_are_read_through_links(tmp_path):
    (tmp_path / "a").write_bytes(b"abc")
    (tmp_path / "b").symlink_to("a")
    for name in ("a", "b"):
        assert check_file(tmp_path / name) == 3
        assert read_bytes(tmp_path / name) == b"abc"


def test_what_is_no_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    for path, message in (
        (tmp_path / "none", "No such file"),
        (tmp_path, "it is a folder"),
        (tmp_path / "pipe", "it is a device or a pipe"),
        (Path("/dev/zero"), "it is a device or a pipe"),
        (tmp_path / "loop", "cannot be read"),
        (Path("a\0b"), "null"),
    ):
        with pytest.raises(FileError, match=message):
            read_bytes(path)


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    def denied(self):
        raise PermissionError(13, "Permission denied")

    (tmp_path / "a").touch()
    monkeypatch.setattr(Path, "read_bytes", denied)
    with pytest.raises(FileError, match="a cannot be read: Permission denied"):
        read_bytes(tmp_path / "a")


def test_paths(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert file_path("~/a") == tmp_path / "a"
    with pytest.raises(ArgumentTypeError, match="labels must be the path of a file; found 3"):
        file_path(3, "labels")


def test_errors_are_told_briefly():
    assert short_message(OSError(2, "No such file")) == "No such file"
    assert short_message(MemoryError()) == "MemoryError"
    assert short_message(ValueError("x" * 1000)) == "x" * 297 + "..."
