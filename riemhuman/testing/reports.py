"""Reports of checks: a property each, its error and the tolerance."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.errors import RiemhumanError
from riemhuman.representation import Record

__all__ = ["PropertyCheck", "PropertyReport"]

Properties = Mapping[str, Callable[[], float]]
"""Functions that measure the error of each property; of a verdict, whether it is wrong."""


@dataclass(frozen=True)
class PropertyCheck:
    """The error of an object in one property.

    Attributes
    ----------
    name : str
        Name of the property.
    error : float
        Size of the violation, relative to the size of the compared values; NaN if the object
        returns NaN.
    tolerance : float
        Largest error that passes.

    Examples
    --------
    >>> rh.testing.PropertyCheck("the inner product is symmetric", 0.0, 1e-6).holds
    True
    """

    name: str
    error: float
    tolerance: float

    @property
    def holds(self) -> bool:
        """Whether the object has the property, within the tolerance."""
        return bool(self.error <= self.tolerance)

    def __str__(self) -> str:
        verdict, sign = ("holds", "≤") if self.holds else ("FAILS", ">")
        return f"{verdict}  {self.name:<48} {self.error:8.1e} {sign} {self.tolerance:.0e}"


@dataclass(frozen=True, repr=False)
class PropertyReport(Record):
    """The checked properties of an object; it prints as a table.

    Attributes
    ----------
    name : str
        Class of the object.
    checks : tuple of PropertyCheck
        One check for every property.

    Examples
    --------
    >>> rh.testing.check_manifold(rh.VectorSpace((2,))).name
    'VectorSpace'
    """

    name: str
    checks: tuple[PropertyCheck, ...]

    @property
    def failures(self) -> tuple[PropertyCheck, ...]:
        """The properties that failed."""
        return tuple(check for check in self.checks if not check.holds)

    @property
    def passed(self) -> bool:
        """Whether all properties hold."""
        return not self.failures

    def __str__(self) -> str:
        n_held = len(self.checks) - len(self.failures)
        lines = [f"{self.name}: {n_held} of {len(self.checks)} properties hold"]
        return "\n".join([*lines, *map(str, self.checks)])


def report_of(
    subject: object,
    properties: Properties,
    tolerance: float,
    tolerances: Mapping[str, float] = MappingProxyType({}),
) -> PropertyReport:
    """Return the errors of an object; where it raises an error of the library they are NaN."""
    checks = []
    with np.errstate(all="ignore"):  # what is not finite fails anyway
        for name, measure in properties.items():
            try:
                error = float(measure())
            except RiemhumanError:
                error = np.nan
            checks.append(PropertyCheck(name, error, float(tolerances.get(name, tolerance))))
    return PropertyReport(type(subject).__name__, tuple(checks))


def difference(value: ArrayLike, expected: ArrayLike, size: float | None = None) -> float:
    """Return the largest difference relative to a size; infinite if the shapes differ."""
    if np.shape(value) != np.shape(expected):
        return np.inf
    gap = np.abs(np.subtract(value, expected)).max()
    size = np.abs(expected).max() if size is None else size
    return 0.0 if gap == 0 else float(gap / np.float64(size))


def excess(smaller: ArrayLike, larger: ArrayLike, size: float) -> float:
    """Return by how much an inequality is violated, relative to a size."""
    return difference(np.maximum(np.subtract(smaller, larger), 0.0), np.zeros_like(smaller), size)


def share(wrong: ArrayLike) -> float:
    """Return the share of what is wrong."""
    return float(np.mean(np.asarray(wrong, dtype=float)))
