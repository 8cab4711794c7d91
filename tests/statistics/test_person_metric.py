"""The metric that tells people apart in any pose."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.io.arrays import load_arrays
from riemhuman.statistics.person_metric import WEIGHTS, fields_of_poses


@pytest.fixture(scope="module")
def bodies():
    """People of whom nothing was learned or chosen."""
    return rh.datasets.load_open_bodies("coarse", "natural", 31)


@pytest.fixture(scope="module")
def metric(bodies):
    return rh.PersonMetric(rh.AlignedSurfaces(bodies.template))


def test_people_in_other_poses_are_nearer_than_other_people(bodies, metric):
    areas = rh.AreaMetric(metric.space)
    noise = 0.004 * np.random.default_rng(0).standard_normal(bodies.points.shape)
    for points in (bodies.points, bodies.points + noise):
        of_people = rh.retrieval.scores(metric.dist_pairwise(points), bodies.subject)
        of_areas = rh.retrieval.scores(areas.dist_pairwise(points), bodies.subject)
        assert of_areas.first_tier < 97.0
        assert of_people.first_tier > 99.5


def test_directions_of_poses_count_less_and_others_as_much(bodies, metric):
    fields, weights = fields_of_poses()
    masses = bodies.template.vertex_heat.masses
    gram = fields.T @ (masses[:, None] * fields)
    np.testing.assert_allclose(gram, np.eye(len(weights)), atol=1e-5)
    of_areas = rh.AreaMetric(metric.space).log_areas(bodies.points[:2])
    of_person = metric.person_fields(bodies.points[:2])
    np.testing.assert_allclose(
        (masses * of_person) @ fields, weights * ((masses * of_areas) @ fields), atol=1e-5
    )
    rest = of_areas - (masses * of_areas) @ fields @ fields.T
    np.testing.assert_allclose(
        of_person - (masses * of_person) @ fields @ fields.T, rest, atol=1e-5
    )


def test_stored_places_are_the_nearest_on_the_coarse_body():
    full, coarse = (rh.datasets.load_open_model(name).template for name in ("full", "coarse"))
    stored = load_arrays(WEIGHTS, ["triangles", "barycentric"])
    nearest, _ = rh.surfaces.nearest_points(full.vertices, coarse.vertices, coarse.faces)
    np.testing.assert_array_equal(stored["triangles"], nearest.triangles)
    np.testing.assert_allclose(stored["barycentric"], nearest.barycentric, atol=1e-12)


def test_distances_are_those_of_coordinates_and_ignore_place_and_direction(bodies, metric):
    first, second = bodies[0], bodies[17]
    turn = Rotation.from_euler("xyz", [20, 70, -30], degrees=True).as_matrix()
    expected = metric.dist(first, second)
    assert metric.dist(first, second @ turn.T + 0.3) == pytest.approx(expected)
    table = metric.dist_pairwise(bodies.points[[0, 17]], precision="double")
    np.testing.assert_allclose(table[0, 1], expected, rtol=1e-9)
    coordinates = metric.lower_bound_coordinates(bodies.points[[0, 17]])
    assert np.linalg.norm(coordinates[0] - coordinates[1]) == pytest.approx(expected)
    direction = np.random.default_rng(1).standard_normal(first.shape)
    slope = anp.sum(grad(lambda f: metric.squared_dist(f, second))(first) * direction)
    step = 1e-6
    ends = [metric.squared_dist(first + sign * step * direction, second) for sign in (1, -1)]
    assert slope == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-5)


def test_other_triangles_are_refused(bodies):
    other = rh.Template(bodies.template.vertices, bodies.template.faces[:, [1, 2, 0]])
    with pytest.raises(ArgumentError, match="space must have the open body model's triangles"):
        rh.PersonMetric(rh.AlignedSurfaces(other))
