"""Outputs are looked at before the work begins, and appear whole or not at all."""

import os

import pytest

from riemhuman.cli.outputs import check_file, check_folder, claimed, whole_folder
from riemhuman.errors import FileError, FileFormatError


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
    check_file(tmp_path / "new.npz", [".npz"], force=False)
    (tmp_path / "old.NPZ").touch()
    check_file(tmp_path / "old.NPZ", [".npz"], force=True)
    monkeypatch.chdir(tmp_path)
    check_file(tmp_path.relative_to(tmp_path) / "here.npz", [".npz"], force=False)


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
            check_file(tmp_path / name, [".npz"], force=False)


def test_no_permission(tmp_path, unwritable):
    with pytest.raises(FileError, match="no permission in .*; name another place"):
        check_file(tmp_path / "new.npz", [".npz"], force=True)
    with pytest.raises(FileError, match="no permission in"):
        check_folder(tmp_path / "new", is_ours, force=True)


def test_folders(tmp_path):
    check_folder(tmp_path / "new", is_ours, force=False)
    (tmp_path / "old").mkdir()
    check_folder(tmp_path / "old", is_ours, force=False)
    (tmp_path / "old" / "time_0.ply").touch()
    check_folder(tmp_path / "old", is_ours, force=True)
    with pytest.raises(FileError, match="holds an earlier result; --force"):
        check_folder(tmp_path / "old", is_ours, force=False)
    (tmp_path / "old" / "thesis.tex").touch()
    with pytest.raises(FileError, match=r"holds something else \(thesis.tex\)"):
        check_folder(tmp_path / "old", is_ours, force=True)
    with pytest.raises(FileError, match="is a file; name a folder"):
        check_folder(tmp_path / "old" / "thesis.tex", is_ours, force=True)


def test_a_folder_takes_its_place_when_it_is_whole(tmp_path):
    path = tmp_path / "path"
    for content in ("first", "second"):
        with whole_folder(path) as temporary:
            (temporary / "a").write_text(content, encoding="utf-8")
        assert (path / "a").read_text(encoding="utf-8") == content
    with pytest.raises(KeyboardInterrupt), whole_folder(path) as temporary:
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
    with whole_folder(path) as temporary:
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
    with pytest.raises(FileError, match="No space left on device"), whole_folder(path):
        pass
    assert (path / "a").exists()
    assert list(tmp_path.iterdir()) == [path]


def test_refusals_of_writers_pass_unchanged(tmp_path):
    with pytest.raises(FileError, match="^mine$"), whole_folder(tmp_path / "a"):
        raise FileError("mine")
    with pytest.raises(BrokenPipeError), whole_folder(tmp_path / "a"):
        raise BrokenPipeError


def test_an_output_is_claimed_by_one(tmp_path):
    path = tmp_path / "path.npz"
    (tmp_path / ".path.npz.lock").touch()  # left by a process that was killed
    with claimed(path):
        with pytest.raises(FileError, match=r"path\.npz is in use: another process"), claimed(path):
            pass
        with claimed(tmp_path / "other.npz"):
            pass
    assert not list(tmp_path.iterdir())
    with claimed(tmp_path / "absent" / "path.npz"):
        pass
