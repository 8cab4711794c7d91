"""Statistics on manifolds: principal components, regression, clusters, tests, fitted metrics."""

from riemhuman.solvers.geodesic_regression import GeodesicRegression
from riemhuman.solvers.means import FrechetMean, GeometricMedian
from riemhuman.solvers.nearest_surface import NearestSurface, inverted_triangles
from riemhuman.solvers.tangent_pca import TangentPCA
from riemhuman.statistics.clustering import HierarchicalClustering, KMedoids
from riemhuman.statistics.learned_metric import LearnedMetric
from riemhuman.statistics.two_sample_test import TwoSampleResult, two_sample_test

__all__ = [
    "FrechetMean",
    "GeodesicRegression",
    "GeometricMedian",
    "HierarchicalClustering",
    "KMedoids",
    "LearnedMetric",
    "NearestSurface",
    "TangentPCA",
    "TwoSampleResult",
    "inverted_triangles",
    "two_sample_test",
]


def __dir__() -> list[str]:
    return sorted(__all__)
