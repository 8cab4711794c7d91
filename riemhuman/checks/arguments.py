"""Arguments, declared once beside a function or class and checked at the public door.

`checked` is the one decorator. It takes a check for each argument: a function of a value and its
name, which returns the value to use or raises an error that names the argument.
"""

from __future__ import annotations

import functools
import inspect
import operator
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn, SupportsIndex, TypeAlias, TypeVar, cast

import numpy as np

from riemhuman.arrays import ArrayLike
from riemhuman.errors import ArgumentError, ArgumentTypeError, shown

Rng = int | np.random.Generator | None

Choice = TypeVar("Choice")
Kind = TypeVar("Kind")
Target = TypeVar("Target", bound=Callable[..., object])

# From a frame in thirty years to one a nanosecond.
_FRAME_RATES = 1e-9, 1e9

Check: TypeAlias = Callable[..., object]
"""A function of a value and its name, which returns the value to use or raises an error."""


@dataclass(frozen=True)
class OfOwner:
    """A check that an object has for the arguments of its own methods.

    `OfOwner(lambda metric: metric.space.check_point)` checks points of the metric's space.
    """

    check_of: Callable[..., Check]


def checked(**checks: Check | OfOwner) -> Callable[[Target], Target]:
    """Check the arguments of a function, or the fields of a data class, whenever it is called.

    The function gets the values that the checks return. Defaults are not checked, and None passes
    where it is the default. A data class adds its checks to those of its bases; one that has only
    new defaults says ``@checked()``.

    Parameters
    ----------
    **checks
        A check for each argument, by its name.

    Examples
    --------
    >>> from riemhuman.checks import checked, whole
    >>> @checked(n_times=whole(minimum=2))
    ... def times(n_times=11):
    ...     return np.linspace(0.0, 1.0, n_times)
    >>> times(1)
    Traceback (most recent call last):
        ...
    riemhuman.errors.ArgumentError: n_times must be a whole number of at least 2; found 1
    """

    def declare(target: Target) -> Target:
        if not isinstance(target, type):
            return cast("Target", _checking(target, checks))
        fields: dict[str, Check | OfOwner] = {**getattr(target, "argument_checks", {}), **checks}
        target.argument_checks = fields  # type: ignore[attr-defined]  # read by subclasses, above
        target.__init__ = _checking(target.__init__, fields)  # type: ignore[misc]
        return target

    return declare


def _checking(function: Check, checks: Mapping[str, Check | OfOwner]) -> Check:
    """Return a function that checks its arguments first."""
    parameters = inspect.signature(function).parameters
    places = {name: place for place, name in enumerate(parameters)}
    declared = [
        (places[name], name, check, parameters[name].default is None)
        for name, check in checks.items()
    ]

    @functools.wraps(function)
    def call(*arguments: object, **keywords: object) -> object:
        values = list(arguments)
        for place, name, check, is_optional in declared:
            if place < len(values):
                value = values[place]
            elif name in keywords:
                value = keywords[name]
            else:
                continue
            if value is None and is_optional:
                continue
            if isinstance(check, OfOwner):
                value = check.check_of(values[0])(value, name)
            else:
                value = check(value, name)
            if name in keywords:
                keywords[name] = value
            else:
                values[place] = value
        return function(*values, **keywords)

    return call


# Checks.


def real_number(
    value: ArrayLike,
    name: str,
    *,
    minimum: float = -np.inf,
    strict: bool = False,
    maximum: float = np.inf,
) -> float:
    """Return `value` as a finite float between bounds (if `strict`, above the lower one)."""
    try:
        # Text and moments in time convert to float as well, and arrays of one number did so
        # before NumPy 2.4.
        if isinstance(value, (str, bytes)) or np.ndim(value) != 0:
            raise TypeError
        if getattr(getattr(value, "dtype", None), "kind", "f") not in "fiub":
            raise TypeError
        number = float(value)  # type: ignore[arg-type]  # TypeError where it is no number
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(f"{name} must be a real number; found {shown(value)}") from error
    if not np.isfinite(number) or number < minimum or (strict and number == minimum):
        bound = "" if minimum == -np.inf else f" {'above' if strict else 'of at least'} {minimum:g}"
        raise ArgumentError(f"{name} must be a finite number{bound}; found {number!r}")
    if number > maximum:
        raise ArgumentError(f"{name} must be at most {maximum:g}; found {number:g}")
    return number


