"""Manifolds and metrics: metric fields, normal fields, products, pull-backs, surfaces."""

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.fields import (
    EbinMetric,
    MetricFields,
    NormalFieldMetric,
    NormalFields,
    RotationFieldMetric,
    RotationFields,
)
from riemhuman.geometry.manifold import Manifold
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.geometry.product import ProductManifold, ProductMetric, PullbackMetric
from riemhuman.geometry.smoothed_metrics import AreaMetric, RotationMetric
from riemhuman.geometry.sobolev_metric import GaugeInvariantMetric, SobolevMetric
from riemhuman.geometry.surface_metric import (
    ElasticMetric,
    GeneralElasticMetric,
    SRNFMetric,
    SurfaceMetric,
)
from riemhuman.geometry.vector_space import FlatMetric, VectorSpace

__all__ = [
    "AlignedSurfaces",
    "AreaMetric",
    "EbinMetric",
    "ElasticMetric",
    "FlatMetric",
    "GaugeInvariantMetric",
    "GeneralElasticMetric",
    "Manifold",
    "MetricFields",
    "NormalFieldMetric",
    "NormalFields",
    "ProductManifold",
    "ProductMetric",
    "PullbackMetric",
    "RiemannianMetric",
    "RotationFieldMetric",
    "RotationFields",
    "RotationMetric",
    "SRNFMetric",
    "SobolevMetric",
    "SurfaceMetric",
    "VectorSpace",
]


def __dir__() -> list[str]:
    return sorted(__all__)
