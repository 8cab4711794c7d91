"""Descriptions of metrics, solvers and arrays, by which a job recognises its inputs."""

from __future__ import annotations

import functools
import hashlib
import inspect
import re
import types
from abc import ABC
from collections.abc import Iterator, Mapping
from enum import Enum
from pathlib import PurePath
from typing import Any, Generic

import numpy as np

from riemhuman.errors import ArgumentTypeError
from riemhuman.io._code import is_own, library_of, reached_by

# Parameters on which no distance depends; nor on the solver, if distances have a closed form.
_WITHOUT_EFFECT = frozenset({"equip", "exp_solver", "log_solver", "transport_solver"})
_SOLVER = "geodesic_solver"
# Attributes of a class that do not come from its body.
_OF_EVERY_CLASS = frozenset(
    {"__dict__", "__weakref__", "__doc__", "__module__", "__qualname__", "__annotations__"}
    | {"__firstlineno__", "__static_attributes__", "__annotate_func__", "__annotate__"}
    | {
        "__annotations_cache__",
        "__abstractmethods__",
        "_abc_impl",
        "__orig_bases__",
        "__parameters__",
        "__slotnames__",
    }
)
_COMPILED = (
    *(types.BuiltinFunctionType, types.MethodWrapperType, types.WrapperDescriptorType),
    *(types.MethodDescriptorType, types.ClassMethodDescriptorType, np.ufunc),
)


def digest(array: np.ndarray) -> bytes:
    """Return the SHA-256 digest of an array's bytes."""
    return hashlib.sha256(np.ascontiguousarray(array).data).digest()


def describe(value: Any) -> Any:
    """Return a description of a metric as nested dictionaries that JSON keeps exactly.

    Metrics with the same description give the same distances: the description holds all parameters
    of the metric, its space and its template, and the code that it runs. Arrays are represented by
    their digests; functions and classes by their code, constants, defaults, closures, bases and the
    globals that the code reaches; those of installed libraries, riemhuman included, by name and
    version. The description is the same in every process, before and after the metric is used.
    """
    try:
        return _Description().of(value)
    except RecursionError as error:
        raise _cannot(value) from error


