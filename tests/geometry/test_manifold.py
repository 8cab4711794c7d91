"""What every space owes, in geomstats' spelling."""

import inspect

import numpy as np
import pytest
from cases import (
    HalfPlane,
    HyperbolicDistance,
    HyperbolicInnerProduct,
    sphere_template,
    triangle_template,
)

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import (
    AlignedSurfaces,
    EbinMetric,
    ElasticMetric,
    FlatMetric,
    Manifold,
    MetricFields,
    NormalFieldMetric,
    NormalFields,
    ProductManifold,
    ProductMetric,
    RotationFields,
    SRNFMetric,
    VectorSpace,
)
from riemhuman.solvers import LinearPath

ONE = triangle_template()
SPACES = {
    "metric fields": (MetricFields(sphere_template()), 240, (80, 2, 2), EbinMetric),
    "normal fields": (NormalFields(sphere_template()), 160, (80, 3), NormalFieldMetric),
    "vectors": (VectorSpace((80, 3)), 240, (80, 3), FlatMetric),
    "surfaces": (AlignedSurfaces(sphere_template()), 126, (42, 3), ElasticMetric),
    "product": (ProductManifold([MetricFields(ONE), NormalFields(ONE)]), 5, (7,), ProductMetric),
}
every_space = pytest.mark.parametrize(
    ("space", "dim", "shape", "metric_class"), SPACES.values(), ids=SPACES
)


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@every_space
def test_dimensions_and_default_metric(space, dim, shape, metric_class):
    assert space.dim == dim
    assert space.shape == shape
    assert space.point_ndim == len(shape)
    assert space.default_metric() is metric_class
    assert type(space.metric) is metric_class
    assert space.metric.space is space


@every_space
def test_the_base_point_is_needed_where_tangent_spaces_differ(space, dim, shape, metric_class):
    vector = space.random_tangent_vec(space.random_point(rng=1), rng=2)
    if metric_class in (NormalFieldMetric, ProductMetric):
        for call in (space.to_tangent, space.is_tangent):
            with pytest.raises(ArgumentTypeError, match="of NormalFields depend on it"):
                call(vector)
        with pytest.raises(ArgumentTypeError, match="of NormalFields depend on it"):
            space.random_tangent_vec()
        return
    np.testing.assert_array_equal(space.to_tangent(vector), vector)
    assert space.is_tangent(vector)
    assert space.random_tangent_vec(n_samples=3, rng=2).shape == (3, *shape)


@every_space
def test_random_points_spread_as_far_as_asked(space, dim, shape, metric_class):
    near, far = (space.random_point(20, bound, rng=3) for bound in (1e-3, 1.0))
    np.testing.assert_array_equal(space.random_point(rng=4), space.random_point(1, 1.0, rng=4))
    ratio = np.ptp(near, axis=0).max() / np.ptp(far, axis=0).max()
    if metric_class is NormalFieldMetric:
        assert ratio == 1.0
        return
    assert ratio < 1.0
    with pytest.raises(ArgumentError, match="bound must be a finite number of at least 0"):
        space.random_point(bound=-1.0)


@every_space
def test_bad_input(space, dim, shape, metric_class):
    point = space.random_point(rng=0)
    with pytest.raises(ArgumentError, match="point must have shape"):
        space.check_point(point[..., :-1])
    for call in (space.belongs, space.check_point):
        with pytest.raises(ArgumentTypeError, match="point must be an array of real numbers"):
            call(point.astype(complex))
    with pytest.raises(ArgumentError, match="base_point must have shape"):
        space.is_tangent(point, point[..., :-1])
    for method in (space.random_point, lambda n: space.random_tangent_vec(point, n, rng=0)):
        with pytest.raises(ArgumentError, match="n_samples must be a whole number of at least 1"):
            method(0)
        with pytest.raises(ArgumentTypeError, match="n_samples must be a whole number"):
            method(1.5)
    with pytest.raises(ArgumentError, match="rng must be a whole number of at least 0"):
        space.random_point(rng=-1)
    with pytest.raises(ArgumentTypeError, match="rng must be a whole number"):
        space.random_point(rng="any")


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
    with pytest.raises(ArgumentTypeError, match="Metric must be a metric class"):
        space.equip_with_metric(space.metric)
    assert isinstance(space.equip_with_metric(Metric=SRNFMetric).metric, SRNFMetric)


@every_space
def test_new_manifolds_have_the_same_parameters(space, dim, shape, metric_class):
    fresh = space.new()
    assert type(fresh.metric) is metric_class
    assert fresh.metric.space is fresh
    assert (fresh.dim, fresh.shape) == (dim, shape)
    assert not hasattr(space.new(equip=False), "metric")
    assert space.metric.space is space


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


@pytest.mark.parametrize("name", ["belongs", "to_tangent", "random_point", "check_point"])
def test_optional_arguments_are_those_of_every_manifold(name):
    for space, *_ in SPACES.values():
        found = inspect.signature(getattr(type(space), name)).parameters
        for argument, declared in inspect.signature(getattr(Manifold, name)).parameters.items():
            assert found[argument].default == declared.default


@every_space
def test_tangent_to_a_tolerance(space, dim, shape, metric_class):
    point = space.random_point(rng=8)
    rng = np.random.default_rng(9)
    vector = space.to_tangent(rng.standard_normal(shape), point)
    normal = rng.standard_normal(shape)
    normal = normal - space.to_tangent(normal, point)
    size = np.abs(normal).max()
    if size < 1e-12:
        # Every array is tangent.
        assert space.is_tangent(vector, point, atol=0.0)
        return
    off = vector + 1e-5 * normal / size
    assert not space.is_tangent(off, point)
    assert not space.is_tangent(off, point, atol=0.9e-5)
    assert space.is_tangent(off, point, atol=1.1e-5)
    assert space.is_tangent(vector + 0.9e-9 * normal / size, point)
    assert not space.is_tangent(vector + 1.1e-9 * normal / size, point)
