"""Points and tangent vectors of every space: which arrays they are, and how they are drawn."""

import numpy as np
import pytest
from cases import CASES, SPACES

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import NormalFieldMetric, ProductMetric

pytestmark = pytest.mark.usefixtures("strict_floats")

every_space = pytest.mark.parametrize(
    ("space", "dim", "shape", "metric_class"), SPACES.values(), ids=SPACES
)


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


def test_one_triangle_has_no_rows():
    """Three numbers may be a field of one normal, or a point that lacks an axis."""
    case = CASES["normals triangle"]
    with pytest.raises(ArgumentError, match=r"must have shape \(\.\.\., 1, 3\)"):
        case.space.check_point(case.points[:, 0])
