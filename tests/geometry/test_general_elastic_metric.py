"""The general first-order elastic metric: equation, relatives, and weights without closed form."""

import numpy as np
import pytest
from cases import deformations, open_template, surfaces

from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, GeneralElasticMetric, SRNFMetric
from riemhuman.geometry.fields import GeneralElasticFieldMetric

TEMPLATE = open_template()
SPACE = AlignedSurfaces(TEMPLATE)
A, B, C = 0.8, 0.5, 2.0
METRIC = GeneralElasticMetric(SPACE, A, B, C)


def geometry(f):
    """Return first fundamental forms in corner frames, unit normals and areas, from corners."""
    corners = f[TEMPLATE.faces]
    sides = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=1)
    across = np.cross(sides[:, 0], sides[:, 1])
    sizes = np.linalg.norm(across, axis=1)
    return sides @ np.swapaxes(sides, 1, 2), across / sizes[:, None], 0.5 * sizes


def test_the_integral_of_the_definition():
    f, h = surfaces(TEMPLATE, 1, rng=1)[0], deformations(TEMPLATE, 1, rng=2)[0]
    step = 1e-6
    (g1, n1, _), (g2, n2, _), (g, _, areas) = (geometry(f + t * h) for t in (-step, step, 0.0))
    change = np.linalg.solve(g, (g2 - g1) / (2 * step))
    trace = np.trace(change, axis1=1, axis2=2)
    shear = change - 0.5 * trace[:, None, None] * np.eye(2)
    turn = np.sum(((n2 - n1) / (2 * step)) ** 2, axis=1)
    squares = np.trace(shear @ shear, axis1=1, axis2=2)
    expected = np.sum(areas * (A * squares + B * trace**2 + C * turn))
    np.testing.assert_allclose(METRIC.squared_norm(h, f), expected, rtol=1e-7)
    flat = h.ravel()
    np.testing.assert_allclose(flat @ (METRIC.metric_matrix(f) @ flat), expected, rtol=1e-7)


def test_limits_are_known_metrics():
    f1, f2 = surfaces(TEMPLATE, 2, rng=3)
    ebin = GeneralElasticMetric(SPACE, 2.0, 0.6, 0.0)
    expected = np.sqrt(2.0) * ElasticMetric(SPACE, 1.0, 0.3, 0.0).dist(f1, f2)
    np.testing.assert_allclose(ebin.dist(f1, f2), expected, rtol=1e-13)
    rooted = GeneralElasticMetric(SPACE, 0.0, 1 / 16, 1.0)
    for method in ("dist", "dist_pairwise", "energy_and_gradient"):
        arguments = (f1, f2) if method == "dist" else (np.stack([f1, f2]),)
        found, known = (
            getattr(metric, method)(*arguments) for metric in (rooted, SRNFMetric(SPACE))
        )
        if method == "energy_and_gradient":
            np.testing.assert_allclose(found[1], known[1], atol=1e-12)
            found, known = found[0], known[0]
        np.testing.assert_allclose(found, known, rtol=1e-6)


@pytest.mark.parametrize("weights", [(-1.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, np.nan)])
def test_weights_out_of_range_are_refused_by_name(weights):
    with pytest.raises(ArgumentError, match="^[abc] must be a finite number"):
        GeneralElasticMetric(SPACE, *weights)


def test_only_areas_count_without_the_other_weights():
    f1, f2 = surfaces(TEMPLATE, 2, rng=3)
    roots = [np.sqrt(geometry(f)[2]) for f in (f1, f2)]
    found = GeneralElasticMetric(SPACE, 0.0, 0.5, 0.0).squared_dist(f1, f2)
    np.testing.assert_allclose(found, 8.0 * np.sum((roots[0] - roots[1]) ** 2), rtol=1e-10)


def test_no_geodesic_to_antipodal_normals_unless_through_the_apex():
    fields = METRIC.target_metric.space.factors[0].metric
    space = fields.space
    g, n = space.project_from_product(METRIC.map(surfaces(TEMPLATE, 1, rng=3)[0]))
    start, end = space.embed_to_product([g, n]), space.embed_to_product([g, -n])
    with pytest.raises(OutsideManifoldError, match="antipodal"):
        fields.geodesic(start, end)
    steep = GeneralElasticFieldMetric(space, A, B, 17.0 * B)
    path = steep.geodesic(start, end)(np.linspace(0, 1, 3))
    np.testing.assert_allclose(path[[0, 2]], [start, end], atol=1e-12)
    middle, _ = space.project_from_product(path[1])
    np.testing.assert_allclose(middle, 0.0, atol=1e-12)
