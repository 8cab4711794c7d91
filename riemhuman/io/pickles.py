"""Pickles of body models and recordings, and files of PyTorch, read as data.

A pickle is a program: it can name any function and have it called. Here, the unpickler looks names
up in a short list and gets a class for each whose objects record their arguments and their state,
and do nothing. Arrays are then made from the recorded bytes, after a comparison of their sizes.
The unpickler written in Python is used, since the one in C allocates memory for positions of its
memory that a file merely names. Some operations are replaced, too: nested tuples take ages to hash
as keys, and joblib writes the numbers of arrays between operations.
"""

from __future__ import annotations

import io
import math
import os
import pickle
import re
import warnings
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse

from riemhuman.arrays import DType, Values
from riemhuman.checks import checked
from riemhuman.checks.labels import texts_of
from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import check_characters, check_fields, memory_limit
from riemhuman.io.files import check_file, file_path, format_errors, read_bytes

# Dictionaries and lists within each other, and how many values they may hold in all.
_DEEPEST_TREE, _MOST_VALUES = 8, 1_000_000
# First bytes of the two kinds of compression by zlib.
_COMPRESSED = (b"\x78", b"\x1f\x8b")
_DEEPEST_CHUMPY = 8
# Real numbers and text; not objects ("O") or structures ("V").
_DTYPES = re.compile(r"f[248]|[iu][1248]|b1|[SU][1-9]\d{0,3}")
# Every entry of an array of text takes as much memory as the longest.
_LONGEST_TEXT = 200
_BYTES_OF_NUMBER = 8


@checked(required=texts_of, optional=texts_of)
def load_pickled_arrays(
    path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, Values | sparse.coo_array]:
    """Read the named arrays of a pickled dictionary, of chumpy too, without running anything.

    Parameters
    ----------
    path : path_like
        The file, written by Python 2 or 3 with any protocol.
    required : sequence of str
        Fields that the file must contain.
    optional : sequence of str
        Fields to read if the file contains them. Others are ignored.

    Examples
    --------
    >>> import pickle
    >>> with open("model.pkl", "wb") as file:
    ...     pickle.dump({"weights": [0.5, 0.5], "unit": "m"}, file)
    >>> rh.io.load_pickled_arrays("model.pkl", ["weights"])["weights"]
    array([0.5, 0.5])
    """
    file = file_path(path)
    content = read_bytes(file)
    with format_errors(file, "a whole pickle"):
        fields = _unpickle(content)
        if not isinstance(fields, dict):
            raise FileFormatError(f"holds {type(fields).__name__} in place of a dictionary")
        check_fields([_describe(name) for name in fields], required)
        arrays = {}
        for name in (*required, *optional):
            if name not in fields:
                continue
            with format_errors(f"field {name}", "an array"):
                arrays[name] = _value(fields[name])
        return arrays


def load_pickled_tree(file: Path) -> Unpickled:
    """Return the dictionaries, lists, arrays, numbers and texts of a pickle, as joblib writes too.

    Nothing in it runs. Keys of dictionaries become texts, and values without numbers are left out.
    """
    content = read_bytes(file)
    with format_errors(file, "a whole pickle"):
        if content.startswith(_COMPRESSED):
            content = _decompress(content, memory_limit(len(content)))
        return _Tree(len(content)).value(_unpickle(content))


def load_torch_tree(file: Path) -> Unpickled:
    """Return what `load_pickled_tree` does from a file of PyTorch: a pickle, beside its tensors."""
    size = check_file(file)
    with format_errors(file, "a file of PyTorch"):
        if not zipfile.is_zipfile(file):
            raise FileFormatError(
                "not in PyTorch's format since version 1.6; save it again with torch.save"
            )
        with zipfile.ZipFile(file) as archive:
            members = {member.filename: member for member in archive.infolist()}
            if sum(member.file_size for member in members.values()) > memory_limit(size):
                raise FileFormatError("would take far more memory than a file of this size should")
            # All names begin with a folder, which may have any name.
            (stored_tree,) = (name for name in members if name.endswith("/data.pkl"))
            folder = stored_tree.removesuffix("data.pkl")
            storages = {
                name.removeprefix(f"{folder}data/"): archive.read(member)
                for name, member in members.items()
                if name.startswith(f"{folder}data/")
            }
            order = f"{folder}byteorder"
            is_little = order not in members or archive.read(order).strip() == b"little"
            stored = _unpickle(archive.read(stored_tree), _storage_maker(storages, is_little))
        return _Tree(size).value(stored)


