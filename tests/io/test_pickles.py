"""Hostile pickles and files of PyTorch are refused, and nothing in them runs."""

import contextlib
import os
import pickle
import struct
import tracemalloc

import numpy as np
import pytest
from model_pickles import Call, Raw, ch, pickled, select, smpl_fields, smpl_pickle
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


def array_opcodes(shape, code="f8", data=b"", order=False):
    """Return the opcodes of an array that claims this shape and type."""
    dtype = Call("numpy dtype", (code, 0, 1))
    empty = Call("numpy.core.multiarray _reconstruct", (Raw(b"cnumpy\nndarray\n"), (0,), "b"))
    state = (1, shape, dtype, order, data)
    return Raw(pickled(empty)[2:-1] + pickled(state)[2:-1] + b"b")


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
    "a dotted name": stack_global("numpy", "f2py.os.system") + text(COMMAND) + b"\x85R.",
    "a dotted name of an allowed class": stack_global("numpy", "ndarray.tofile") + b".",
    "an allowed name, called where it is not": with_field(Call("chumpy.ch Ch", ("x",))),
    "ndarray, called": with_field(Call("numpy ndarray", ((2**40,),))),
    "arguments for chumpy": with_field(Raw(b"cchumpy.ch\nCh\nK\x01\x85\x81")),
    "a call of what is no name": with_field(Raw(b"U\x01a)R")),
    "a state for a function": with_field(Raw(b"c_codecs\nencode\n}U\x08__code__K\x01sb")),
    "reconstruct of something else": with_field(
        Call("numpy.core.multiarray _reconstruct", (Raw(b"cnumpy\ndtype\n"), (0,), "b"))
    ),
    "an array of objects": with_field(array_opcodes((1,), "O8", [1])),
    "a vast array without data": with_field(array_opcodes((2**31 - 1, 2**20))),
    "a vast text array": with_field(array_opcodes((10,), "S99999", b"a")),
    "data beyond latin 1": with_field(
        array_opcodes((1,), data=Raw(b"X\x18\x00\x00\x00" + "€".encode() * 8))
    ),
    "a vast text": b"\x80\x04\x8d" + struct.pack("<Q", 2**40) + b"a.",
    "a negative length": b"\x80\x02T" + struct.pack("<i", -1) + b"a.",
    "a vast number": b"\x80\x02\x8b" + struct.pack("<i", 10**6) + b"\x7f" * 10**6 + b".",
    "a vast number in digits": b"L" + b"9" * 10**6 + b"L\n.",
    "many opcodes": b"\x80\x02" + b"]" * 60_000 + b".",
    "a deep nest as a key": b"\x80\x02}]" + b"\x85" * 45_000 + b"Ns.",
    "one text for many arrays": pickled(
        {"a": Raw(b"T\xa0\x86\x01\x00" + b"a" * 100_000 + b"q\x01")}
    )[:-1]
    + b"]("
    + b"".join(pickled(array_opcodes((100_000,), "i1", Raw(b"h\x01")))[2:-1] for _ in range(99))
    + b"e.",
    "an extension": with_field(Raw(b"\x82\x01")),
    "a memory that is not there": with_field(Raw(b"h\x07")),
    "no end": smpl_pickle(FIELDS)[:-1],
    "an unknown opcode": b"\x80\x02\xff.",
    "a list": pickled([1]),
}

HOSTILE = LIVE | STILL


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.everyday
@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_pickles_are_refused_and_not_run(folder, case):
    path = folder / "model.pkl"
    path.write_bytes(HOSTILE[case])
    tracemalloc.start()
    try:
        with pytest.raises(FileFormatError, match=r"model\.pkl: ") as caught:
            load_pickled_arrays(path, tuple(FIELDS))
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert os.listdir(folder) == ["model.pkl"]
    assert len(str(caught.value)) < 1000
    # Fifty thousand empty lists are the most that operations can ask for.
    assert peak < 20e6 + 10 * len(HOSTILE[case])


def test_objects_in_fields_that_are_not_read_stay_records(folder):
    """They were never made, so that the rest of the model can be read."""
    notes = Call("chumpy.ch Ch", ("x",))
    (folder / "model.pkl").write_bytes(pickled(FIELDS | {"notes": notes}))
    assert list(load_pickled_arrays("model.pkl", ["f"])) == ["f"]


@pytest.mark.parametrize("case", LIVE)
def test_the_live_ones_do_run_in_pythons_own_reader(folder, case):
    with contextlib.suppress(AttributeError, TypeError, pickle.UnpicklingError):
        pickle.loads(LIVE[case], encoding="latin1")
    assert CANARY in os.listdir(folder)


def test_chumpy_in_chumpy_without_end(folder):
    """A Select whose array is itself, and a chain of Selects."""
    itself = b"\x80\x02}U\nv_templatecchumpy.reordering\nSelect\n)\x81q\x01}(U\x01ah\x01U\x04idxs"
    itself += pickled(np.arange(3))[2:-1] + b"ubs."
    chain = ch(np.arange(3.0))
    for _ in range(20):
        chain = select(chain, np.arange(3), None)
    for content in (itself, pickled({"v_template": chain})):
        (folder / "model.pkl").write_bytes(content)
        with pytest.raises(FileFormatError, match="holds more than 8 chumpy objects in another"):
            load_pickled_arrays("model.pkl", ["v_template"])


def test_arrays_share_nothing_that_can_be_written(folder):
    (folder / "model.pkl").write_bytes(pickled({"a": np.arange(3.0), "b": np.arange(2)}))
    found = load_pickled_arrays("model.pkl", ["a"], ["b", "c"])
    assert list(found) == ["a", "b"]
    assert not found["a"].flags.writeable


def test_scalars_sets_and_big_endian_numbers(folder):
    for protocol in range(6):
        content = {"a": np.float64(2.5), "b": np.arange(4, dtype=">i4"), "c": np.array(7)}
        content |= {"dirty": {"x", ("y", 1)}, "frozen": frozenset([1])}  # of Python 3
        (folder / "model.pkl").write_bytes(pickle.dumps(content, protocol=protocol))
        found = load_pickled_arrays("model.pkl", ["a", "b", "c"])
        assert found["a"] == 2.5
        assert found["b"].tolist() == [0, 1, 2, 3]
        assert found["c"] == 7


@pytest.mark.parametrize("numbers", [-(2**63) - 1, [2**64 - 1, -(2**63) - 1]])
def test_whole_numbers_that_no_array_holds(folder, numbers):
    (folder / "model.pkl").write_bytes(pickle.dumps({"a": numbers}))
    with pytest.raises(FileFormatError, match="field a: holds a whole number beyond 64 bits"):
        load_pickled_arrays("model.pkl", ["a"])


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
        (Tensor(ROWS, strides=(-72, 1)), "malformed tensor"),
        (Tensor(ROWS, shape=(2**30, 72), strides=(0, 1)), "more often than its size allows"),
    ],
)
def test_hostile_tensors(tmp_path, tensor, message):
    file = torch_file(tmp_path / "a.pt", {"poses": tensor})
    with pytest.raises(FileFormatError, match=message):
        load_torch_tree(file)
