"""What the parts of the library ask of each other, for those who bring a part of their own.

Any object with these methods and attributes will do; nothing need be subclassed. Each protocol says
what a method takes, what it returns, and what it may leave out. `riemhuman.solvers.check_solver`,
`check_metric`, `check_manifold` and `riemhuman.datasets.check_dataset` try an object out.
"""

from riemhuman.protocols.capabilities import (
    MetricOfSlides,
    MetricOfSurfaces,
    MetricWithCompanion,
    MetricWithLowerBound,
    MetricWithMatrix,
    PulledBackMetric,
    SpaceOfFactors,
    SpaceWithFields,
    SurfaceSpace,
)
from riemhuman.protocols.data import Dataset, Descriptor
from riemhuman.protocols.interruption import INTERRUPTED, uninterrupted, was_interrupted
from riemhuman.protocols.solvers import (
    Basis,
    DifferentiableExpSolver,
    ExpSolver,
    FoundMean,
    FoundPath,
    FoundPoint,
    FoundTangentVec,
    GeodesicSolver,
    LogSolver,
    MeanSolver,
    PathEnergy,
    TransportSolver,
)

__all__ = [
    "INTERRUPTED",
    "Basis",
    "Dataset",
    "Descriptor",
    "DifferentiableExpSolver",
    "ExpSolver",
    "FoundMean",
    "FoundPath",
    "FoundPoint",
    "FoundTangentVec",
    "GeodesicSolver",
    "LogSolver",
    "MeanSolver",
    "MetricOfSlides",
    "MetricOfSurfaces",
    "MetricWithCompanion",
    "MetricWithLowerBound",
    "MetricWithMatrix",
    "PathEnergy",
    "PulledBackMetric",
    "SpaceOfFactors",
    "SpaceWithFields",
    "SurfaceSpace",
    "TransportSolver",
    "uninterrupted",
    "was_interrupted",
]