def _storage_maker(storages: Mapping[str, bytes], is_little: bool) -> Callable[[object], _Record]:
    """Return what makes records of the storages that a pickle of PyTorch refers to."""

    def storage(reference: Unpickled) -> _Record:
        _, stored_type, key, *_ = reference
        kind = stored_type.__name__
        record: _Record = _MAKERS["_storage"]()
        dtype = np.dtype(_STORAGES[kind]).newbyteorder("<" if is_little else ">")
        record.state = np.frombuffer(storages[str(key)], dtype)
        if kind == "BFloat16Storage":  # the first half of a number in single precision
            record.state = (record.state.astype(np.uint32) << 16).view(np.float32)
        return record

    return storage


def _decompress(content: bytes, limit: int) -> bytes:
    """Return the content of a compressed file, which may take at most `limit` bytes."""
    reader = zlib.decompressobj(wbits=32 + 15)  # zlib or gzip, whichever the header says
    plain = reader.decompress(content, limit)
    if reader.unconsumed_tail:
        raise FileFormatError("would take far more memory than a file of this size should")
    return plain


def _no_storage(reference: object) -> _Record:
    raise FileFormatError("needs data that the file does not hold")


def _unpickle(content: bytes, storage: Callable[[object], _Record] = _no_storage) -> Unpickled:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of escapes in texts of Python 2
        return _Unpickler(io.BytesIO(content), storage).load()


Unpickled: TypeAlias = Any  # type: ignore[explicit-any]  # readers check each value they use
"""What a pickle holds: plain data and records."""

Maker: TypeAlias = Callable[..., Unpickled]  # type: ignore[explicit-any]  # of any arguments


class _Record:
    """An object of a pickle: the arguments that it was made with and its state."""

    kind = ""
    arguments: Sequence[Unpickled] = ()
    state: Unpickled = None

    def __init__(self, *arguments: Unpickled) -> None:
        self.arguments = arguments

    def __setstate__(self, state: Unpickled) -> None:
        self.state = state


# The kinds of objects that a file may name, by their names alone: modules differ between releases.
_KINDS = {
    "_reconstruct": "array",
    "scalar": "scalar",
    "_frombuffer": "buffer",
    "encode": "bytes",
    "csc_matrix": "csc",
    "csc_array": "csc",
    **{name: name for name in ("ndarray", "dtype", "Ch", "Select", "object", "set", "frozenset")},
    "NumpyArrayWrapper": "joblib",
    "_rebuild_tensor_v2": "tensor",
    "_storage": "storage",
    **{name: name for name in ("list", "dict", "Size", "device")},
}
# Types of the numbers in the storages of PyTorch.
_STORAGES = {
    "DoubleStorage": "f8",
    "FloatStorage": "f4",
    "HalfStorage": "f2",
    "BFloat16Storage": "u2",
    "LongStorage": "i8",
    "IntStorage": "i4",
    "ShortStorage": "i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "b1",
}
_KINDS |= {name: name for name in _STORAGES}
# Pickles call classes: here a class of its own for each kind, that does nothing.
_MAKERS: dict[str, Maker] = {
    name: type(name, (_Record,), {"kind": kind}) for name, kind in _KINDS.items()
}
_MAKERS["_reconstructor"] = lambda kind, base, state: kind()  # as Python 2 made objects
_MAKERS["OrderedDict"] = lambda items=(): dict(items)
_MAKERS["defaultdict"] = lambda *default: {}  # its items follow
_MAKERS["_rebuild_parameter"] = lambda tensor, *arguments: tensor


class _Unpickler(pickle._Unpickler):
    """Makes records and plain data, with lists in place of tuples and sets.

    Hashing nested tuples, such as keys of dictionaries, takes ages; lists cannot be keys.
    """

    def __init__(self, content: io.BytesIO, storage: Callable[[object], _Record]) -> None:
        super().__init__(content, encoding="latin1")
        self.dispatch = _DISPATCH  # type: ignore[misc]  # of this class alone
        self.content, self._storage = content, storage

    def persistent_load(self, identifier: object) -> _Record:
        return self._storage(identifier)

    def find_class(self, module: str, name: str) -> Maker:
        if name not in _MAKERS:
            raise FileFormatError(
                f"asks for {_describe(f'{module}.{name}')}, which is refused: body models may "
                "hold NumPy arrays, SciPy's csc matrices and chumpy.ch.Ch or "
                "chumpy.reordering.Select alone, and recordings arrays and tensors. Nothing in "
                "the file was run"
            )
        return _MAKERS[name]


