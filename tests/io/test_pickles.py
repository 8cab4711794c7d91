"""Pickles and files of PyTorch are read as data, and nothing in them runs."""

import contextlib
import os
import pickle

import numpy as np
import pytest
from model_pickles import Call, pickled, smpl_fields, smpl_pickle
from torch_files import Tensor, torch_file

from riemhuman.errors import FileFormatError
from riemhuman.io.pickles import load_pickled_arrays, load_torch_tree

FIELDS = smpl_fields(n_vertices=20)
CANARY = "canary"
# Run where the test runs: writes a file of this name.
COMMAND = f"echo alive > {CANARY}"
PROGRAMME = f"open('{CANARY}', 'w').close()"


def text(value):
    """Return the opcode of a text, protocol 4."""
    data = value.encode()
    return b"\x8c" + bytes([len(data)]) + data


def stack_global(module, name):
    return b"\x80\x04" + text(module) + text(name) + b"\x93"


def with_field(value):
    """Return the pickle of a model with another value of a field that is used."""
    return pickled(FIELDS | {"weights": value})


# These do harm when Python reads them, which is checked.
LIVE = {
    "os.system": pickled(Call("os system", (COMMAND,))),
    "protocol 0": pickled(Call("os system", (COMMAND,)), 0),
    "as Python 3 writes it": stack_global("posix", "system") + text(COMMAND) + b"\x85R.",
    "of a built-in": with_field(Call("__builtin__ exec", (PROGRAMME,))),
    "nested in a call of an allowed one": with_field(
        Call("numpy dtype", (Call("os system", (COMMAND,)),))
    ),
    "old instance": b"(S" + repr(COMMAND).encode() + b"\nios\nsystem\n.",
    "old object": b"(cos\nsystem\nS" + repr(COMMAND).encode() + b"\no.",
    "after the model": pickled(FIELDS)[:-1] + b"0" + pickled(Call("os system", (COMMAND,)))[2:],
}

STILL = {
    "a dotted name of an allowed class": stack_global("numpy", "ndarray.tofile") + b".",
    "an object": with_field(Call("__builtin__ object", ())),
    "objects": with_field([Call("__builtin__ object", ())]),
    "a whole number beyond 64 bits": with_field(2**64),
    "no end": smpl_pickle(FIELDS)[:-1],
    "an unknown opcode": b"\x80\x02\xff.",
    "a list": pickled([1]),
}

REFUSED = LIVE | STILL


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.everyday
@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_data_is_refused_and_not_run(folder, case):
    path = folder / "model.pkl"
    path.write_bytes(REFUSED[case])
    with pytest.raises(FileFormatError, match=r"model\.pkl: "):
        load_pickled_arrays(path, tuple(FIELDS))
    assert os.listdir(folder) == ["model.pkl"]


@pytest.mark.parametrize("case", LIVE)
def test_the_live_ones_do_run_in_pythons_own_reader(folder, case):
    with contextlib.suppress(AttributeError, TypeError, pickle.UnpicklingError):
        pickle.loads(LIVE[case], encoding="latin1")
    assert CANARY in os.listdir(folder)


def test_scalars_sets_and_big_endian_numbers(folder):
    for protocol in range(6):
        content = {"a": np.float64(2.5), "b": np.arange(4, dtype=">i4"), "c": np.array(7)}
        content |= {"dirty": {"x", ("y", 1)}, "frozen": frozenset([1])}  # of Python 3
        (folder / "model.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
        found = load_pickled_arrays("model.pkl", ["a", "b", "c"])
        assert found["a"] == 2.5
        assert found["b"].tolist() == [0, 1, 2, 3]
        assert found["c"] == 7


ROWS = np.random.default_rng(0).normal(size=(6, 72))


def test_tensors_of_any_strides(tmp_path):
    stored = ROWS.astype(">f8")
    content = {
        "rows": Tensor(stored),
        "turned": Tensor(stored, strides=(1, 72), shape=(72, 6)),
        "repeated": Tensor(stored, offset=72, shape=(3, 72), strides=(0, 1)),
        "name": "ann",
    }
    tree = load_torch_tree(torch_file(tmp_path / "a.pt", content, byteorder="big"))
    assert tree["name"] == "ann"
    np.testing.assert_array_equal(tree["rows"], ROWS)
    np.testing.assert_array_equal(tree["turned"], ROWS.T)
    np.testing.assert_array_equal(tree["repeated"], [ROWS[1]] * 3)


@pytest.mark.parametrize(
    ("tensor", "message"),
    [
        (Tensor(ROWS, "QInt8Storage"), r"asks for torch\.QInt8Storage"),
        (Tensor(ROWS, shape=(7, 72)), "larger than its data"),
        (Tensor(ROWS, strides=(-72, 1)), "larger than its data"),
    ],
)
def test_tensors_that_are_none(tmp_path, tensor, message):
    file = torch_file(tmp_path / "a.pt", {"poses": tensor})
    with pytest.raises(FileFormatError, match=message):
        load_torch_tree(file)
