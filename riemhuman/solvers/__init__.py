"""Strategies: path energies, geodesics between points, Fréchet means of points."""

from riemhuman.solvers.basis_mean import BasisMean
from riemhuman.solvers.basis_path import BasisPath
from riemhuman.solvers.comparison import (
    PathComparison,
    PathMeasures,
    compare_paths,
    measure_path,
)
from riemhuman.solvers.energies import FiniteDifferenceEnergy, SegmentEnergy
from riemhuman.solvers.frechet_mean import FrechetMean, GeometricMedian
from riemhuman.solvers.gradient_descent_mean import GradientDescentMean
from riemhuman.solvers.model_path import ModelParameters, ModelPath
from riemhuman.solvers.path_straightening import PathStraightening
from riemhuman.solvers.poisson_path import PoissonPath
from riemhuman.solvers.results import MeanResult, PathResult
from riemhuman.solvers.simple_paths import ClosedFormGeodesic, LinearPath

__all__ = [
    "BasisMean",
    "BasisPath",
    "ClosedFormGeodesic",
    "FiniteDifferenceEnergy",
    "FrechetMean",
    "GeometricMedian",
    "GradientDescentMean",
    "LinearPath",
    "MeanResult",
    "ModelParameters",
    "ModelPath",
    "PathComparison",
    "PathMeasures",
    "PathResult",
    "PathStraightening",
    "PoissonPath",
    "SegmentEnergy",
    "compare_paths",
    "measure_path",
]
