"""Reports on the properties of metrics, manifolds, solvers and data sets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from riemhuman.errors import RiemhumanError
from riemhuman.representation import Record


@dataclass(frozen=True)
class PropertyCheck:
    """The error of an object in one property.

    Attributes
    ----------
    name : str
        Name of the property.
    error : float
        By how much it is violated, relative to the size of the compared values; NaN where the
        object returns NaN.
    tolerance : float
        Largest error that passes.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> report = rh.solvers.check_metric(rh.SRNFMetric(space), bodies.points[:3])
    >>> report.passed
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
    """The properties of an object that were checked; it prints as a table.

    Attributes
    ----------
    name : str
        Class of the object.
    checks : tuple of PropertyCheck
        One for every property.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> print(rh.solvers.check_metric(rh.SRNFMetric(space), bodies.points[:3]).name)
    SRNFMetric
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
        held = len(self.checks) - len(self.failures)
        lines = [f"{self.name}: {held} of {len(self.checks)} properties hold"]
        return "\n".join([*lines, *map(str, self.checks)])


def property_report(
    subject: object,
    properties: Mapping[str, Callable[[], float]],
    tolerances: Mapping[str, float] | float,
) -> PropertyReport:
    """Return the errors of an object in several properties.

    Parameters
    ----------
    subject : object
        The object.
    properties : mapping of str to callable
        Functions that return the errors, by name. One that refuses its arrays, because another
        property fails, has the error NaN.
    tolerances : float, or mapping of str to float
        Largest error that passes, by name.

    Returns
    -------
    PropertyReport
    """
    checks = []
    with np.errstate(all="ignore"):  # what is not finite fails, and says so
        for name, measure in properties.items():
            try:
                error = float(measure())
            except RiemhumanError:
                error = np.nan
            limit = tolerances if isinstance(tolerances, float) else tolerances[name]
            checks.append(PropertyCheck(name, error, float(limit)))
    return PropertyReport(type(subject).__name__, tuple(checks))


def difference(found: Any, expected: Any, size: float) -> float:
    """Return the largest difference relative to a size.

    Parameters
    ----------
    found, expected : array
        Arrays.
    size : float
        Size to compare differences with.

    Returns
    -------
    float
        Infinite if the shapes differ, 0 if the arrays are the same whatever their size.
    """
    if np.shape(found) != np.shape(expected):
        return np.inf
    gap = np.abs(np.subtract(found, expected)).max()
    return 0.0 if gap == 0 else float(gap / np.float64(size))


def excess(smaller: Any, larger: Any, size: float) -> float:
    """Return by how much an inequality is violated, relative to a size.

    Parameters
    ----------
    smaller, larger : array
        The two sides of the inequality.
    size : float
        Size to compare differences with.

    Returns
    -------
    float
    """
    return difference(np.maximum(np.subtract(smaller, larger), 0.0), np.zeros_like(smaller), size)
