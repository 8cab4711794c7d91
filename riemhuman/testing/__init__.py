"""Checks that your own metric, manifold, solver or data set has the properties it needs.

In a test, write ``report = check_metric(metric, points)`` and ``assert report.passed, report``.
"""

from riemhuman.testing.datasets import check_dataset
from riemhuman.testing.manifolds import check_manifold
from riemhuman.testing.metrics import check_metric
from riemhuman.testing.reports import PropertyCheck, PropertyReport
from riemhuman.testing.solvers import check_solver

__all__ = [
    "PropertyCheck",
    "PropertyReport",
    "check_dataset",
    "check_manifold",
    "check_metric",
    "check_solver",
]


def __dir__() -> list[str]:
    return sorted(__all__)
