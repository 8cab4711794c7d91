"""Solvers: path energies, geodesics, exponentials, logarithms, transport, Fréchet means.

A solver that has not converged issues a `ConvergenceWarning`; its result says why. If a search is
stopped from the keyboard, it raises `Interrupted`, which carries the best result so far.
"""

from riemhuman.solvers.exponential import DiscreteExponential, ExponentialResult
from riemhuman.solvers.geodesic_regression import GeodesicRegression
from riemhuman.solvers.interpolated_paths import ModelParameters, ModelPath, PoissonPath
from riemhuman.solvers.logarithm import DiscreteLogarithm, LogarithmResult
from riemhuman.solvers.means import BasisMean, FrechetMean, GeometricMedian, GradientDescentMean
from riemhuman.solvers.nearest_surface import NearestSurface, inverted_triangles
from riemhuman.solvers.parallel_transport import PoleLadder, TransportResult
from riemhuman.solvers.path_comparison import (
    PathComparison,
    PathDistances,
    compare_metrics,
    compare_paths,
    path_distances,
)
from riemhuman.solvers.path_search import BasisPath, PathStraightening
from riemhuman.solvers.paths import (
    ClosedFormGeodesic,
    FiniteDifferenceEnergy,
    LinearPath,
    SegmentEnergy,
)
from riemhuman.solvers.results import (
    Interrupted,
    MeanResult,
    PathResult,
    Result,
    Status,
)
from riemhuman.solvers.tangent_pca import TangentPCA
from riemhuman.solvers.transfer import (
    Disentangling,
    DisentanglingResult,
    MotionTransfer,
    ShapeTransfer,
)

__all__ = [
    "BasisMean",
    "BasisPath",
    "ClosedFormGeodesic",
    "DiscreteExponential",
    "DiscreteLogarithm",
    "Disentangling",
    "DisentanglingResult",
    "ExponentialResult",
    "FiniteDifferenceEnergy",
    "FrechetMean",
    "GeodesicRegression",
    "GeometricMedian",
    "GradientDescentMean",
    "Interrupted",
    "LinearPath",
    "LogarithmResult",
    "MeanResult",
    "ModelParameters",
    "ModelPath",
    "MotionTransfer",
    "NearestSurface",
    "PathComparison",
    "PathDistances",
    "PathResult",
    "PathStraightening",
    "PoissonPath",
    "PoleLadder",
    "Result",
    "SegmentEnergy",
    "ShapeTransfer",
    "Status",
    "TangentPCA",
    "TransportResult",
    "compare_metrics",
    "compare_paths",
    "inverted_triangles",
    "path_distances",
]


def __dir__() -> list[str]:
    return sorted(__all__)
