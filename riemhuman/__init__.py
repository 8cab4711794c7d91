"""Riemannian shape analysis of human bodies.

A body registered to a template mesh T is a map f: T → R³. The library sends it to its metric
field and its normal field, Φ(f) = (g, n), measures distances there in closed form, and finds
geodesics and means under the metrics pulled back by Φ, after Pierson, Daoudi and Tumpach, "A
Riemannian Framework for Analysis of Human Body Surface", WACV 2022.

Examples in docstrings assume ``import numpy as np`` and ``import riemhuman as rh``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from riemhuman.provided import default_solvers, notebook_pictures

if TYPE_CHECKING:
    from riemhuman.provided import DefaultSolvers, NotebookPictures

__version__ = "0.1.0"

_MODULE_OF_NAME = {
    "AlignedSurfaces": "geometry.aligned_surfaces",
    "AreaMetric": "geometry.smoothed_metrics",
    "ElasticMetric": "geometry.surface_metric",
    "GeneralElasticMetric": "geometry.surface_metric",
    "GaugeInvariantMetric": "geometry.sobolev_metric",
    "SobolevMetric": "geometry.sobolev_metric",
    "EbinMetric": "geometry.fields",
    "MetricFields": "geometry.fields",
    "NormalFieldMetric": "geometry.fields",
    "NormalFields": "geometry.fields",
    "Manifold": "geometry.manifold",
    "RiemannianMetric": "geometry.metric",
    "ProductManifold": "geometry.product",
    "ProductMetric": "geometry.product",
    "PullbackMetric": "geometry.product",
    "RotationFieldMetric": "geometry.fields",
    "RotationFields": "geometry.fields",
    "RotationMetric": "geometry.smoothed_metrics",
    "FlatMetric": "geometry.vector_space",
    "SRNFMetric": "geometry.surface_metric",
    "SurfaceMetric": "geometry.surface_metric",
    "VectorSpace": "geometry.vector_space",
    "DeformationBasis": "surfaces.deformation_basis",
    "Template": "surfaces.template",
    "load_mesh": "io.meshes",
    "save_glb": "io",
    "save_mesh": "io.meshes",
    "view": "plots.views",
    "generalized_procrustes": "surfaces.procrustes",
    "procrustes": "surfaces.procrustes",
    "BodyModel": "bodies.body_model",
    "NearestNeighbors": "retrieval.neighbors",
    "pairwise_job": "retrieval.jobs",
    "path_job": "retrieval.jobs",
    "FrechetMean": "solvers.means",
    "GeometricMedian": "solvers.means",
    "GeodesicRegression": "solvers.geodesic_regression",
    "LearnedMetric": "statistics.learned_metric",
    "TangentPCA": "solvers.tangent_pca",
    "ConvergenceWarning": "errors",
    "MixedPosesWarning": "errors",
    "PrecisionWarning": "errors",
    "RiemhumanError": "errors",
    "SeamWarning": "errors",
}
_SUBPACKAGES = (
    "bodies",
    "datasets",
    "descriptors",
    "errors",
    "extensions",
    "geometry",
    "io",
    "kernels",
    "learned",
    "measurements",
    "motions",
    "plots",
    "registration",
    "report",
    "retrieval",
    "solvers",
    "statistics",
    "surfaces",
    "terms",
    "testing",
)

__all__ = [*_MODULE_OF_NAME, *_SUBPACKAGES]


def _load_default_solvers() -> DefaultSolvers:
    module: Any = importlib.import_module(f"{__name__}.solvers.defaults")
    solvers: DefaultSolvers = module
    return solvers


def _load_plots() -> NotebookPictures:
    module: Any = importlib.import_module(f"{__name__}.plots")
    pictures: NotebookPictures = module
    return pictures


default_solvers.load_by(_load_default_solvers)
notebook_pictures.load_by(_load_plots)


def __getattr__(name: str) -> Any:
    if name in _MODULE_OF_NAME:
        return getattr(importlib.import_module(f"{__name__}.{_MODULE_OF_NAME[name]}"), name)
    if name in _SUBPACKAGES:
        return importlib.import_module(f"{__name__}.{name}")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
