"""The folder of a report, and steps that are computed once."""

import json

import numpy as np
import pytest

from riemhuman.errors import ArgumentTypeError, FileError
from riemhuman.report._storage import ResultStore, check_folder, open_folder


def test_new_folders_and_earlier_reports_are_taken(tmp_path):
    folder = tmp_path / "a" / "b"
    assert open_folder(folder) == folder
    (folder / "results" / "one.npz").write_bytes(b"1")
    open_folder(folder)
    assert (folder / "results" / "one.npz").read_bytes() == b"1"
    assert json.loads((folder / "provenance.json").read_text())["status"] == "begun"


def test_a_folder_that_somebody_looked_into_is_empty(tmp_path):
    (tmp_path / ".DS_Store").touch()
    assert check_folder(tmp_path) == tmp_path


@pytest.mark.parametrize("marker", [None, "[]", "not json", '{"made_by": "others"}'])
def test_a_folder_with_something_else_is_left_alone(tmp_path, marker):
    (tmp_path / "thesis.tex").write_text("years of work")
    if marker is not None:
        (tmp_path / "provenance.json").write_text(marker)
    before = sorted(entry.name for entry in tmp_path.iterdir())
    for function in (check_folder, open_folder):
        with pytest.raises(FileError, match="holds other files; the report needs a new or"):
            function(tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == before


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileError, match="is a file"):
        open_folder(tmp_path / "file")
    with pytest.raises(FileError, match="cannot be written"):
        open_folder(tmp_path / "file" / "below")
    with pytest.raises(ArgumentTypeError, match="output must be the path of a folder; found 7"):
        open_folder(7)


@pytest.fixture
def computed(tmp_path):
    """Return a function that asks a store for a step, and its result, and says if it was run."""

    def ask(inputs, common=(), name="one"):
        runs = []

        def compute():
            runs.append(name)
            return {"array": np.full(3, 0.5)}, {"value": 0.5, "name": "λ"}

        step = ResultStore(tmp_path, list(common)).step(name, compute, "Title", **inputs)
        assert step.is_reused != bool(runs)
        assert step.record == {"value": 0.5, "name": "λ"}
        np.testing.assert_array_equal(step.arrays["array"], 0.5)
        return step, bool(runs)

    return ask


@pytest.mark.parametrize(
    ("common", "inputs"),
    [("", {"x": 2}), ("", {"x": 1, "y": 0}), ("2", {"x": 1}), ("", {"x": 1.5})],
)
def test_computed_once_and_again_where_an_input_changes(computed, common, inputs):
    first, is_run = computed({"x": 1})
    again, is_run_again = computed({"x": 1})
    assert (is_run, is_run_again) == (True, False)
    assert (first.seconds, first.fingerprint) == (again.seconds, again.fingerprint)
    assert computed(inputs, common)[1]


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 half a file", None])
def test_a_damaged_file_is_computed_again(computed, tmp_path, damage):
    computed({})
    if damage is None:
        np.savez(tmp_path / "one.npz", about=np.array("{}"))
    else:
        (tmp_path / "one.npz").write_bytes(damage)
    assert computed({})[1]
