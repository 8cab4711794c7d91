"""The classes and functions that a pickled body model may name, and their harmless substitutes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from riemhuman.errors import FileFormatError
from riemhuman.io._pickled_objects import (
    ArrayRecord,
    Budget,
    ChumpyRecord,
    DtypeRecord,
    Record,
    SparseRecord,
    array_of,
    bytes_of,
    shortened,
)


class Global:
    """A class or function that a pickle names.

    Parameters
    ----------
    module, name : str
        Its module and its name.

    Raises
    ------
    FileFormatError
        If pickles of body models may not name it.
    """

    def __init__(self, module: str, name: str) -> None:
        if (module, name) not in _ALLOWED:
            raise FileFormatError(
                f"asks for {shortened(module + '.' + name)}, which is refused: body models may "
                "hold NumPy arrays, SciPy sparse matrices and chumpy.ch.Ch or "
                "chumpy.reordering.Select alone. Nothing in the file was run"
            )
        self.label = f"{module}.{name}"
        self._role = _ALLOWED[module, name]

    def call(self, arguments: Any, budget: Budget) -> Any:
        """Return the record of the object that a call would make.

        Parameters
        ----------
        arguments : object
            Arguments, which must be a tuple.
        budget : Budget
            Bytes that may still be copied.

        Raises
        ------
        FileFormatError
            If body models do not call it, or not with such arguments.
        """
        function = _CALLS.get(self._role)
        if function is None or not isinstance(arguments, tuple):
            raise FileFormatError(f"calls {self.label}, which is refused")
        try:
            return function(budget, *arguments)
        except (TypeError, ValueError) as error:
            if isinstance(error, FileFormatError):
                raise
            raise FileFormatError(f"calls {self.label} with malformed arguments") from error

    def new(self, arguments: Any) -> Record:
        """Return the record of a new object of this class.

        Parameters
        ----------
        arguments : object
            Arguments of the class, which must be an empty tuple.

        Raises
        ------
        FileFormatError
            If it is not a class of objects with a state, or arguments are given.
        """
        kind, _, name = self._role.partition(" ")
        if kind not in ("sparse", "chumpy") or arguments != ():
            raise FileFormatError(f"makes an object of {self.label} in a way that is refused")
        return SparseRecord(name) if kind == "sparse" else ChumpyRecord(name)


def _empty_array(budget: Budget, cls: Any, shape: Any, code: Any) -> ArrayRecord:
    _expect(cls, "ndarray")
    return ArrayRecord()


def _array_of_buffer(
    budget: Budget, data: Any, dtype: Any, shape: Any, order: Any = "C"
) -> ArrayRecord:
    return ArrayRecord(array_of(data, dtype, shape, order, budget))


def _scalar(budget: Budget, dtype: Any, data: Any) -> Any:
    return array_of(data, dtype, (), "C", budget)[()]


def _dtype(budget: Budget, code: Any, align: Any = False, copy: Any = False) -> DtypeRecord:
    return DtypeRecord(code)


def _encoded(budget: Budget, text: Any, encoding: Any = None) -> bytes | bytearray:
    if not isinstance(text, str) or encoding not in ("latin1", "latin-1"):
        raise FileFormatError(f"encodes text as {shortened(encoding)}, which is refused")
    return bytes_of(text, budget)


def _reconstructed(budget: Budget, cls: Any, base: Any, state: Any) -> Record:
    _expect(base, "object")
    if not isinstance(cls, Global) or state is not None:
        raise FileFormatError("makes an object in a way that is refused")
    return cls.new(())


def _set(budget: Budget, items: Any = ()) -> tuple[Any, ...]:
    """Return the items of a set, which chumpy stores and nobody reads, without hashing them."""
    if not isinstance(items, (list, tuple)):
        raise FileFormatError("holds a malformed set")
    return tuple(items)


def _expect(found: Any, role: str) -> None:
    if not isinstance(found, Global) or found._role != role:
        raise FileFormatError(f"makes an object of something that is no {role}")


_CALLS: dict[str, Callable[..., Any]] = {
    "empty array": _empty_array,
    "array of buffer": _array_of_buffer,
    "scalar": _scalar,
    "dtype": _dtype,
    "encode": _encoded,
    "reconstruct": _reconstructed,
    "set": _set,
}

_ALLOWED: dict[tuple[str, str], str] = {
    ("numpy", "ndarray"): "ndarray",
    ("numpy", "dtype"): "dtype",
    ("_codecs", "encode"): "encode",
    ("chumpy.ch", "Ch"): "chumpy Ch",
    ("chumpy.reordering", "Select"): "chumpy Select",
}
for _core in ("numpy.core", "numpy._core"):
    _ALLOWED[f"{_core}.multiarray", "_reconstruct"] = "empty array"
    _ALLOWED[f"{_core}.multiarray", "scalar"] = "scalar"
    _ALLOWED[f"{_core}.numeric", "_frombuffer"] = "array of buffer"
for _layout in ("csc", "csr", "coo"):
    for _module in (f"scipy.sparse.{_layout}", f"scipy.sparse._{_layout}"):
        _ALLOWED[_module, f"{_layout}_matrix"] = f"sparse {_layout}"
        _ALLOWED[_module, f"{_layout}_array"] = f"sparse {_layout}"
for _builtins, _registry in (("__builtin__", "copy_reg"), ("builtins", "copyreg")):
    _ALLOWED[_registry, "_reconstructor"] = "reconstruct"
    _ALLOWED[_builtins, "object"] = "object"
    _ALLOWED[_builtins, "set"] = "set"
