"""The folder of a report."""

import json
import os

import pytest

from riemhuman.errors import ArgumentTypeError, FileError
from riemhuman.report._storage import _MARKER as MARKER
from riemhuman.report._storage import _SUBFOLDERS as SUBFOLDERS
from riemhuman.report._storage import check_folder, open_folder, write_provenance


def enter(path):
    """Open a folder, and close it again."""
    with open_folder(path):
        pass


@pytest.mark.parametrize("there", [True, False])
def test_new_and_empty_folders_are_taken(tmp_path, there):
    folder = tmp_path / "a" / "b"
    if there:
        folder.mkdir(parents=True)
    with open_folder(folder) as opened:
        assert opened == folder
    assert {entry.name for entry in folder.iterdir()} == {MARKER, *SUBFOLDERS[:3]}


def test_an_earlier_report_is_taken_and_keeps_its_files(tmp_path):
    with open_folder(tmp_path / "report"):
        pass
    write_provenance(tmp_path / "report", {"status": "finished"})
    (tmp_path / "report" / "results" / "one.npz").write_bytes(b"1")
    with open_folder(tmp_path / "report"):
        pass
    assert (tmp_path / "report" / "results" / "one.npz").read_bytes() == b"1"
    assert json.loads((tmp_path / "report" / MARKER).read_text())["status"] == "begun"


def test_a_check_writes_nothing(tmp_path):
    assert check_folder(tmp_path / "new") == tmp_path / "new"
    assert check_folder(tmp_path) == tmp_path
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("marker", [None, "{}", "[]", "not json", '{"made_by": "others"}'])
def test_a_folder_with_something_else_is_left_alone(tmp_path, marker):
    (tmp_path / "thesis.tex").write_text("years of work")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
    before = sorted(entry.name for entry in tmp_path.iterdir())
    for function in (check_folder, enter):
        with pytest.raises(FileError, match="holds other files; the report needs a new or"):
            function(tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == before


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="is a file"):
        enter(tmp_path / "file")
    with pytest.raises(FileError, match="cannot be written"):
        enter(tmp_path / "file" / "below")
    with pytest.raises(ArgumentTypeError, match="output must be the path of a folder; found 7"):
        enter(7)


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="permissions do not bind")
def test_no_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(FileError, match="cannot be written: Permission denied"):
        enter(tmp_path / "report")
    tmp_path.chmod(0o700)
