"""The objects that a pickled body model may hold: arrays, sparse matrices and chumpy objects.

Each kind of object is represented by a class of this file, filled from the state in the pickle. The
unpickling code of NumPy, SciPy and chumpy is never called, and no array is made before its size has
been compared with its data.
"""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from scipy import sparse

from riemhuman.errors import FileFormatError
from riemhuman.io.arrays import check_text

# Real numbers and text; not objects ("O") or structures ("V").
_DTYPES = re.compile(r"f[248]|[iu][1248]|b1|[SU][1-9]\d{0,3}")
# Versions of the state of a data type that NumPy has written.
_DTYPE_VERSIONS = (0, 1, 2, 3, 4)
_MOST_AXES = 8
_DEEPEST_CHUMPY = 8
# Every entry of an array of text takes as much memory as the longest.
_LONGEST_TEXT = 200


class Budget:
    """The number of bytes that may still be copied out of a pickle.

    Parameters
    ----------
    n_bytes : int
        Number of bytes.
    """

    def __init__(self, n_bytes: int) -> None:
        self._left = n_bytes

    def take(self, n_bytes: int) -> None:
        """Count bytes that are about to be copied.

        Parameters
        ----------
        n_bytes : int
            Number of bytes.

        Raises
        ------
        FileFormatError
            If fewer are left.
        """
        self._left -= n_bytes
        if self._left < 0:
            raise FileFormatError("uses its data more often than its size allows")


class Record(ABC):
    """An object in a pickle that has a state."""

    @abstractmethod
    def build(self, state: Any, budget: Budget) -> None:
        """Set the state.

        Parameters
        ----------
        state : object
            State, as it is in the pickle.
        budget : Budget
            Bytes that may still be copied.

        Raises
        ------
        FileFormatError
            If such an object has no such state.
        """


class DtypeRecord(Record):
    """A NumPy data type.

    Parameters
    ----------
    code : str
        Kind and size, such as "f8".
    """

    def __init__(self, code: Any) -> None:
        if not isinstance(code, str) or not _DTYPES.fullmatch(code):
            raise FileFormatError(
                f"holds an array of type {shortened(code)}; arrays must hold numbers or text"
            )
        self.dtype = np.dtype(code)

    def build(self, state: Any, budget: Budget) -> None:
        known = isinstance(state, tuple) and len(state) >= 5 and state[0] in _DTYPE_VERSIONS
        if not known or state[1] not in ("<", ">", "|", "="):
            raise FileFormatError("holds a malformed NumPy data type")
        if any(part is not None for part in state[2:5]):
            raise FileFormatError("holds a structured array; arrays must hold numbers or text")
        self.dtype = self.dtype.newbyteorder(state[1])


class ArrayRecord(Record):
    """A NumPy array.

    Parameters
    ----------
    array : array, optional
        The array, if it has no state to come.
    """

    def __init__(self, array: np.ndarray | None = None) -> None:
        self.array = array

    def build(self, state: Any, budget: Budget) -> None:
        if not isinstance(state, tuple) or len(state) != 5:
            raise FileFormatError("holds a malformed NumPy array")
        _, shape, dtype, in_columns, data = state
        self.array = array_of(data, dtype, shape, "F" if in_columns is True else "C", budget)