def whole_number(
    value: SupportsIndex, name: str, *, minimum: int | None = None, maximum: int | None = None
) -> int:
    """Return `value` as an int from `minimum` to `maximum`; answers, True or False, are refused."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError as error:
        raise ArgumentTypeError(f"{name} must be a whole number; found {shown(value)}") from error
    if minimum is not None and number < minimum:
        raise ArgumentError(f"{name} must be a whole number of at least {minimum}; found {number}")
    if maximum is not None and number > maximum:
        raise ArgumentError(f"{name} must be a whole number of at most {maximum}; found {number}")
    return number


def checked_rate(value: ArrayLike, name: str = "frames_per_second") -> float:
    """Return a number of frames in a second as a float, within what clocks can measure."""
    slowest, fastest = _FRAME_RATES
    return real_number(value, name, minimum=slowest, maximum=fastest)


def metric_weight(value: ArrayLike, name: str, *, strict: bool = False) -> float:
    """Return a weight of a metric as a float of at least 0, or above it if `strict`."""
    return real_number(value, name, minimum=0.0, strict=strict)


def one_of(value: Choice, name: str, choices: Sequence[object]) -> Choice:
    """Return `value`, or raise an ArgumentError if it is not one of `choices`."""
    try:
        is_known = not isinstance(value, np.ndarray) and value in choices
    except (TypeError, ValueError):  # what compares by elements, such as a series of pandas
        is_known = False
    if not is_known:
        listed = ", ".join(repr(choice) for choice in choices)
        raise ArgumentError(f"{name} must be one of {listed}; found {shown(value)}")
    return value


def flag(value: object, name: str) -> bool:
    """Return an answer, yes or no, as a bool; 0 and 1 are answers as well."""
    if isinstance(value, (bool, np.bool_, int, np.integer)) and 0 <= value <= 1:
        return bool(value)
    raise ArgumentTypeError(f"{name} must be True or False; found {shown(value)}")


def generator(rng: Rng) -> np.random.Generator:
    """Return a NumPy generator: the one given, or a new one, with a seed if one is given."""
    if isinstance(rng, np.random.Generator):
        return rng
    if rng is None:
        return np.random.default_rng()
    return np.random.default_rng(whole_number(rng, "rng", minimum=0))


def items_of(values: Iterable[Kind], name: str, expected: str) -> tuple[Kind, ...]:
    """Return the items of an iterable that is no text and no mapping."""
    if isinstance(values, (str, bytes, memoryview, Mapping)):
        refuse_type(values, name, expected)
    try:
        return tuple(values)
    except TypeError as error:
        raise ArgumentTypeError(
            f"{name} must be {expected}; found {type(values).__name__}"
        ) from error


def refuse_type(value: object, name: str, expected: str) -> NoReturn:
    """Raise an ArgumentTypeError that says which class was found, or that it was a class itself."""
    if isinstance(value, type):
        raise ArgumentTypeError(f"{name} must be {expected}; found the class {value.__name__}")
    raise ArgumentTypeError(f"{name} must be {expected}; found {type(value).__name__}")


def check_instance(
    value: object, name: str, cls: type[object] | tuple[type[object], ...], expected: str = ""
) -> object:
    """Return an object of this class, or raise an ArgumentTypeError that says what was found."""
    if not isinstance(value, cls):
        known = cls if isinstance(cls, tuple) else (cls,)
        refuse_type(value, name, expected or " or ".join(f"a {c.__name__}" for c in known))
    return value


def check_methods(value: object, name: str, expected: str, *methods: str) -> None:
    """Raise an ArgumentTypeError unless this is an object, no class, with these methods."""
    if isinstance(value, type) or not all(
        callable(getattr(value, method, None)) for method in methods
    ):
        refuse_type(value, name, expected)


# Checks with options, for declarations.


def real(
    *, minimum: float = -np.inf, above: float = -np.inf, maximum: float = np.inf
) -> Callable[[ArrayLike, str], float]:
    """Return the check of a finite number between bounds."""
    return functools.partial(
        real_number,
        minimum=max(minimum, above),
        strict=above > minimum,
        maximum=maximum,
    )


positive = real(above=0.0)
"""The check of a number above 0: a length, an angle, a weight or a tolerance."""

share = real(minimum=0.0, maximum=1.0)
"""The check of a number from 0 to 1."""


def whole(
    *, minimum: int | None = None, maximum: int | None = None
) -> Callable[[SupportsIndex, str], int]:
    """Return the check of a whole number between bounds."""
    return functools.partial(whole_number, minimum=minimum, maximum=maximum)


def choice(*choices: Choice) -> Callable[[Choice, str], Choice]:
    """Return the check of one of some values."""
    return functools.partial(one_of, choices=choices)


def instance(
    cls: type[object] | tuple[type[object], ...], expected: str = ""
) -> Callable[[object, str], object]:
    """Return the check of an object of a class; `expected` describes it in messages."""
    return functools.partial(check_instance, cls=cls, expected=expected)


def having(expected: str, *methods: str) -> Callable[[object, str], object]:
    """Return the check of an object, no class, that has some methods."""

    def check(value: object, name: str) -> object:
        check_methods(value, name, expected, *methods)
        return value

    return check


a_function = having("a function", "__call__")
"""The check of what can be called."""

a_basis = having("a DeformationBasis", "check_fits", "extend")
"""The check of a basis of deformations."""

a_solver = having(
    "an object with a method solve, such as LinearPath() for paths or BasisMean() for means",
    "solve",
)
"""The check of a solver."""


def each(check: Check, expected: str) -> Callable[[Iterable[Kind], str], tuple[Kind, ...]]:
    """Return the check of several values, as a tuple."""

    def check_each(values: Iterable[Kind], name: str) -> tuple[Kind, ...]:
        items = items_of(values, name, expected)
        return tuple(
            cast("Kind", check(item, f"{name}[{number}]")) for number, item in enumerate(items)
        )

    return check_each
