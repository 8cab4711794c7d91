"""What makes a metric another metric, in plain words that a file can hold."""

from __future__ import annotations

import hashlib
import inspect
from typing import Any

import numpy as np

from riemhuman.errors import ArgumentTypeError

# Parameters that no distance depends on.
_WITHOUT_EFFECT = frozenset({"equip", "geodesic_solver", "exp_solver", "log_solver"})


def digest(array: np.ndarray) -> bytes:
    """Return the SHA-256 digest of an array's bytes.

    Parameters
    ----------
    array : array
        Any array; its order in memory does not matter.

    Returns
    -------
    bytes, length 32
    """
    return hashlib.sha256(np.ascontiguousarray(array).data).digest()


def describe(value: Any) -> Any:
    """Return a description of a metric, as nested dictionaries, that JSON keeps exactly.

    Two metrics have the same description only if they give the same distances: it holds the class
    and every parameter it was made with, those of its space and of its template too. Arrays stand
    there by their digests, functions by their names and byte codes.

    Parameters
    ----------
    value : object
        The metric, or a parameter of it.

    Returns
    -------
    object
        Made of dict, list, str, int, float, bool and None.

    Raises
    ------
    ArgumentTypeError
        If an object does not keep a parameter it was made with in an attribute of that name.
    """
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray):
        return {
            "shape": list(value.shape),
            "dtype": str(value.dtype),
            "sha256": digest(value).hex(),
        }
    if isinstance(value, (list, tuple)):
        return [describe(item) for item in value]
    if inspect.isroutine(value):
        return _describe_function(value)
    return _describe_object(value)


def _describe_function(function: Any) -> dict[str, Any]:
    described: dict[str, Any] = {"function": f"{function.__module__}.{function.__qualname__}"}
    if inspect.ismethod(function):
        described["of"] = describe(function.__self__)
    code = getattr(function, "__code__", None)
    if code is not None:
        described["code"] = hashlib.sha256(code.co_code).hexdigest()
        # Nested functions among the constants show the address they happen to live at.
        constants = [repr(item) for item in code.co_consts if not inspect.iscode(item)]
        described["constants"] = constants
    cells = getattr(function, "__closure__", None) or ()
    described["closure"] = [describe(cell.cell_contents) for cell in cells]
    return described


def _describe_object(value: Any) -> dict[str, Any]:
    kind = type(value)
    described: dict[str, Any] = {"class": f"{kind.__module__}.{kind.__qualname__}"}
    for name in _parameters(kind):
        kept = next((key for key in (name, f"_{name}") if hasattr(value, key)), None)
        if kept is None:
            raise ArgumentTypeError(
                f"{kind.__qualname__} must keep its parameter {name} as an attribute of that name, "
                "for a job to tell it from others"
            )
        described[name] = describe(getattr(value, kept))
    # The factors of a product bring the metrics that make up its own.
    if hasattr(value, "factors"):
        described["metrics"] = [describe(factor.metric) for factor in value.factors]
    return described


def _parameters(kind: type) -> list[str]:
    try:
        names = inspect.signature(kind).parameters
    except ValueError as error:
        raise ArgumentTypeError(
            f"the metric holds a {kind.__qualname__}, which a job cannot tell from others"
        ) from error
    return [name for name in names if name not in _WITHOUT_EFFECT]