class SparseRecord(Record):
    """A SciPy sparse matrix.

    Parameters
    ----------
    layout : str
        "csc", "csr" or "coo".
    """

    def __init__(self, layout: str) -> None:
        self._layout = layout
        self._state: dict[str, Any] = {}

    def build(self, state: Any, budget: Budget) -> None:
        self._state = _attributes(state, f"{self._layout} matrix")

    def matrix(self) -> sparse.coo_array:
        """Return the matrix, after a check of its indices.

        Raises
        ------
        FileFormatError
            If its parts do not form a matrix.
        """
        shape = self._state.get("_shape", self._state.get("shape"))
        if not isinstance(shape, tuple) or len(shape) != 2 or not all(map(_is_length, shape)):
            raise FileFormatError(f"holds a sparse matrix of shape {shortened(shape)}")
        data = self._part("data")
        if data.dtype.kind not in "fiub":
            raise FileFormatError(f"holds a {self._layout} matrix whose data are not numbers")
        if self._layout == "coo":
            coords = self._state.get("coords") or (self._state.get("row"), self._state.get("col"))
            if not isinstance(coords, tuple) or len(coords) != 2:
                raise FileFormatError("holds a malformed coo matrix")
            row, column = (_indices(each) for each in coords)
        else:
            starts, minor = (_indices(self._state.get(name)) for name in ("indptr", "indices"))
            n_major = shape[1] if self._layout == "csc" else shape[0]
            if len(starts) != n_major + 1 or starts[0] != 0 or (starts[1:] < starts[:-1]).any():
                raise FileFormatError(f"holds a {self._layout} matrix whose indptr is malformed")
            if starts[-1] > len(minor):
                raise FileFormatError(f"holds a {self._layout} matrix with too few indices")
            minor, data = minor[: starts[-1]], data[: starts[-1]]
            major = np.repeat(np.arange(n_major), np.diff(starts))
            row, column = (minor, major) if self._layout == "csc" else (major, minor)
        if data.shape != row.shape or row.shape != column.shape:
            raise FileFormatError(f"holds a {self._layout} matrix with unequal parts")
        for index, length in ((row, shape[0]), (column, shape[1])):
            if index.size and not 0 <= index.min() <= index.max() < length:
                raise FileFormatError(f"holds a {self._layout} matrix with entries outside it")
        return sparse.coo_array((data.astype(np.float64), (row, column)), shape=shape)

    def _part(self, name: str) -> np.ndarray:
        part = self._state.get(name)
        if not isinstance(part, ArrayRecord) or part.array is None or part.array.ndim != 1:
            raise FileFormatError(f"holds a {self._layout} matrix without {name}")
        return part.array


