"""Riemannian shape analysis of human bodies.

A body registered to a template mesh T is a map f: T → R³. It is represented by its first
fundamental form g and its unit normals n, Φ(f) = (g, n). Distances of these fields have a closed
form; geodesics and means are found under the metrics pulled back by Φ. See Pierson, Daoudi and
Tumpach, "A Riemannian Framework for Analysis of Human Body Surface", WACV 2022.

Examples in docstrings assume ``import numpy as np`` and ``import riemhuman as rh``.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import TYPE_CHECKING

from riemhuman.provided import default_solvers, notebook_pictures, topologies as later_topologies

if TYPE_CHECKING:  # the public names, for type checkers and editors; nothing is loaded
    from riemhuman import (
        bodies as bodies,
        datasets as datasets,
        descriptors as descriptors,
        errors as errors,
        extensions as extensions,
        geometry as geometry,
        io as io,
        kernels as kernels,
        learned as learned,
        measurements as measurements,
        motions as motions,
        plots as plots,
        registration as registration,
        report as report,
        retrieval as retrieval,
        solvers as solvers,
        statistics as statistics,
        surfaces as surfaces,
        terms as terms,
        testing as testing,
        topologies as topologies,
    )
    from riemhuman.bodies.body_model import BodyModel as BodyModel
    from riemhuman.errors import (
        ConvergenceWarning as ConvergenceWarning,
        MixedPosesWarning as MixedPosesWarning,
        PrecisionWarning as PrecisionWarning,
        RiemhumanError as RiemhumanError,
        SeamWarning as SeamWarning,
    )
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces as AlignedSurfaces
    from riemhuman.geometry.fields import (
        EbinMetric as EbinMetric,
        MetricFields as MetricFields,
        NormalFieldMetric as NormalFieldMetric,
        NormalFields as NormalFields,
        RotationFieldMetric as RotationFieldMetric,
        RotationFields as RotationFields,
    )
    from riemhuman.geometry.manifold import Manifold as Manifold
    from riemhuman.geometry.metric import RiemannianMetric as RiemannianMetric
    from riemhuman.geometry.product import (
        ProductManifold as ProductManifold,
        ProductMetric as ProductMetric,
        PullbackMetric as PullbackMetric,
    )
    from riemhuman.geometry.smoothed_metrics import (
        AreaMetric as AreaMetric,
        RotationMetric as RotationMetric,
    )
    from riemhuman.geometry.strategies import DefaultSolvers
    from riemhuman.geometry.sobolev_metric import (
        GaugeInvariantMetric as GaugeInvariantMetric,
        SobolevMetric as SobolevMetric,
    )
    from riemhuman.geometry.surface_metric import (
        ElasticMetric as ElasticMetric,
        GeneralElasticMetric as GeneralElasticMetric,
        SRNFMetric as SRNFMetric,
        SurfaceMetric as SurfaceMetric,
    )
    from riemhuman.geometry.vector_space import (
        FlatMetric as FlatMetric,
        VectorSpace as VectorSpace,
    )
    from riemhuman.io import save_glb as save_glb
    from riemhuman.io.meshes import load_mesh as load_mesh, save_mesh as save_mesh
    from riemhuman.plots.views import view as view
    from riemhuman.retrieval.jobs import pairwise_job as pairwise_job, path_job as path_job
    from riemhuman.retrieval.neighbors import NearestNeighbors as NearestNeighbors
    from riemhuman.solvers.geodesic_regression import GeodesicRegression as GeodesicRegression
    from riemhuman.solvers.means import (
        FrechetMean as FrechetMean,
        GeometricMedian as GeometricMedian,
    )
    from riemhuman.solvers.tangent_pca import TangentPCA as TangentPCA
    from riemhuman.statistics.learned_metric import LearnedMetric as LearnedMetric
    from riemhuman.statistics.person_metric import PersonMetric as PersonMetric
    from riemhuman.surfaces.deformation_basis import DeformationBasis as DeformationBasis
    from riemhuman.surfaces.procrustes import (
        generalized_procrustes as generalized_procrustes,
        procrustes as procrustes,
    )
    from riemhuman.surfaces.template import Template as Template
    from riemhuman.provided import NotebookPictures

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
    "PersonMetric": "statistics.person_metric",
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
    "topologies",
)

__all__ = [*_MODULE_OF_NAME, *_SUBPACKAGES]


def _load_default_solvers() -> DefaultSolvers:
    from riemhuman.solvers import defaults

    return defaults


def _load_plots() -> NotebookPictures:
    from riemhuman import plots

    return plots


def _load_topologies() -> ModuleType:
    return importlib.import_module("riemhuman.topologies")


default_solvers.load_by(_load_default_solvers)
notebook_pictures.load_by(_load_plots)
later_topologies.load_by(_load_topologies)


if not TYPE_CHECKING:  # otherwise, type checkers would accept any name

    def __getattr__(name: str) -> object:
        if name in _MODULE_OF_NAME:
            return getattr(importlib.import_module(f"{__name__}.{_MODULE_OF_NAME[name]}"), name)
        if name in _SUBPACKAGES:
            return importlib.import_module(f"{__name__}.{name}")
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