def _list_of_last(count: int) -> Callable[[Unpickled], None]:
    """Return the operation that makes a list of the last values of the stack."""

    def load(unpickler: Unpickled) -> None:
        unpickler.stack[-count:] = [unpickler.stack[-count:]]

    return load


def _build(unpickler: Unpickled) -> None:
    """Give an object its state; the numbers of an array of joblib follow it in the file."""
    _PYTHON_BUILD(unpickler)
    record = unpickler.stack[-1]
    if _kind(record) != "joblib":
        return
    state = _attributes(record)
    dtype = _dtype(state["dtype"])
    if state.get("numpy_array_alignment_bytes") is not None:
        n_padding = unpickler.content.read(1)[0]
        unpickler.content.read(n_padding)
    size = math.prod(map(int, state["shape"])) * dtype.itemsize
    data = unpickler.content.read(max(size, 0))
    record.arguments = (data, state["dtype"], state["shape"], state["order"])
    record.kind = "buffer"


# Operations that do what another one does; that for bytearrays allocates before it reads.
_ALIASES = {
    pickle.EMPTY_TUPLE: pickle.EMPTY_LIST,
    pickle.TUPLE: pickle.LIST,
    pickle.EMPTY_SET: pickle.EMPTY_LIST,
    pickle.ADDITEMS: pickle.APPENDS,
    pickle.FROZENSET: pickle.LIST,
    pickle.BYTEARRAY8: pickle.BINBYTES8,
}
_TUPLES = {pickle.TUPLE1: 1, pickle.TUPLE2: 2, pickle.TUPLE3: 3}
_DISPATCH = dict(pickle._Unpickler.dispatch)
_PYTHON_BUILD = _DISPATCH[pickle.BUILD[0]]
_DISPATCH[pickle.BUILD[0]] = _build
_DISPATCH |= {code[0]: _DISPATCH[alias[0]] for code, alias in _ALIASES.items()}
_DISPATCH |= {code[0]: _list_of_last(count) for code, count in _TUPLES.items()}


def _kind(value: object) -> str:
    return value.kind if isinstance(value, _Record) else ""


def _value(value: Unpickled, depth: int = 0) -> Values | sparse.coo_array:
    """Return an array, a sparse matrix, a chumpy object, a number, a text or a list as an array."""
    kind = _kind(value)
    if kind in ("array", "buffer", "scalar"):
        return _array(value)
    if kind == "csc" and depth == 0:
        return _sparse(_attributes(value))
    if kind in ("Ch", "Select"):
        return _chumpy(_attributes(value), kind, depth)
    is_list = isinstance(value, list)
    items = []
    for item in value if is_list else [value]:
        entry = _array(item)[()] if _kind(item) == "scalar" else item
        # A long text may be repeated any number of times.
        is_long = isinstance(entry, (str, bytes)) and len(entry) > _LONGEST_TEXT
        if is_long or not isinstance(entry, (str, bytes, int, float, np.generic)):
            raise FileFormatError(f"holds {_describe(value)} in place of an array")
        items.append(entry)
    array = np.asarray(items if is_list else items[0])
    if array.dtype.kind == "O":
        raise FileFormatError("holds a whole number beyond 64 bits")
    return array


class _Tree:
    """Makes plain values of records, of which lists and dictionaries may hold any one often."""

    def __init__(self, size: int) -> None:
        self._n_bytes, self._n_values = memory_limit(size), _MOST_VALUES

    def value(self, stored: Unpickled, depth: int = 0) -> Unpickled:
        """Return the plain value of a record, or None where it has none."""
        self._n_values -= 1
        if depth > _DEEPEST_TREE or self._n_values < 0:
            raise FileFormatError("holds dictionaries and lists that nest too deep or too often")
        kind = _kind(stored)
        if kind in ("array", "buffer", "scalar", "tensor"):
            array = _tensor(stored, self._n_bytes) if kind == "tensor" else _array(stored)
            self._n_bytes -= array.size * _BYTES_OF_NUMBER
            if self._n_bytes < 0:
                raise FileFormatError("uses its data more often than its size allows")
            return array
        if isinstance(stored, dict):
            pairs = ((str(key), self.value(item, depth + 1)) for key, item in stored.items())
            return {key: item for key, item in pairs if item is not None}
        if isinstance(stored, list):
            return [self.value(item, depth + 1) for item in stored]
        return stored if isinstance(stored, (str, int, float)) else None