class ChumpyRecord(Record):
    """A chumpy object, of which only the state is kept.

    Parameters
    ----------
    name : str
        "Ch" or "Select".
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._state: dict[str, Any] = {}

    def build(self, state: Any, budget: Budget) -> None:
        self._state = _attributes(state, f"chumpy {self._name}")

    def value(self, depth: int, budget: Budget) -> np.ndarray:
        """Return the value of the object.

        Parameters
        ----------
        depth : int
            Number of chumpy objects that contain this one.
        budget : Budget
            Bytes that may still be copied.

        Raises
        ------
        FileFormatError
            If the state does not determine a value.
        """
        if depth == _DEEPEST_CHUMPY:
            raise FileFormatError(f"holds more than {_DEEPEST_CHUMPY} chumpy objects in another")
        needed = ("x",) if self._name == "Ch" else ("a", "idxs")
        missing = [name for name in needed if name not in self._state]
        if missing:
            raise FileFormatError(f"holds a chumpy {self._name} without {' and '.join(missing)}")
        if self._name == "Ch":
            return _dense(self._state["x"], depth + 1, budget)
        chosen_from = _dense(self._state["a"], depth + 1, budget).ravel()
        indices = _dense(self._state["idxs"], depth + 1, budget).ravel()
        # An entry may be selected any number of times, and selections may be nested.
        budget.take(len(indices) * max(chosen_from.itemsize, indices.itemsize))
        if indices.dtype.kind not in "iu" or (
            indices.size and not 0 <= indices.min() <= indices.max() < len(chosen_from)
        ):
            raise FileFormatError("holds a chumpy Select with indices outside its array")
        shape = self._state.get("preferred_shape")
        if shape is None:
            return chosen_from[indices]
        if isinstance(shape, (ArrayRecord, list)):
            shape = tuple(_dense(shape, depth + 1, budget).ravel().tolist())
        if not isinstance(shape, tuple) or len(shape) > _MOST_AXES:
            raise FileFormatError("holds a chumpy Select with a malformed preferred_shape")
        if not all(map(_is_length, shape)) or math.prod(shape) != len(indices):
            raise FileFormatError(
                f"holds a chumpy Select of {len(indices)} numbers whose preferred_shape is "
                f"{shortened(shape)}"
            )
        return chosen_from[indices].reshape(shape)


def plain_value(value: Any, budget: Budget) -> Any:
    """Return a value of a pickle as an array or a sparse matrix.

    Parameters
    ----------
    value : object
        A record, a number, a text, or a list of them.
    budget : Budget
        Bytes that may still be copied.

    Returns
    -------
    array : array or scipy.sparse.coo_array

    Raises
    ------
    FileFormatError
        If it is neither.
    """
    return value.matrix() if isinstance(value, SparseRecord) else _dense(value, 0, budget)


def shortened(value: Any) -> str:
    """Return a text in a file, or the type of another value, for a message.

    Parameters
    ----------
    value : object
        The value.

    Returns
    -------
    text : str
        About 80 characters at most.
    """
    if isinstance(value, tuple) and len(value) <= _MOST_AXES and all(map(_is_length, value)):
        return repr(value)
    if not isinstance(value, str):
        return type(value).__name__
    text = value if value.isprintable() else repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _dense(value: Any, depth: int, budget: Budget) -> np.ndarray:
    if isinstance(value, ChumpyRecord):
        return value.value(depth, budget)
    if isinstance(value, ArrayRecord) and value.array is not None:
        return value.array
    items = value if isinstance(value, (list, tuple)) else [value]
    if all(
        len(item) <= _LONGEST_TEXT
        if isinstance(item, (str, np.bytes_))
        else isinstance(item, (int, float, np.generic))
        for item in items
    ):
        return np.asarray(value)
    raise FileFormatError(f"holds {shortened(type(value).__name__)} in place of an array")


def _attributes(state: Any, label: str) -> dict[str, Any]:
    if isinstance(state, tuple) and len(state) == 2 and state[1] is None:
        state = state[0]
    if not isinstance(state, dict):
        raise FileFormatError(f"holds a malformed {label}")
    return state


def _is_length(value: Any) -> bool:
    return isinstance(value, (int, np.integer)) and bool(0 <= value < 2**62)


def _indices(record: Any) -> np.ndarray:
    array = record.array if isinstance(record, ArrayRecord) else record
    if not isinstance(array, np.ndarray) or array.ndim != 1 or array.dtype.kind not in "iu":
        raise FileFormatError("holds a sparse matrix with malformed indices")
    return array.astype(np.int64)


def bytes_of(data: Any, budget: Budget) -> bytes | bytearray:
    """Return data as bytes, also where Python 2 wrote them as text.

    Parameters
    ----------
    data : object
        Text or bytes.
    budget : Budget
        Bytes that may still be copied.

    Raises
    ------
    FileFormatError
        If the data are neither.
    """
    if not isinstance(data, (str, bytes, bytearray)):
        raise FileFormatError(f"holds an array whose data are {shortened(type(data).__name__)}")
    budget.take(len(data))
    try:
        return data.encode("latin-1") if isinstance(data, str) else data
    except UnicodeEncodeError as error:
        raise FileFormatError("holds an array whose data are no bytes") from error


def array_of(data: Any, dtype: Any, shape: Any, order: Any, budget: Budget) -> Any:
    """Return an array, after a comparison of its size with its data.

    Parameters
    ----------
    data : object
        Text or bytes.
    dtype : object
        A `DtypeRecord`.
    shape : object
        A tuple of lengths.
    order : object
        "F" if the first index runs fastest.
    budget : Budget
        Bytes that may still be copied.

    Returns
    -------
    array : array

    Raises
    ------
    FileFormatError
        If an argument is malformed, or the arguments do not match.
    """
    if not isinstance(dtype, DtypeRecord):
        raise FileFormatError("holds an array without a data type")
    if not isinstance(shape, tuple) or len(shape) > _MOST_AXES or not all(map(_is_length, shape)):
        raise FileFormatError(f"holds an array of shape {shortened(shape)}")
    raw = bytes_of(data, budget)
    needed = math.prod(shape) * dtype.dtype.itemsize
    if needed != len(raw):
        raise FileFormatError(
            f"holds an array of shape {shape} and type {dtype.dtype}, which takes {needed} bytes, "
            f"with {len(raw)} bytes of data"
        )
    array = np.ndarray(shape, dtype.dtype, raw, order="F" if order == "F" else "C")
    check_text(array)
    array.flags.writeable = False
    return array
