"""Square root normal fields."""

import numpy as np
import pytest
from autograd import grad
from cases import TEMPLATES, surfaces

from riemhuman.geometry import AlignedSurfaces, FlatMetric, ProductMetric, SRNFMetric, SurfaceMetric
from riemhuman.terms import RootNormalTerm


@pytest.mark.parametrize("name", TEMPLATES)
def test_against_the_definition(name):
    """d² = Σ ‖√A₁ n₁ − √A₂ n₂‖² with the triangles' own areas: the template does not enter."""
    template = TEMPLATES[name]()
    f1, f2 = surfaces(template, 2)

    def roots(f):
        corners = f[template.faces]
        normals = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return normals / np.sqrt(np.linalg.norm(normals, axis=1, keepdims=True))

    metric = SRNFMetric(AlignedSurfaces(template))
    expected = np.sum((roots(f1) - roots(f2)) ** 2)
    np.testing.assert_allclose(metric.squared_dist(f1, f2), expected, rtol=1e-11)


def test_fields_are_points_of_a_flat_space_unless_there_is_a_weight():
    space = AlignedSurfaces(TEMPLATES["sphere"]())
    points = surfaces(space.template, 2)
    assert isinstance(SRNFMetric(space).target_metric, FlatMetric)
    weighted = SurfaceMetric(space, [RootNormalTerm(2.0)])
    assert isinstance(weighted.target_metric, ProductMetric)
    for metric in (SRNFMetric(space), weighted):
        found = metric.target_metric.dist(*metric.map(points))
        np.testing.assert_allclose(found, metric.dist(*points), rtol=1e-12)


def test_scaling():
    """Distances scale with lengths, as q does."""
    template = TEMPLATES["sphere"]()
    f1, f2 = surfaces(template, 2)
    metric = SRNFMetric(AlignedSurfaces(template))
    np.testing.assert_allclose(metric.dist(3 * f1, 3 * f2), 3 * metric.dist(f1, f2), rtol=1e-12)


def test_degenerate_triangles_are_legal():
    template = TEMPLATES["sphere"]()
    metric = SRNFMetric(AlignedSurfaces(template))
    f, g = surfaces(template, 2)
    flat = f.copy()
    flat[template.faces[7, 1]] = flat[template.faces[7, 0]]
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(metric.dist(flat, g))
        assert metric.dist(flat, flat) == 0
        for argument in (0, 1):
            assert np.all(np.isfinite(grad(metric.squared_dist, argument)(flat, g)))
            assert np.all(np.isfinite(grad(metric.dist, argument)(flat, flat)))