class _Description:
    """One description, in which an object that occurs again is represented by its number."""

    def __init__(self) -> None:
        # Kept, so that no other object gets the same identity meanwhile.
        self._met: dict[int, tuple[int, Any]] = {}

    def of(self, value: Any) -> Any:
        """Describe anything."""
        described = self._data(value)
        if described is not None or value is None:
            return described
        # Only objects that may refer to themselves get numbers: whether equal immutable values are
        # one object is up to the interpreter.
        if id(value) in self._met:
            return {"met": self._met[id(value)][0]}
        self._met[id(value)] = (len(self._met), value)
        if type(value) is list:
            return [self.of(item) for item in value]
        if type(value) in (dict, types.MappingProxyType):
            return {"pairs": [[self.of(key), self.of(item)] for key, item in value.items()]}
        return self._code(value)

    def _data(self, value: Any) -> Any:
        """Describe immutable values and arrays; None for anything else."""
        if type(value) in (bool, int, str):
            return value
        if type(value) is float:
            return value if np.isfinite(value) else {"float": str(value)}
        if isinstance(value, np.ndarray) and value.dtype.kind == "O":
            return {"shape": list(value.shape), "items": [self.of(item) for item in value.flat]}
        if isinstance(value, np.ndarray):
            data = {"dtype": str(value.dtype), "sha256": digest(value).hex()}
            return {"shape": list(value.shape), **data}
        if isinstance(value, np.generic):
            return {"scalar": str(value.dtype), "value": self.of(value.item())}
        if type(value) is tuple:
            return [self.of(item) for item in value]
        if type(value) in (set, frozenset):
            return {"set": sorted((self.of(item) for item in value), key=repr)}
        if type(value) in (bytes, bytearray):
            return {"bytes": hashlib.sha256(value).hexdigest()}
        if type(value) in (complex, slice, range, types.EllipsisType):
            return {"value": repr(value)}
        if isinstance(value, (np.dtype, PurePath)):
            return {"value": repr(value)}
        if isinstance(value, re.Pattern):
            return {"pattern": self.of(value.pattern), "flags": value.flags}
        if isinstance(value, Enum):
            return {"member": value.name, "of": self.of(type(value))}
        return None

    def _code(self, value: Any) -> Any:
        if isinstance(value, types.ModuleType):
            return self._named(value, value.__name__)
        if isinstance(value, type):
            return self._class(value)
        if isinstance(value, functools.partial):
            return {"partial": [self.of(part) for part in (value.func, value.args, value.keywords)]}
        if isinstance(value, property):
            return {"property": [self.of(part) for part in (value.fget, value.fset)]}
        if isinstance(value, (staticmethod, classmethod)):
            return {type(value).__name__: self.of(value.__func__)}
        if isinstance(value, functools.cached_property):
            return {"property": self.of(value.func)}
        if inspect.ismethod(value):
            return {"method": self.of(value.__func__), "of": self.of(value.__self__)}
        if inspect.isfunction(value):
            return self._function(value)
        if isinstance(getattr(value, "py_func", None), types.FunctionType):
            options = sorted(map(repr, getattr(value, "targetoptions", {}).items()))
            return {"compiled": self.of(value.py_func), "options": options}
        if isinstance(getattr(value, "__wrapped__", None), types.FunctionType):
            return {"around": self.of(value.__wrapped__), "by": self.of(type(value))}
        if isinstance(value, _COMPILED) or type(value).__name__ == "cython_function_or_method":
            return self._compiled(value)
        if isinstance(value, (types.MemberDescriptorType, types.GetSetDescriptorType)):
            return {"slot": value.__name__}
        return self._object(value)

    def _named(self, value: Any, name: str) -> dict[str, Any]:
        """Describe something of an installed library by its name, or refuse it."""
        library = library_of(value)
        if library is None:
            raise _cannot(value)
        return {"name": name, **library}

    def _compiled(self, function: Any) -> dict[str, Any]:
        owner = getattr(function, "__self__", None)
        name = getattr(function, "__qualname__", getattr(function, "__name__", repr(function)))
        if owner is None or isinstance(owner, types.ModuleType):
            return self._named(function, name)
        return {"method": name, "of": self.of(owner)}

    def _function(self, function: types.FunctionType) -> dict[str, Any]:
        described: dict[str, Any] = {"function": f"{function.__module__}.{function.__qualname__}"}
        library = library_of(function)
        reached: dict[str, Any] = {}
        if library is not None:
            described |= library
        else:
            reached = reached_by(function)
            described["code"] = self._code_object(function.__code__)
        # A function made by a library, such as a decorated one, may hold a function of the user.
        described["defaults"] = [self.of(value) for value in function.__defaults__ or ()]
        described |= self._by_name("keywords", function.__kwdefaults__ or {})
        cells = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
        described |= self._by_name("closure", {name: _content(cells[name]) for name in cells})
        return described | self._by_name("globals", reached)

    def _code_object(self, code: types.CodeType) -> dict[str, Any]:
        names = [code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars]
        shape = [code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags]
        table = hashlib.sha256(code.co_exceptiontable).hexdigest()
        return {
            "bytes": hashlib.sha256(code.co_code).hexdigest(),
            "constants": [
                self._code_object(item) if inspect.iscode(item) else self.of(item)
                for item in code.co_consts
            ],
            "names": [list(some) for some in names],
            "shape": [*shape, table],
        }

    def _class(self, kind: type) -> dict[str, Any]:
        described: dict[str, Any] = {"class": f"{kind.__module__}.{kind.__qualname__}"}
        library = library_of(kind)
        if library is not None:
            return described | library
        body = {name: value for name, value in vars(kind).items() if name not in _OF_EVERY_CLASS}
        described["bases"] = [self.of(base) for base in kind.__bases__]
        return described | self._by_name("body", body)

    def _object(self, value: Any) -> dict[str, Any]:
        described = self._class(type(value))
        library = library_of(type(value))
        if not is_own(library):
            # Other libraries keep parameters under any names: describe the whole state.
            described |= self._state(value) if _has_foreign_state(value) else {}
        if library is None or is_own(library):
            for name, item in _parameters(value).items():
                described[f"{name} (parameter)" if name in described else name] = self.of(item)
        if library is None and hasattr(value, "__dict__"):
            described |= self._by_name("attributes", _public_attributes(value))
        # The factors of a product bring the metrics that make up its own.
        if factors := getattr(value, "factors", ()):
            described["metrics"] = [self.of(f.metric) for f in factors if hasattr(f, "metric")]
        return described

    def _state(self, value: Any) -> dict[str, Any]:
        try:
            function, arguments, *state = value.__reduce_ex__(4)
        except (TypeError, ValueError) as error:
            raise _cannot(value) from error
        items = [list(item) if isinstance(item, Iterator) else item for item in state]
        # The class itself is described already, in more detail.
        parts = [part for part in (*arguments, *items) if part is not type(value)]
        return {"made by": self.of(function), "state": [self.of(part) for part in parts]}

    def _by_name(self, where: str, values: Mapping[str, Any]) -> dict[str, Any]:
        """Describe values by their names, or return nothing if there are none."""
        found = {name: self.of(values[name]) for name in sorted(values)}
        return {where: found} if found else {}


def _content(csv_cell: types.CellType) -> Any:
    try:
        return csv_cell.cell_contents
    except ValueError:
        return None  # not yet filled


def _has_foreign_state(value: Any) -> bool:
    """Tell whether a class of another library is among the bases of an object's class."""
    kinds = [kind for kind in type(value).__mro__ if kind not in (object, ABC, Generic)]
    libraries = map(library_of, kinds)
    return any(library is not None and not is_own(library) for library in libraries)


def _parameters(value: Any) -> dict[str, Any]:
    """Return the arguments that an object was constructed with."""
    kind = type(value)
    try:
        names = set(inspect.signature(kind).parameters)
    except ValueError as error:
        raise _cannot(value) from error
    if "solvers" in names:  # the metrics' **solvers
        names = names - {"solvers"} | {_SOLVER}
    kept = {}
    for name in sorted(names - _without_effect(value)):
        key = next((key for key in (name, f"_{name}") if hasattr(value, key)), None)
        if key is None:
            raise ArgumentTypeError(
                f"{kind.__qualname__} must keep its parameter {name} as an attribute of that name, "
                "so that a job can record it; or give the job a key"
            )
        kept[name] = getattr(value, key)
    return kept


def _without_effect(value: Any) -> frozenset[str]:
    solved = not getattr(value, "has_closed_form_dist", True)
    return _WITHOUT_EFFECT if solved else _WITHOUT_EFFECT | {_SOLVER}


def _public_attributes(value: Any) -> dict[str, Any]:
    """Return attributes that may have been set from outside; cached properties are left out."""
    return {
        name: item
        for name, item in vars(value).items()
        # The metric that a space is equipped with has no effect on another metric.
        if not name.startswith("_") and name not in _without_effect(value) | {"metric"}
        if not isinstance(getattr(type(value), name, None), functools.cached_property)
    }


def _cannot(value: Any) -> ArgumentTypeError:
    return ArgumentTypeError(
        f"the metric depends on {type(value).__qualname__} {value!r:.100}, which a job cannot "
        "record; give the job a key, and another key whenever its distances change"
    )
