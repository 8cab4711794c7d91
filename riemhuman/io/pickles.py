"""Pickles of body models, read as data.

A pickle is a program: it can name any function and have it called. Here, the unpickler looks names
up in a short list and gets a class for each whose objects record their arguments and their state,
and do nothing. Arrays are then made from the recorded bytes, after a comparison of their sizes.
The unpickler written in Python is used, since the one in C allocates memory for positions of its
memory that a file merely names.
"""

from __future__ import annotations

import io
import math
import os
import pickle
import re
import warnings
from collections.abc import Callable, Sequence
from typing import Any, Self

import numpy as np
from scipy import sparse

from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import check_characters, check_fields
from riemhuman.io.files import file_path, format_errors, read_bytes

# A body model takes some hundreds of operations.
_MOST_OPERATIONS = 50_000
# Bytes of the returned arrays for each byte of the file: selected entries get wider.
_LARGEST_FACTOR = 16
_DEEPEST_CHUMPY = 8
_MOST_AXES = 8
# Real numbers and text; not objects ("O") or structures ("V").
_DTYPES = re.compile(r"f[248]|[iu][1248]|b1|[SU][1-9]\d{0,3}")
# Every entry of an array of text takes as much memory as the longest.
_LONGEST_TEXT = 200


def load_pickled_arrays(
    path: str | os.PathLike[str], required: Sequence[str], optional: Sequence[str] = ()
) -> dict[str, Any]:
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
    file, required = file_path(path), list(required)
    content = read_bytes(file)
    with format_errors(file, "a whole pickle"):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of escapes in texts of Python 2
            fields = _Unpickler(io.BytesIO(content), encoding="latin1").load()
        if not isinstance(fields, dict):
            raise FileFormatError(f"holds {type(fields).__name__} in place of a dictionary")
        check_fields([_describe(name) for name in fields], required)
        limit = _LARGEST_FACTOR * len(content)
        arrays = {}
        for name in (*required, *optional):
            if name not in fields:
                continue
            with format_errors(f"field {name}", "an array"):
                arrays[name] = _value(fields[name])
            limit -= arrays[name].nbytes if isinstance(arrays[name], np.ndarray) else 0
            if limit < 0:
                raise FileFormatError("uses its data more often than its size allows")
        return arrays


class _Record:
    """An object of a pickle: the arguments that it was made with and its state."""

    kind = ""
    arguments: Sequence[Any] = ()
    state: Any = None

    def __init__(self, *arguments: Any) -> None:
        self.arguments = arguments

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Reconstructor(_Record):
    """What Python 2 calls to make an object of a class."""

    def __new__(cls, kind: Callable[[], Self], base: Any, state: Any) -> Self:
        return kind()


# The kinds of objects that a file may name, with the modules of old and new releases.
_KINDS = {
    **{f"numpy.{core}.multiarray _reconstruct": "array" for core in ("core", "_core")},
    **{f"numpy.{core}.multiarray scalar": "scalar" for core in ("core", "_core")},
    **{f"numpy.{core}.numeric _frombuffer": "buffer" for core in ("core", "_core")},
    "numpy ndarray": "ndarray",
    "numpy dtype": "dtype",
    "_codecs encode": "bytes",
    "chumpy.ch Ch": "Ch",
    "chumpy.reordering Select": "Select",
    **{f"{module} object": "object" for module in ("builtins", "__builtin__")},
    **{f"{module} set": "set" for module in ("builtins", "__builtin__")},
    **{f"{module} frozenset": "set" for module in ("builtins", "__builtin__")},
    **{
        f"scipy.sparse.{module} csc_{end}": "csc"
        for module in ("csc", "_csc")
        for end in ("matrix", "array")
    },
}
_CLASSES = {name: type(name, (_Record,), {"kind": kind}) for name, kind in _KINDS.items()}
_CLASSES |= {f"{module} _reconstructor": _Reconstructor for module in ("copyreg", "copy_reg")}


