"""Pickles of body models and recordings, and files of PyTorch, read as data.

A pickle is a program: it can name any function and have it called. Here, names are looked up in a
short list of what makes plain data; classes of chumpy, SciPy, joblib and PyTorch are replaced by
such that record their state, so that none of these packages is needed.
"""

from __future__ import annotations

import copyreg
import io
import math
import os
import pickle
import zipfile
import zlib
from collections import OrderedDict, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from scipy import sparse

from riemhuman.arrays import Values
from riemhuman.checks import checked
from riemhuman.checks.labels import texts_of
from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import check_fields
from riemhuman.io.files import check_file, file_path, format_errors, read_bytes

Unpickled: TypeAlias = Any  # type: ignore[explicit-any]  # readers check each value they use
"""What a pickle holds."""

# First bytes of the two kinds of compression by zlib.
_COMPRESSED = (b"\x78", b"\x1f\x8b")


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
        check_fields([str(name) for name in fields], required)
        arrays = {}
        for name in (*required, *optional):
            if name in fields:
                with format_errors(f"field {name}", "an array"):
                    arrays[name] = _array(fields[name])
        return arrays


def load_pickled_tree(file: Path) -> Unpickled:
    """Return the dictionaries, lists, arrays, numbers and texts of a pickle, as joblib writes too.

    Nothing in it runs. Keys of dictionaries become texts, and values without numbers are left out.
    """
    content = read_bytes(file)
    with format_errors(file, "a whole pickle"):
        if content.startswith(_COMPRESSED):
            content = zlib.decompress(content, wbits=32 + 15)  # zlib or gzip, as the header says
        return _plain(_unpickle(content))


def load_torch_tree(file: Path) -> Unpickled:
    """Return what `load_pickled_tree` does from a file of PyTorch: a pickle, beside its tensors."""
    check_file(file)
    with format_errors(file, "a file of PyTorch"):
        if not zipfile.is_zipfile(file):
            raise FileFormatError(
                "not in PyTorch's format since version 1.6; save it again with torch.save"
            )
        with zipfile.ZipFile(file) as archive:
            names = archive.namelist()
            # All names begin with a folder, which may have any name.
            (stored_tree,) = (name for name in names if name.endswith("/data.pkl"))
            folder = stored_tree.removesuffix("data.pkl")
            storages = {
                name.removeprefix(f"{folder}data/"): archive.read(name)
                for name in names
                if name.startswith(f"{folder}data/")
            }
            order = f"{folder}byteorder"
            is_big = order in names and archive.read(order).strip() == b"big"
            return _plain(_unpickle(archive.read(stored_tree), storages, is_big=is_big))


def _unpickle(
    content: bytes, storages: Mapping[str, bytes] | None = None, *, is_big: bool = False
) -> Unpickled:
    return _Unpickler(io.BytesIO(content), storages or {}, is_big=is_big).load()


class _Unpickler(pickle.Unpickler):
    """Makes plain data, and records of what is none."""

    def __init__(self, stream: io.BytesIO, storages: Mapping[str, bytes], *, is_big: bool) -> None:
        super().__init__(stream, encoding="latin1")
        self._stream, self._storages, self._is_big = stream, storages, is_big

    def find_class(self, module: str, name: str) -> object:
        # By names alone: modules differ between releases.
        if name == "NumpyArrayWrapper":
            return type(name, (_JoblibArray,), {"stream": self._stream})
        if name not in _ALLOWED:
            raise FileFormatError(
                f"asks for {module}.{name}, which is refused: body models may hold NumPy arrays, "
                "SciPy's csc matrices and chumpy.ch.Ch or chumpy.reordering.Select alone, and "
                "recordings arrays and tensors. Nothing in the file was run"
            )
        return _ALLOWED[name]

    def persistent_load(self, reference: Unpickled) -> Values:
        """Return the numbers of a storage of PyTorch."""
        _, dtype, key, *_ = reference
        is_brief = dtype == "bfloat16"  # the first half of a number in single precision
        kind = np.dtype("u2" if is_brief else dtype).newbyteorder(">" if self._is_big else "<")
        numbers: Values = np.frombuffer(self._storages[str(key)], kind)
        return (numbers.astype(np.uint32) << 16).view(np.float32) if is_brief else numbers


class _Record:
    """An object of a class that is not needed: its state alone."""

    state: Mapping[str, Unpickled]

    def array(self) -> Values | sparse.coo_array:
        raise NotImplementedError

    def __setstate__(self, state: Unpickled) -> None:
        self.state = state[0] if isinstance(state, tuple) else state


class _Chumpy(_Record):
    """An array of chumpy."""

    def array(self) -> Values:
        array: Values = np.asarray(_array(self.state["x"]))
        return array


