"""One-line representations of objects: how they were constructed, or what they hold."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Sequence
from numbers import Number
from typing import Any

from numpy import ndarray

from riemhuman.docstrings import InheritsDocstrings

_LONGEST = 80
_MISSING = object()


def constructed(value: object, leave_out: Sequence[str] = ()) -> str:
    """Return the call that constructs an object, in a line.

    Shown are arguments that are kept under their own names, or with an underscore before:
    numbers, and all others that are not as by default.

    Parameters
    ----------
    value : object
        The object.
    leave_out : sequence of str
        Names of arguments that are not shown.

    Returns
    -------
    str
    """
    shown = []
    for name, parameter in inspect.signature(type(value)).parameters.items():
        held = getattr(value, name, getattr(value, f"_{name}", _MISSING))
        if name in leave_out or held is _MISSING:
            continue
        # Equal texts may be two objects, as after pickling; arrays are not compared.
        is_default = held is parameter.default or (
            isinstance(held, str) and held == parameter.default
        )
        if isinstance(held, Number) or not is_default:
            shown.append(f"{name}={_brief(held)}")
    return f"{type(value).__name__}({', '.join(shown)})"


def held(value: Any) -> dict[str, str]:
    """Return what a data class holds as brief texts: numbers, and the shapes of arrays.

    Parameters
    ----------
    value : object
        An instance of a data class.

    Returns
    -------
    dict of str
    """
    shown = {}
    for field in dataclasses.fields(value):
        part = getattr(value, field.name)
        if isinstance(part, ndarray) and part.ndim:
            shown[field.name] = f"<array {part.shape}>"
        elif isinstance(part, (float, ndarray)):
            shown[field.name] = f"{float(part):.6g}"
        else:
            shown[field.name] = _brief(part)
    return shown


class Record(InheritsDocstrings):
    """A part of data classes that hold arrays, which shows them in a line by their shapes."""

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={text}" for name, text in held(self).items())
        return f"{type(self).__name__}({shown})"


def _brief(value: object) -> str:
    text = " ".join(_name(value).split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def _name(value: Any) -> str:
    return value.__qualname__ if inspect.isroutine(value) else repr(value)
