"""One-line texts of objects and of lists of names; bases of objects that do not change."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from numbers import Number
from typing import TypeAlias

from numpy import ndarray

from riemhuman.errors import ArgumentError

Constructor: TypeAlias = Callable[..., None]  # type: ignore[explicit-any]  # of any arguments

_LONGEST = 80
_MISSING = object()


def constructor_text(value: object, leave_out: Sequence[str] = ()) -> str:
    """Return the call that makes an object, with numbers and what differs from its default."""
    # Arguments are found by name, as users have classes of their own.
    shown = []
    for name, parameter in inspect.signature(type(value)).parameters.items():
        kept: object = getattr(value, name if hasattr(value, name) else f"_{name}", _MISSING)
        if name in leave_out or kept is _MISSING:
            continue
        if parameter.kind is parameter.VAR_KEYWORD and isinstance(kept, Mapping):
            shown += [f"{key}={_brief(item)}" for key, item in kept.items()]
            continue
        # Texts are compared by value, since pickling copies them; other values by identity.
        is_default = kept is parameter.default or (
            isinstance(kept, str) and kept == parameter.default
        )
        if isinstance(kept, Number) or not is_default:
            shown.append(f"{name}={_brief(kept)}")
    return f"{type(value).__name__}({', '.join(shown)})"


def field_texts(value: object) -> dict[str, str]:
    """Return the fields of a data class as brief texts: numbers, and the shapes of arrays."""
    assert dataclasses.is_dataclass(value)
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


def join_names(names: Sequence[str], most: int = 10) -> str:
    """Return the first of some names as a list, and the number of the others."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(_cut, names[:most])) + more


class Record:
    """Base of data classes that hold arrays, with a one-line representation by shapes."""

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={text}" for name, text in field_texts(self).items())
        return f"{type(self).__name__}({shown})"


class Unchanging:
    """Base of classes whose arguments cannot be set again once an object is constructed."""

    _is_complete = False

    # Constructors of subclasses set arguments before and after they call those of their bases: only
    # the one of the object's own class knows when it is done.
    def __init_subclass__(cls, **keywords: object) -> None:
        super().__init_subclass__(**keywords)
        if "__init__" in vars(cls):
            cls.__init__ = _completing(cls.__init__)  # type: ignore[method-assign]

    def __setattr__(self, name: str, value: object) -> None:
        if self._is_complete and self._is_fixed(name):
            raise ArgumentError(
                f"{name} of {type(self).__name__} cannot be changed; create another one"
            )
        super().__setattr__(name, value)

    def _is_fixed(self, name: str) -> bool:
        # By name, for the arguments of classes that are not known here.
        return name in inspect.signature(type(self)).parameters


def _completing(constructor: Constructor) -> Constructor:
    @wraps(constructor)
    def construct(self: Unchanging, *arguments: object, **keywords: object) -> None:
        constructor(self, *arguments, **keywords)
        if type(self).__init__ is construct:
            self._is_complete = True

    return construct


def _brief(value: object) -> str:
    text = value.__qualname__ if inspect.isroutine(value) else repr(value)
    return _cut(" ".join(text.split()))


def _cut(text: str) -> str:
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."
