"""One-line representations of objects: how they were constructed."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from numbers import Number
from typing import Any

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


def _brief(value: object) -> str:
    text = " ".join(_name(value).split())
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def _name(value: Any) -> str:
    return value.__qualname__ if inspect.isroutine(value) else repr(value)
