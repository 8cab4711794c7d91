"""Descriptions of metrics, solvers and arrays, by which jobs recognise their inputs."""

from __future__ import annotations

import functools
import hashlib
import inspect
import math
from collections.abc import Mapping

import numpy as np

from riemhuman.arrays import JSONRecord, JSONValue, Values

# Parameters that distances in closed form do not depend on.
_SOLVERS = frozenset({"geodesic_solver", "exp_solver", "log_solver", "transport_solver", "solvers"})

# Objects within objects: deeper ones are described by their classes alone.
_DEPTH = 12


def digest(array: Values) -> bytes:
    """Return the SHA-256 digest of an array's bytes; its order in memory does not matter."""
    bytes_of_array = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    return hashlib.sha256(bytes_of_array.data).digest()


def describe(value: object, _depth: int = 0) -> JSONValue:
    """Return the class, the parameters and the arrays of an object, as values that JSON keeps."""
    if value is None or type(value) in (bool, int, str):
        return value
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else str(float(value))
    if isinstance(value, np.ndarray) and value.dtype.kind != "O":
        contents = {"dtype": str(value.dtype), "sha256": digest(value).hex()}
        return {"shape": list(value.shape), **contents}
    if isinstance(value, np.generic):
        return describe(value.item())
    if isinstance(value, functools.partial):
        inner = [value.func, *value.args, value.keywords]
        return {"partial": [describe(part, _depth + 1) for part in inner]}
    if isinstance(value, type) or inspect.isroutine(value):
        return {"name": f"{value.__module__}.{value.__qualname__}"}
    if _depth >= _DEPTH:
        return {"class": type(value).__qualname__}
    if isinstance(value, Mapping):
        return {str(key): describe(value[key], _depth + 1) for key in value}
    if isinstance(value, (list, tuple, np.ndarray)):
        return [describe(item, _depth + 1) for item in value]
    if isinstance(value, (set, frozenset)):
        return sorted((describe(item, _depth + 1) for item in value), key=repr)
    cls = type(value)
    description: JSONRecord = {"class": f"{cls.__module__}.{cls.__qualname__}"}
    for name, item in _parameters(value).items():
        description[name] = describe(item, _depth + 1)
    return description


def _parameters(value: object) -> JSONRecord:
    """Return the arguments of the constructor that an object keeps as attributes."""
    # By name, since metrics and solvers may be of classes of a user's own.
    try:
        names = set(inspect.signature(type(value)).parameters)
    except (TypeError, ValueError):
        return {}
    names.discard("equip")
    if getattr(value, "has_closed_form_dist", False):
        names -= _SOLVERS
    parameters: JSONRecord = {}
    for name in sorted(names):
        for attribute in (name, f"_{name}"):
            if hasattr(value, attribute):
                parameters[name] = getattr(value, attribute)
                break
    return parameters
