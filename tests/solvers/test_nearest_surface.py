"""From fields back to surfaces: what came from a surface returns, and means have no slope."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import value_and_grad
from cases import open_template, sphere_template, surfaces
from open_bodies import coarse_bodies
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, ConvergenceWarning, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SRNFMetric
from riemhuman.solvers import BasisMean, NearestSurface, inverted_triangles
from riemhuman.solvers._dispersion import Dispersion
from riemhuman.solvers.nearest_surface import image_distances
from riemhuman.surfaces import DeformationBasis

SPACE = AlignedSurfaces(sphere_template(), equip=False)
POINTS = surfaces(sphere_template(), 5, rng=3)


def metric_of(a, lam, c):
    return ElasticMetric(SPACE, a, lam, c)


def test_fields_of_a_surface_give_the_surface():
    metric = metric_of(1.0, 0.5, 0.3)
    found = NearestSurface(tolerance=1e-14).solve(metric, metric.map(POINTS[:1]), POINTS[1])
    assert found.converged
    assert found.variance < 1e-12 * metric.squared_dist(POINTS[0], POINTS[1])
    shift = (POINTS[0] - found.point).mean(axis=0)
    np.testing.assert_allclose(found.point + shift, POINTS[0], atol=1e-5)


@pytest.mark.parametrize("abc", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_surface_among_its_own_fields_stays(abc):
    """Seen to stall among rounding errors."""
    metric = metric_of(*abc)
    for start in (POINTS[0], POINTS[0] * (1.0 + 1e-15), POINTS[0] + 1e-9 * POINTS[1]):
        found = NearestSurface().solve(metric, metric.map(POINTS[[0, 0, 0]]), start)
        assert found.converged
        assert found.variance < 1e-15
        np.testing.assert_allclose(found.point, POINTS[0], atol=1e-8)


def test_mean_has_no_slope_and_agrees_with_the_mean_over_all_deformations():
    metric = metric_of(1.0, 1.0, 1.0)
    found = NearestSurface(tolerance=1e-13).solve(metric, metric.map(POINTS), POINTS[0])
    dispersion = Dispersion(metric, POINTS)
    assert found.variance == pytest.approx(dispersion.value(found.point), rel=1e-12)
    assert np.all(np.diff(found.variances) < 0)
    _, slope = dispersion.value_and_gradient(found.point)
    _, at_start = dispersion.value_and_gradient(POINTS[0])
    assert np.abs(slope).max() < 1e-5 * np.abs(at_start).max()

    everything = DeformationBasis(np.eye(POINTS[0].size).reshape(-1, *POINTS[0].shape))
    over_basis = BasisMean(everything, with_differences=False, tolerance=1e-12)
    assert found.variance == pytest.approx(over_basis.solve(metric, POINTS).variance, rel=1e-6)


@pytest.mark.parametrize("abc", [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0)])
def test_companion_keeps_what_the_metric_does_not_see(abc):
    metric = metric_of(*abc)
    unseen = metric_of(1.0 - abc[0], 1.0, 1.0 - abc[2])
    target = metric.map(POINTS[:1])
    found = NearestSurface(tolerance=1e-10).solve(metric, target, POINTS[1])
    before = metric.squared_dist(POINTS[0], POINTS[1])
    assert found.variance < 0.05 * before
    assert unseen.squared_dist(found.point, POINTS[1]) < unseen.squared_dist(POINTS[0], POINTS[1])
    heavy = NearestSurface(companion_weight=10.0)
    held = heavy.solve(metric, target, POINTS[1])
    assert unseen.squared_dist(held.point, POINTS[1]) < unseen.squared_dist(found.point, POINTS[1])
    assert held.variance > found.variance


def test_other_metrics_on_surfaces():
    metric = SRNFMetric(SPACE)
    found = NearestSurface().solve(metric, metric.map(POINTS[:1]), POINTS[1])
    assert found.variance < 1e-3 * metric.squared_dist(POINTS[0], POINTS[1])
    alone = NearestSurface(companion_weight=0.0).solve(
        metric_of(0.0, 0.0, 1.0), metric_of(0.0, 0.0, 1.0).map(POINTS[:1]), POINTS[1]
    )
    assert alone.variance < 1e-3 * metric_of(0.0, 0.0, 1.0).squared_dist(POINTS[0], POINTS[1])


def test_refusals():
    metric = metric_of(1.0, 1.0, 1.0)
    images = metric.map(POINTS)
    with pytest.warns(ConvergenceWarning, match="NearestSurface.*maximum number of iterations"):
        NearestSurface(max_iter=1).solve(metric, images, POINTS[0])
    with pytest.raises(ArgumentError, match="images"):
        NearestSurface().solve(metric, images[:, :-1], POINTS[0])
    with pytest.raises(ArgumentError, match="images must hold at least one target"):
        NearestSurface().solve(metric, images[:0], POINTS[0])


# Distances from fields that come from no surface.


@pytest.mark.parametrize("abc", [(1.0, 0.5, 0.3), (2.0, 1.0, 0.0), (0.0, 0.0, 1.0), None])
def test_values_and_slopes_are_those_of_the_definition(abc):
    metric = SRNFMetric(SPACE) if abc is None else ElasticMetric(SPACE, *abc)
    target = metric.target_metric
    images = target.space.projection(1.1 * metric.map(POINTS[1:4]))

    def mean(surface):
        return anp.mean(target.squared_dist(metric.map(surface), images))

    value, slope = image_distances(metric, images).value_and_gradient(POINTS[0])
    expected, expected_slope = value_and_grad(mean)(POINTS[0])
    assert value == pytest.approx(expected, rel=1e-11)
    np.testing.assert_allclose(slope, expected_slope, atol=1e-10 * np.abs(expected_slope).max())


def test_fields_between_poses_lead_near_their_surface():
    """To 0.3 to 0.7 % of the value; to 1.0 to 2.3 % where errors of large triangles counted more
    and no round was extrapolated."""
    bodies = coarse_bodies()
    metric = ElasticMetric(AlignedSurfaces(bodies.template, equip=False), 1.0, 1.0, 1.0)
    target, standing = metric.target_metric, metric.map(bodies.points[0])
    for pose in (1, 2, 6):
        way = target.log(metric.map(bodies.points[pose]), standing)
        image = target.exp(0.8 * way, standing)[None]
        distances = image_distances(metric, image)
        before = distances.value_and_gradient(bodies.points[0])[0]
        near = distances.nearby(bodies.points[0])
        assert distances.value_and_gradient(near)[0] < 0.008 * before


# Triangles that are turned over are found, and no others.

FINE = sphere_template(2)
VERTICES, FACES = FINE.vertices, FINE.faces


def test_smooth_deformations_invert_nothing():
    bent = VERTICES + 0.2 * np.sin(2.0 * VERTICES[:, ::-1])
    stretched = VERTICES * [0.1, 3.0, 1.0]
    turned = VERTICES @ Rotation.from_euler("xyz", [170.0, 80.0, 10.0], degrees=True).as_matrix()
    found = inverted_triangles(np.stack([VERTICES, bent, stretched, turned]), VERTICES, FACES)
    assert found.shape == (4, len(FACES))
    assert not found.any()


def test_the_unit_of_length_does_not_matter():
    rough = VERTICES + 0.12 * np.random.default_rng(0).standard_normal(VERTICES.shape)
    found = inverted_triangles(rough, VERTICES, FACES)
    assert 0 < found.sum() < 0.3 * len(FACES)
    np.testing.assert_array_equal(inverted_triangles(1024.0 * rough, VERTICES, FACES), found)


def test_mirrored_triangles_agree_with_their_neighbourhood_or_not():
    # In a plane, orientation is the sign of the area.
    flat = open_template()
    folded = flat.vertices.copy()
    middle = 7
    folded[middle] = folded[middle] + 1.6 * (folded[middle + 1] - folded[middle])

    def signs(points):
        one, two, three = (points[corner] for corner in flat.faces.T)
        return np.sign(np.cross(two - one, three - one)[:, 2])

    expected = signs(folded) != signs(flat.vertices)
    assert expected.any()
    assert np.all(np.any(flat.faces[expected] == middle, axis=1))
    found = inverted_triangles(folded, flat.vertices, flat.faces)
    np.testing.assert_array_equal(found, expected)


def test_the_neighbourhood_counts_by_its_area():
    # A strip of four squares is folded where two narrow ones meet two wide ones. The narrow one at
    # the fold has as many mirrored neighbours as others, but the others have more area.
    across = np.array([-0.1, -0.05, 0.0, 1.0, 2.0])
    strip = np.array([[x, y, 0.0] for x in across for y in (0.0, 1.0)])
    faces = np.array(
        [[2 * k + c for c in corners] for k in range(4) for corners in ((0, 2, 1), (1, 2, 3))]
    )
    folded = np.abs(strip)
    found = inverted_triangles(folded, strip, faces)
    np.testing.assert_array_equal(found, np.repeat([False, True, False, False], 2))


def test_references_must_have_areas():
    flat = VERTICES.copy()
    flat[FACES[3, 0]] = flat[FACES[3, 1]]
    with pytest.raises(DegenerateSurfaceError, match="reference must have an area.*triangle"):
        inverted_triangles(VERTICES, flat, FACES)
    assert inverted_triangles(flat, VERTICES, FACES)[3]
    with pytest.raises(ArgumentError, match="points must have shape"):
        inverted_triangles(VERTICES[:-1], VERTICES, FACES)
