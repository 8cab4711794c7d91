"""Checks of the properties that tables, reports and estimators require of data sets."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from riemhuman.protocols import Dataset
from riemhuman.solvers.property_checks import PropertyReport, property_report

# Number of surfaces that are read, because data sets may be larger than memory.
_N_READ = 8


def check_dataset(dataset: Dataset) -> PropertyReport:
    """Check a data set against `riemhuman.protocols.Dataset`.

    A few surfaces are read, one by one and as a slice: they must have as many vertices as the
    template, with finite coordinates. Labels, if there are any, must be one per surface.

    To use it in a test, write ``report = check_dataset(dataset)`` and
    ``assert report.passed, report``.

    Parameters
    ----------
    dataset : Dataset
        The data set.

    Returns
    -------
    PropertyReport
        Errors are shares of wrong surfaces or kinds of labels.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> report = rh.datasets.check_dataset(bodies)
    >>> report.passed
    True
    """
    needed = ("points", "template", "subject", "pose")
    lacking = [name for name in needed if not hasattr(dataset, name)]
    properties: dict[str, Callable[[], float]] = {
        "it has points, template, subject and pose": lambda: float(len(lacking))
    }
    if not lacking:
        properties |= {name: partial(error, dataset) for name, error in _ALL.items()}
    return property_report(dataset, properties, 0.0)


def _shape(dataset: Dataset) -> tuple[int, int]:
    return np.shape(dataset.template.vertices)


def _read(dataset: Dataset) -> list[np.ndarray]:
    last = min(len(dataset), len(dataset.points)) - 1
    numbers = np.unique(np.linspace(0, last, _N_READ).astype(int))
    return [np.asarray(dataset.points[int(number)]) for number in numbers]


def _length(dataset: Dataset) -> float:
    return float(len(dataset) != len(dataset.points) or len(dataset) == 0)


def _vertices(dataset: Dataset) -> float:
    return float(np.mean([surface.shape != _shape(dataset) for surface in _read(dataset)]))


def _finite(dataset: Dataset) -> float:
    return float(np.mean([not np.isfinite(surface).all() for surface in _read(dataset)]))


def _slices(dataset: Dataset) -> float:
    some = np.asarray(dataset.points[:2])
    expected = [np.asarray(dataset.points[k]) for k in range(min(2, len(dataset)))]
    return float(not np.array_equal(some, np.array(expected)))


def _labels(dataset: Dataset) -> float:
    kinds = [labels for labels in (dataset.subject, dataset.pose) if labels is not None]
    return float(np.mean([np.shape(labels) != (len(dataset),) for labels in kinds] or [False]))


_ALL: dict[str, Callable[[Dataset], float]] = {
    "it is as long as its points": _length,
    "surfaces have the template's vertices": _vertices,
    "vertices are finite": _finite,
    "slices of points are those points": _slices,
    "there is a label for every surface": _labels,
}