class _ChumpySelect(_Record):
    """Chosen entries of an array of chumpy."""

    def array(self) -> Values:
        source, indices = (np.ravel(_array(self.state[name])) for name in ("a", "idxs"))
        shape = self.state.get("preferred_shape")
        array: Values = source[indices].reshape(-1 if shape is None else _array(shape))
        return array


class _CompressedColumns(_Record):
    """A sparse matrix of SciPy, of any release."""

    def array(self) -> sparse.coo_array:
        shape = self.state["_shape" if "_shape" in self.state else "shape"]
        parts = (self.state[name] for name in ("data", "indices", "indptr"))
        data, rows, starts = map(np.asarray, parts)
        # Where starts decrease, SciPy would write outside its memory.
        if starts[0] != 0 or (starts[1:] < starts[:-1]).any() or starts[-1] > len(rows):
            raise FileFormatError("holds a csc matrix whose indptr is malformed")
        columns = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
        values = data[: starts[-1]].astype(np.float64), (rows[: starts[-1]], columns)
        return sparse.coo_array(values, shape=tuple(shape))


class _JoblibArray(_Record):
    """An array of joblib, which writes its numbers after its description."""

    stream: io.BytesIO
    numbers: Values

    def __setstate__(self, state: Unpickled) -> None:
        dtype, shape = state["dtype"], state["shape"]
        if state.get("numpy_array_alignment_bytes") is not None:
            n_padding = self.stream.read(1)[0]
            self.stream.read(n_padding)
        data = self.stream.read(math.prod(shape) * dtype.itemsize)
        self.numbers = np.frombuffer(data, dtype).reshape(shape, order=state["order"])

    def array(self) -> Values:
        return self.numbers


def _tensor(
    numbers: Values, offset: int, shape: Sequence[int], strides: Sequence[int], *_: object
) -> Values:
    """Return the array of a tensor, whose entries may be those of a storage in any order."""
    last = offset + sum((n - 1) * step for n, step in zip(shape, strides, strict=True))
    if min((offset, *shape, *strides)) < 0 or (0 not in shape and last >= len(numbers)):
        raise FileFormatError("holds a tensor that is larger than its data")
    steps = [step * numbers.itemsize for step in strides]
    return np.lib.stride_tricks.as_strided(numbers[offset:], shape, steps, writeable=False)


# What pickles may name. The functions of NumPy that make arrays are private: arrays name them.
_ALLOWED: dict[str, object] = {
    "_reconstruct": np.empty(0).__reduce__()[0],
    "_frombuffer": np.empty(1).__reduce_ex__(5)[0],
    "scalar": np.float64().__reduce__()[0],
    "ndarray": np.ndarray,
    "dtype": np.dtype,
    "encode": lambda text, encoding: text.encode("latin1"),
    **{kind.__name__: kind for kind in (object, set, frozenset, list, dict, OrderedDict)},
    "defaultdict": defaultdict,
    "_reconstructor": copyreg._reconstructor,  # type: ignore[attr-defined]  # of Python 2
    "Ch": _Chumpy,
    "Select": _ChumpySelect,
    "csc_matrix": _CompressedColumns,
    "csc_array": _CompressedColumns,
    "_rebuild_tensor_v2": _tensor,
    "_rebuild_parameter": lambda tensor, *_: tensor,
    "Size": tuple,
    "device": lambda *_: None,
    "DoubleStorage": "f8",
    "FloatStorage": "f4",
    "HalfStorage": "f2",
    "BFloat16Storage": "bfloat16",
    "LongStorage": "i8",
    "IntStorage": "i4",
    "ShortStorage": "i2",
    "CharStorage": "i1",
    "ByteStorage": "u1",
    "BoolStorage": "?",
}


def _array(value: Unpickled) -> Values | sparse.coo_array:
    """Return numbers or texts of any kind as an array."""
    array = value.array() if isinstance(value, _Record) else np.asarray(value)
    if array.dtype.kind not in "biufSU":
        raise FileFormatError(
            f"must hold numbers or texts; found {type(value).__name__} of type {array.dtype}"
        )
    return array


def _plain(value: Unpickled) -> Unpickled:
    """Return the plain value of what a pickle holds, or None where it has none."""
    if isinstance(value, dict):
        pairs = ((str(key), _plain(item)) for key, item in value.items())
        return {key: item for key, item in pairs if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray) and value.dtype.hasobject:
        return _plain(value.tolist())
    if isinstance(value, (np.ndarray, np.generic, _JoblibArray)):
        return _array(value)
    return value if isinstance(value, (str, int, float)) else None
