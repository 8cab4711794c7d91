"""Steps that are computed once."""

from contextlib import contextmanager

import numpy as np
import pytest

from riemhuman.errors import FileError
from riemhuman.report._storage import ResultStore, fingerprint


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
    first = ResultStore(tmp_path, {}).step("one", {"x": 1}, compute)
    again = ResultStore(tmp_path, {}).step("one", {"x": 1}, compute)
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
    ResultStore(tmp_path, {}).step("one", {"x": 1}, compute)
    ResultStore(tmp_path, common).step("one", inputs, compute)
    assert compute.n_runs == 2


def test_a_step_depends_on_the_steps_before_it(tmp_path):
    compute = Counted()

    def chain(x):
        store = ResultStore(tmp_path, {})
        before = store.step("before", {"x": x}, Counted())
        return store.step("after", {"before": before}, compute)

    chain(1), chain(1)
    assert compute.n_runs == 1
    chain(2)
    assert compute.n_runs == 2


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 half a file", None])
def test_a_damaged_file_is_computed_again(tmp_path, damage):
    compute = Counted()
    ResultStore(tmp_path, {}).step("one", {}, compute)
    file = tmp_path / "one.npz"
    if damage is None:
        np.savez(file, about=np.array("{}"))
    else:
        file.write_bytes(damage)
    assert ResultStore(tmp_path, {}).step("one", {}, compute).record["value"] == 1.0
    assert compute.n_runs == 2


def test_an_interruption_leaves_no_file(tmp_path):
    def interrupted():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ResultStore(tmp_path, {}).step("one", {}, interrupted)
    assert not list(tmp_path.iterdir())


def test_progress_lasts_as_long_as_the_work(tmp_path):
    said = []

    @contextmanager
    def watch(name):
        said.append(f"{name} begins")
        yield
        said.append(f"{name} ends")

    def compute():
        said.append("work")
        return {}, {}

    for _ in range(2):
        ResultStore(tmp_path, {}, watch).step("one", {}, compute, "One")
    assert said == ["One begins", "work", "One ends"]


def test_a_folder_that_is_not_there(tmp_path):
    with pytest.raises(FileError, match="cannot be written"):
        ResultStore(tmp_path / "absent", {}).step("one", {}, Counted())


def test_fingerprints_tell_arrays_apart():
    one = np.arange(6.0)
    assert fingerprint(one) == fingerprint(one.copy())
    others = [one.reshape(2, 3), one.astype(np.float32), one + 1e-15, one.tolist()]
    assert len({fingerprint(other) for other in [one, *others]}) == 5
    assert fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
