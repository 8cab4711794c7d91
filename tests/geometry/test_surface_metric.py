"""The compiled and sparse forms of metrics on surfaces agree with their definitions."""

import numpy as np
import pytest
from cases import TEMPLATES, deformations, open_template, sphere_template, surfaces
from scipy.spatial.transform import Rotation

from riemhuman.errors import OutsideManifoldError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    FlatMetric,
    GeneralElasticMetric,
    ProductMetric,
    SobolevMetric,
    SRNFMetric,
    SurfaceMetric,
)
from riemhuman.geometry.fields import GeneralElasticFieldMetric
from riemhuman.terms import RootNormalTerm

SPACE = AlignedSurfaces(sphere_template(2), equip=False)
METRICS = {
    "shape": ElasticMetric(SPACE, 1.0, 1e-4, 0.0),
    "stretch": ElasticMetric(SPACE, 1.0, 1.0, 0.0),
    "pose": ElasticMetric(SPACE, 0.0, 0.0, 1.0),
    "mixed": ElasticMetric(SPACE, 1.0, 0.1, 0.3),
    "srnf": SRNFMetric(SPACE),
}
each_metric = pytest.mark.parametrize("metric", METRICS.values(), ids=METRICS)


def wavy_path(size, n_times=5):
    """Return a path whose steps are of a given size, so that every branch of the loops runs."""
    return surfaces(SPACE.template, 1, rng=8)[0] + size * deformations(
        SPACE.template, n_times, rng=9
    )


@pytest.mark.parametrize(
    "metric", [*METRICS.values(), SobolevMetric(SPACE, a2=0.1), SobolevMetric(SPACE, a0=0.1)]
)
def test_drift_is_what_the_metric_does_not_see(metric):
    """Translations for most, and rotations where no normals are looked at."""
    path = np.repeat(SPACE.template.vertices[None], 3, axis=0)
    moved, turned = path.copy(), path.copy()
    moved[1] += [0.4, -0.2, 0.1]
    turned[1] = turned[1] @ Rotation.from_rotvec([0.0, 0.3, 0.5]).as_matrix()
    for other in (moved, turned):
        found, blind = metric.remove_drift(other), metric.energy(other) < 1e-12
        np.testing.assert_allclose(found, path if blind else other, atol=1e-3)
        assert (np.abs(found - other).max() > 0.1) == blind
    assert blind == (metric in (METRICS["shape"], METRICS["stretch"]))


@pytest.mark.parametrize(
    ("weights", "unseen"),
    [
        ((0.5, 0.1, 0.3), None),
        ((0.5, 0.1, 0.0), (0.0, 0.0, 1.0)),
        ((0.0, 0.0, 0.3), (1.0, 1.0, 0.0)),
    ],
)
def test_the_part_of_the_family_that_a_metric_lacks(weights, unseen):
    found = ElasticMetric(SPACE, *weights).complementary_metric
    assert (found and (found.a, found.lam, found.c)) == unseen


@pytest.mark.parametrize("name", TEMPLATES)
def test_square_root_normals_by_their_definition(name):
    """d² = Σ ‖√A₁ n₁ − √A₂ n₂‖² with the triangles' own areas: the template does not enter."""
    template = TEMPLATES[name]()
    f1, f2 = surfaces(template, 2)

    def roots(f):
        corners = f[template.faces]
        normals = 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return normals / np.sqrt(np.linalg.norm(normals, axis=1, keepdims=True))

    expected = np.sum((roots(f1) - roots(f2)) ** 2)
    found = SRNFMetric(AlignedSurfaces(template)).squared_dist(f1, f2)
    np.testing.assert_allclose(found, expected, rtol=1e-11)


def test_fields_are_points_of_a_flat_space_unless_there_is_a_weight():
    points = surfaces(SPACE.template, 2)
    for weight, kind in ((1.0, FlatMetric), (2.0, ProductMetric)):
        metric = SurfaceMetric(SPACE, [RootNormalTerm(weight)])
        assert isinstance(metric.target_metric, kind)
        found = metric.target_metric.dist(*metric.map(points))
        np.testing.assert_allclose(found, metric.dist(*points), rtol=1e-12)


# The general first-order elastic metric: equation, relatives, and weights without closed form.

TEMPLATE = open_template()
GENERAL_SPACE = AlignedSurfaces(TEMPLATE)
A, B, C = 0.8, 0.5, 2.0
METRIC = GeneralElasticMetric(GENERAL_SPACE, A, B, C)


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
    ebin = GeneralElasticMetric(GENERAL_SPACE, 2.0, 0.6, 0.0)
    expected = np.sqrt(2.0) * ElasticMetric(GENERAL_SPACE, 1.0, 0.3, 0.0).dist(f1, f2)
    np.testing.assert_allclose(ebin.dist(f1, f2), expected, rtol=1e-13)
    rooted = GeneralElasticMetric(GENERAL_SPACE, 0.0, 1 / 16, 1.0)
    for method in ("dist", "dist_pairwise", "energy_and_gradient"):
        arguments = (f1, f2) if method == "dist" else (np.stack([f1, f2]),)
        found, known = (
            getattr(metric, method)(*arguments) for metric in (rooted, SRNFMetric(GENERAL_SPACE))
        )
        if method == "energy_and_gradient":
            np.testing.assert_allclose(found[1], known[1], atol=1e-12)
            found, known = found[0], known[0]
        np.testing.assert_allclose(found, known, rtol=1e-6)


def test_only_areas_count_without_the_other_weights():
    f1, f2 = surfaces(TEMPLATE, 2, rng=3)
    roots = [np.sqrt(geometry(f)[2]) for f in (f1, f2)]
    found = GeneralElasticMetric(GENERAL_SPACE, 0.0, 0.5, 0.0).squared_dist(f1, f2)
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