def _tensor(record: _Record, most_bytes: int) -> Values:
    """Return the array of a tensor, whose entries may be those of a storage in any order."""
    storage, offset, shape, strides = record.arguments[:4]
    if _kind(storage) != "storage":
        raise FileFormatError("holds a malformed tensor")
    numbers = storage.state
    shape, strides = [int(n) for n in shape], [int(n) for n in strides]
    if min((offset, *shape, *strides)) < 0:
        raise FileFormatError("holds a malformed tensor")
    last = offset + sum((n - 1) * step for n, step in zip(shape, strides, strict=True))
    # An expanded tensor repeats its entries.
    if math.prod(shape) and last >= len(numbers):
        raise FileFormatError("holds a tensor that is larger than its data")
    if math.prod(shape) * _BYTES_OF_NUMBER > most_bytes:
        raise FileFormatError("uses its data more often than its size allows")
    if not math.prod(shape):
        return np.zeros(shape, numbers.dtype)
    steps = [step * numbers.itemsize for step in strides]
    return np.lib.stride_tricks.as_strided(numbers[offset:], shape, steps, writeable=False)


def _array(record: _Record) -> Values:
    """Return an array of the recorded bytes, which cannot be written to."""
    order: Unpickled = "C"
    if record.kind == "array":
        _, shape, dtype, is_fortran, data = record.state
        order = "F" if is_fortran else "C"
    elif record.kind == "buffer":
        data, dtype, shape, order = record.arguments
    else:
        (dtype, data), shape = record.arguments, []
    if _kind(data) == "bytes":
        data = data.arguments[0]
    if isinstance(data, str):  # of Python 2
        data = data.encode("latin-1")
    array = np.frombuffer(data, _dtype(dtype)).reshape(shape, order=order)
    check_characters(array)
    array.flags.writeable = False
    return array


def _dtype(record: Unpickled) -> DType:
    code = record.arguments[0] if _kind(record) == "dtype" else record
    if not isinstance(code, str) or not _DTYPES.fullmatch(code):
        raise FileFormatError(
            f"holds an array of type {_describe(code)}; arrays must hold numbers or text"
        )
    return np.dtype(code).newbyteorder(record.state[1] if record.state else "=")


def _chumpy(state: dict[str, Unpickled], kind: str, depth: int) -> Values:
    """Return the value of a chumpy object, which may be a selection from another."""
    if depth == _DEEPEST_CHUMPY:
        raise FileFormatError(f"holds more than {_DEEPEST_CHUMPY} chumpy objects in another")
    if kind == "Ch":
        return np.asarray(_value(state["x"], depth + 1))
    source, indices = (np.ravel(_value(state[name], depth + 1)) for name in ("a", "idxs"))
    if source.dtype.kind not in "fiub":  # a long text may be selected any number of times
        raise FileFormatError("holds a chumpy Select from an array that holds no numbers")
    shape = state.get("preferred_shape")
    selected = source[indices]
    shaped: Values = selected if shape is None else selected.reshape(_value(shape, depth + 1))
    return shaped


def _sparse(state: dict[str, Unpickled]) -> sparse.coo_array:
    """Return a matrix of compressed columns; the constructor checks its indices."""
    shape = state["_shape"] if "_shape" in state else state["shape"]
    data, rows, starts = (_array(state[name]) for name in ("data", "indices", "indptr"))
    starts = starts.astype(np.int64)
    # NumPy and SciPy would write outside their memory. Differences might wrap around.
    if starts[0] != 0 or (starts[1:] < starts[:-1]).any() or starts[-1] > len(rows):
        raise FileFormatError("holds a csc matrix whose indptr is malformed")
    columns = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    values = data[: starts[-1]].astype(np.float64), (rows[: starts[-1]].astype(np.int64), columns)
    return sparse.coo_array(values, shape=tuple(shape))


def _attributes(record: _Record) -> dict[str, Values | sparse.coo_array]:
    state = record.state
    if isinstance(state, list) and len(state) == 2 and state[1] is None:
        state = state[0]
    return dict(state)


def _describe(value: object) -> str:
    """Return a text of the file, or the type of another value, for a message."""
    if not isinstance(value, str):
        return type(value).__name__
    text = value if value.isprintable() else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
