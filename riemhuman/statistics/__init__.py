"""Statistics of bodies: clusters, tests, fitted metrics, regression on measurements.

Means, principal components and geodesic regression are solvers: `rh.FrechetMean`, `rh.TangentPCA`,
`rh.GeodesicRegression`.
"""

from riemhuman.statistics.clustering import HierarchicalClustering, KMedoids
from riemhuman.statistics.learned_metric import LearnedMetric
from riemhuman.statistics.person_metric import PersonMetric
from riemhuman.statistics.shape_regression import ShapeRegression, regress_shape
from riemhuman.statistics.two_sample_test import TwoSampleResult, two_sample_test

__all__ = [
    "HierarchicalClustering",
    "KMedoids",
    "LearnedMetric",
    "PersonMetric",
    "ShapeRegression",
    "TwoSampleResult",
    "regress_shape",
    "two_sample_test",
]


def __dir__() -> list[str]:
    return sorted(__all__)
