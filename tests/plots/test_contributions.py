"""What triangles add to a distance."""

import numpy as np
import pytest
from cases import sphere_template, surfaces

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.plots import contributions

SPACE = AlignedSurfaces(sphere_template())


def test_parts_are_the_distances_of_the_two_fields():
    one, other = surfaces(SPACE.template, 2, rng=2)
    metric = ElasticMetric(SPACE, 2.0, 0.5, 3.0)
    parts = contributions(metric, one, other)
    assert parts.metric.shape == parts.normal.shape == (SPACE.template.n_faces,)
    assert parts.total.sum() == pytest.approx(metric.squared_dist(one, other), rel=1e-12)
    ebin = ElasticMetric(SPACE, 2.0, 0.5, 0.0).squared_dist(one, other)
    normals = ElasticMetric(SPACE, 0.0, 0.0, 3.0).squared_dist(one, other)
    np.testing.assert_allclose([parts.metric.sum(), parts.normal.sum()], [ebin, normals])


def test_a_moved_vertex_shows_in_its_triangles_alone():
    one = SPACE.template.vertices
    other = one.copy()
    other[7] *= 1.2
    total = contributions(ElasticMetric(SPACE, 1.0, 1.0, 1.0), one, other).total
    np.testing.assert_array_equal(total > 0, (SPACE.template.faces == 7).any(axis=1))


def test_leading_axes():
    metric = ElasticMetric(SPACE, 1.0, 1.0, 1.0)
    some = surfaces(SPACE.template, 3, rng=3)
    together = contributions(metric, some, some[:1])
    alone = contributions(metric, some[2], some[0])
    np.testing.assert_array_equal(together.total[2], alone.total)
    assert not together.total[0].any()
    normals = contributions(ElasticMetric(SPACE, 0.0, 0.0, 1.0), some, some[:1])
    assert normals.metric.shape == normals.normal.shape == together.metric.shape


def test_bad_surfaces():
    metric = ElasticMetric(SPACE, 0.0, 0.0, 1.0)
    flat = np.zeros(SPACE.shape)
    with pytest.raises(DegenerateSurfaceError):
        contributions(metric, SPACE.template.vertices, flat)
    with pytest.raises(ArgumentError, match="shape"):
        contributions(metric, flat[1:], flat[1:])
