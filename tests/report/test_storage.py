"""The folder of a report, and steps that are computed once."""

import json

import numpy as np
import pytest

from riemhuman.errors import ArgumentTypeError, FileError
from riemhuman.report._storage import _MARKER as MARKER
from riemhuman.report._storage import _SUBFOLDERS as SUBFOLDERS
from riemhuman.report._storage import (
    ResultStore,
    check_folder,
    fingerprint,
    open_folder,
    write_provenance,
)


def test_new_folders_and_earlier_reports_are_taken(tmp_path):
    folder = tmp_path / "a" / "b"
    assert open_folder(folder) == folder
    assert {entry.name for entry in folder.iterdir()} == {MARKER, *SUBFOLDERS[:3]}
    write_provenance(folder, {"status": "finished"})
    (folder / "results" / "one.npz").write_bytes(b"1")
    open_folder(folder)
    assert (folder / "results" / "one.npz").read_bytes() == b"1"
    assert json.loads((folder / MARKER).read_text())["status"] == "begun"


@pytest.mark.parametrize("marker", [None, "{}", "[]", "not json", '{"made_by": "others"}'])
def test_a_folder_with_something_else_is_left_alone(tmp_path, marker):
    (tmp_path / "thesis.tex").write_text("years of work")
    if marker is not None:
        (tmp_path / MARKER).write_text(marker)
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


class Counted:
    """A computation that counts how often it is run."""

    def __init__(self, value=1.0):
        self.n_runs = 0
        self.value = value

    def __call__(self):
        self.n_runs += 1
        return {"array": np.full(3, self.value)}, {"value": self.value, "name": "λ"}


def test_computed_once_and_read_after(tmp_path):
    compute = Counted()
    first = ResultStore(tmp_path, {}).step("one", {"x": 1}, compute, "One")
    again = ResultStore(tmp_path, {}).step("one", {"x": 1}, compute, "One")
    assert compute.n_runs == 1
    assert (first.is_reused, again.is_reused) == (False, True)
    np.testing.assert_array_equal(first.arrays["array"], again.arrays["array"])
    assert first.record == again.record == {"value": 1.0, "name": "λ"}
    assert first.seconds == again.seconds
    assert first.fingerprint == again.fingerprint


@pytest.mark.parametrize(
    ("common", "inputs"),
    [({}, {"x": 2}), ({}, {"x": 1, "y": 0}), ({"version": "2"}, {"x": 1}), ({}, {"x": 1.5})],
)
def test_computed_again_where_an_input_changes(tmp_path, common, inputs):
    compute = Counted()
    ResultStore(tmp_path, {}).step("one", {"x": 1}, compute, "One")
    ResultStore(tmp_path, common).step("one", inputs, compute, "One")
    assert compute.n_runs == 2


def test_a_step_depends_on_the_steps_before_it(tmp_path):
    compute = Counted()

    def chain(x):
        store = ResultStore(tmp_path, {})
        before = store.step("before", {"x": x}, Counted(), "Before")
        return store.step("after", {"before": before}, compute, "After")

    chain(1), chain(1)
    assert compute.n_runs == 1
    chain(2)
    assert compute.n_runs == 2


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 half a file", None])
def test_a_damaged_file_is_computed_again(tmp_path, damage):
    compute = Counted()
    ResultStore(tmp_path, {}).step("one", {}, compute, "One")
    file = tmp_path / "one.npz"
    if damage is None:
        np.savez(file, about=np.array("{}"))
    else:
        file.write_bytes(damage)
    assert ResultStore(tmp_path, {}).step("one", {}, compute, "One").record["value"] == 1.0
    assert compute.n_runs == 2


def test_fingerprints_tell_arrays_apart():
    one = np.arange(6.0)
    assert fingerprint(one) == fingerprint(one.copy())
    others = [one.reshape(2, 3), one.astype(np.float32), one + 1e-15, one.tolist()]
    assert len({fingerprint(other) for other in [one, *others]}) == 5
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
