"""Spaces with a metric: how they are equipped and made anew, in geomstats' spelling."""

import pytest
from cases import (
    SPACES,
    HalfPlane,
    HyperbolicDistance,
    HyperbolicInnerProduct,
    sphere_template,
)

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    MetricFields,
    NormalFields,
    RotationFields,
    SRNFMetric,
)
from riemhuman.solvers import LinearPath

pytestmark = pytest.mark.usefixtures("strict_floats")

every_space = pytest.mark.parametrize(
    ("space", "dim", "shape", "metric_class"), SPACES.values(), ids=SPACES
)


@every_space
def test_dimensions_and_default_metric(space, dim, shape, metric_class):
    assert space.dim == dim
    assert space.shape == shape
    assert space.point_ndim == len(shape)
    assert space.default_metric() is metric_class
    assert type(space.metric) is metric_class
    assert space.metric.space is space


def test_equip_with_metric():
    space = AlignedSurfaces(sphere_template())
    assert space.equip_with_metric(ElasticMetric, a=0.0, lam=0.0, c=1.0) is space
    assert (space.metric.a, space.metric.lam, space.metric.c) == (0.0, 0.0, 1.0)
    space.equip_with_metric(SRNFMetric)
    assert isinstance(space.metric, SRNFMetric)
    space.equip_with_metric()
    assert isinstance(space.metric, ElasticMetric)
    assert (space.metric.a, space.metric.lam, space.metric.c) == (1.0, 1e-4, 0.0)
    for cls in (AlignedSurfaces, MetricFields, NormalFields, RotationFields):
        assert hasattr(cls(sphere_template()), "metric")
        assert not hasattr(cls(sphere_template(), equip=False), "metric")
    assert isinstance(space.equip_with_metric(Metric=SRNFMetric).metric, SRNFMetric)


def test_spaces_of_users():
    class Plane(HalfPlane):
        def default_metric(self):
            return HyperbolicDistance

    assert isinstance(Plane().metric, HyperbolicDistance)
    space = HalfPlane()
    assert not hasattr(space, "metric")
    assert space.default_metric() is None
    with pytest.raises(ArgumentTypeError, match="HalfPlane has no default metric"):
        space.equip_with_metric()
    assert isinstance(space.equip_with_metric(HyperbolicDistance).metric, HyperbolicDistance)
    space.equip_with_metric(HyperbolicInnerProduct, geodesic_solver=LinearPath())
    assert space.metric.geodesic_solver == LinearPath()