class _Operations(dict[int, Callable[[Any], None]]):
    """The operations of an unpickler, which may look up a limited number of them."""

    n_left = _MOST_OPERATIONS

    def __getitem__(self, code: int) -> Callable[[Any], None]:
        self.n_left -= 1
        if self.n_left < 0:
            raise FileFormatError(
                f"is a pickle of more than {_MOST_OPERATIONS} operations, which is refused"
            )
        return super().__getitem__(code)


class _Unpickler(pickle._Unpickler):
    """Makes records and plain data, with lists in place of tuples and sets.

    Hashing nested tuples, such as keys of dictionaries, takes ages; lists cannot be keys.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.dispatch = _Operations(_DISPATCH)  # type: ignore[misc]

    def find_class(self, module: str, name: str) -> type[_Record]:
        if f"{module} {name}" not in _CLASSES:
            raise FileFormatError(
                f"asks for {_describe(f'{module}.{name}')}, which is refused: body models may "
                "hold NumPy arrays, SciPy's csc matrices and chumpy.ch.Ch or "
                "chumpy.reordering.Select alone. Nothing in the file was run"
            )
        return _CLASSES[f"{module} {name}"]


def _list_of_last(count: int) -> Callable[[Any], None]:
    def load(unpickler: Any) -> None:
        unpickler.stack[-count:] = [unpickler.stack[-count:]]

    return load


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
_DISPATCH |= {code[0]: _DISPATCH[other[0]] for code, other in _ALIASES.items()}
_DISPATCH |= {code[0]: _list_of_last(count) for code, count in _TUPLES.items()}


def _kind(value: Any) -> str:
    return value.kind if isinstance(value, _Record) else ""


def _value(value: Any, depth: int = 0) -> Any:
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


def _array(record: _Record) -> np.ndarray:
    """Return an array of the recorded bytes, which cannot be written to."""
    order: Any = "C"
    if record.kind == "array":
        _, shape, dtype, is_fortran, data = record.state
        order = "F" if is_fortran else "C"
    elif record.kind == "buffer":
        data, dtype, shape, order = record.arguments
    else:
        (dtype, data), shape = record.arguments, []
    if not _is_shape(shape):
        raise FileFormatError(f"holds an array of shape {_describe(shape)}")
    kind_of_entries, content = _dtype(dtype), _bytes(data)
    needed = math.prod(shape) * kind_of_entries.itemsize
    if needed != len(content):
        raise FileFormatError(
            f"holds an array of shape {tuple(shape)} and type {kind_of_entries}, which takes "
            f"{needed} bytes, with {len(content)} bytes of data"
        )
    array = np.ndarray(shape, kind_of_entries, content, order="F" if order == "F" else "C")
    check_characters(array)
    array.flags.writeable = False
    return array


def _dtype(record: Any) -> np.dtype[Any]:
    code = record.arguments[0] if _kind(record) == "dtype" else record
    if _kind(record) != "dtype" or not isinstance(code, str) or not _DTYPES.fullmatch(code):
        raise FileFormatError(
            f"holds an array of type {_describe(code)}; arrays must hold numbers or text"
        )
    byte_order: Any = record.state[1] if record.state else "="
    if byte_order not in ("<", ">", "|", "="):
        raise FileFormatError("holds a malformed NumPy data type")
    return np.dtype(code).newbyteorder(byte_order)


def _bytes(data: Any) -> bytes | bytearray:
    """Return data as bytes, also where Python 2 wrote them as text."""
    if _kind(data) == "bytes":
        data, encoding = data.arguments
        if encoding not in ("latin1", "latin-1"):
            raise FileFormatError(f"encodes text as {_describe(encoding)}, which is refused")
    if not isinstance(data, (str, bytes, bytearray)):
        raise FileFormatError(f"holds an array whose data are {_describe(data)}")
    return data.encode("latin-1") if isinstance(data, str) else data


def _chumpy(state: dict[str, Any], kind: str, depth: int) -> np.ndarray:
    """Return the value of a chumpy object, which may be a selection from another."""
    if depth == _DEEPEST_CHUMPY:
        raise FileFormatError(f"holds more than {_DEEPEST_CHUMPY} chumpy objects in another")
    needed = ("x",) if kind == "Ch" else ("a", "idxs")
    if any(name not in state for name in needed):
        raise FileFormatError(f"holds a chumpy {kind} without {' and '.join(needed)}")
    if kind == "Ch":
        return np.asarray(_value(state["x"], depth + 1))
    source, indices = (np.ravel(_value(state[name], depth + 1)) for name in needed)
    if source.dtype.kind not in "fiub":  # a long text may be selected any number of times
        raise FileFormatError("holds a chumpy Select from an array that holds no numbers")
    if indices.dtype.kind not in "iu" or (
        indices.size and not 0 <= indices.min() <= indices.max() < len(source)
    ):
        raise FileFormatError("holds a chumpy Select with indices outside its array")
    shape = state.get("preferred_shape")
    if shape is None:
        return source[indices]
    shape = np.ravel(_value(shape, depth + 1)).tolist()
    if not _is_shape(shape) or math.prod(shape) != len(indices):
        raise FileFormatError(
            f"holds a chumpy Select of {len(indices)} numbers whose preferred_shape is "
            f"{_describe(shape)}"
        )
    return source[indices].reshape(shape)


def _sparse(state: dict[str, Any]) -> sparse.coo_array:
    """Return a matrix of compressed columns, after a check of its indices."""
    shape: Any = state.get("_shape", state.get("shape"))
    if not _is_shape(shape) or len(shape) != 2:
        raise FileFormatError(f"holds a sparse matrix of shape {_describe(shape)}")
    parts = []
    for name, kinds in (("data", "fiub"), ("indices", "iu"), ("indptr", "iu")):
        part: Any = state.get(name)
        found = _array(part) if _kind(part) in ("array", "buffer") else np.empty(())
        if found.ndim != 1 or found.dtype.kind not in kinds:
            raise FileFormatError(f"holds a csc matrix whose {name} is missing or malformed")
        parts.append(found.astype(np.int64 if kinds == "iu" else np.float64))
    data, rows, starts = parts
    # SciPy's own check writes outside its memory; differences may wrap around.
    if len(starts) != shape[1] + 1 or starts[0] != 0 or (starts[1:] < starts[:-1]).any():
        raise FileFormatError("holds a csc matrix whose indptr is malformed")
    if starts[-1] > min(len(rows), len(data)):
        raise FileFormatError("holds a csc matrix with unequal parts")
    rows, data = rows[: starts[-1]], data[: starts[-1]]
    if rows.size and not 0 <= rows.min() <= rows.max() < shape[0]:
        raise FileFormatError("holds a csc matrix with entries outside it")
    columns = np.repeat(np.arange(shape[1]), np.diff(starts))
    return sparse.coo_array((data, (rows, columns)), shape=tuple(shape))


def _attributes(record: _Record) -> dict[str, Any]:
    state = record.state
    if isinstance(state, list) and len(state) == 2 and state[1] is None:
        state = state[0]
    if not isinstance(state, dict):
        raise FileFormatError(f"holds a malformed {record.kind}")
    return state


def _is_shape(shape: Any) -> bool:
    return (
        isinstance(shape, list)
        and len(shape) <= _MOST_AXES
        and all(isinstance(n, int) and 0 <= n < 2**62 for n in shape)
    )


def _describe(value: Any) -> str:
    """Return a text or a shape of the file, or the type of another value, for a message."""
    if _is_shape(value):
        return repr(tuple(value))
    if not isinstance(value, str):
        return type(value).__name__
    text = value if value.isprintable() else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."
