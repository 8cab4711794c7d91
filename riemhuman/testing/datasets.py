"""Checks of a data set: it has what tables, reports and estimators read."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Protocol, cast

import numpy as np

from riemhuman.arrays import Array, PointsOnDemand
from riemhuman.checks.labels import is_missing_label
from riemhuman.surfaces import Template
from riemhuman.testing.reports import Properties, PropertyReport, report_of, share

__all__ = ["check_dataset"]

# Number of surfaces read from a data set, which may be larger than memory.
_N_READ = 8
_NEEDED = ("points", "template", "subject", "pose")


class DataSet(Protocol):
    """What is checked of a data set that lacks nothing."""

    points: PointsOnDemand
    template: Template
    subject: Collection[object] | None
    pose: Collection[object] | None

    def __len__(self) -> int: ...


def check_dataset(dataset: object) -> PropertyReport:
    """Check that a data set has what tables, reports and estimators need.

    It needs a length; ``points``, surfaces of shape (n, V, 3), as an array or an object whose
    slices and items are arrays; ``template``; and the labels ``subject`` and ``pose``, each None or
    of shape (n,) without missing labels. It may also have ``model``, the body model from which the
    surfaces come. `check_dataset` reads a few surfaces. `riemhuman.datasets.Bodies` is such a data
    set.

    Parameters
    ----------
    dataset : object
        The data set.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.testing.check_dataset(bodies).passed
    True
    """

    def lacking() -> float:
        return sum(not hasattr(dataset, name) for name in _NEEDED)

    properties: dict[str, Callable[[], float]] = {
        "it has points, template, subject and pose": lacking
    }
    if not lacking():
        properties |= _Surfaces(cast(DataSet, dataset)).properties()
    return report_of(dataset, properties, 0.0)


@dataclass(frozen=True)
class _Surfaces:
    """The surfaces and labels of a data set."""

    dataset: DataSet

    def properties(self) -> Properties:
        return {
            "it is as long as its points": self.length,
            "surfaces have the template's vertices": self.shapes,
            "vertices are finite": self.finite,
            "slices of points are those points": self.slices,
            "there is a label for every surface": self.labels,
        }

    def sample(self) -> list[Array]:
        last = min(len(self.dataset), len(self.dataset.points)) - 1
        numbers = np.unique(np.linspace(0, last, _N_READ).astype(int))
        return [np.asarray(self.dataset.points[int(number)]) for number in numbers]

    def length(self) -> float:
        return len(self.dataset) != len(self.dataset.points) or len(self.dataset) == 0

    def shapes(self) -> float:
        shape = np.shape(self.dataset.template.vertices)
        return share([surface.shape != shape for surface in self.sample()])

    def finite(self) -> float:
        return share([not np.isfinite(surface).all() for surface in self.sample()])

    def slices(self) -> float:
        points, n = self.dataset.points, min(2, len(self.dataset))
        expected = [np.asarray(points[k]) for k in range(n)]
        return not np.array_equal(np.asarray(points[:2]), np.array(expected))

    def labels(self) -> float:
        is_wrong = [
            not self._are_complete(labels)
            for labels in (self.dataset.subject, self.dataset.pose)
            if labels is not None
        ]
        return share(is_wrong) if is_wrong else 0.0

    def _are_complete(self, labels: Collection[object]) -> bool:
        has_one_axis = getattr(labels, "ndim", 1) == 1
        is_complete = has_one_axis and len(labels) == len(self.dataset)
        return is_complete and not any(map(is_missing_label, labels))
