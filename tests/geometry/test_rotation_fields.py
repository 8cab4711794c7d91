"""Fields of rotations, beside what holds for every manifold and metric."""

import numpy as np
import pytest
from cases import TEMPLATES, sphere_template
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry import RotationFields


@pytest.fixture
def space():
    return RotationFields(sphere_template())


@pytest.mark.parametrize("name", TEMPLATES)
def test_distance_is_the_weighted_sum_of_squared_angles(name):
    space = RotationFields(TEMPLATES[name]())
    first, second = space.random_point(2, rng=1)
    angles = (Rotation.from_matrix(first).inv() * Rotation.from_matrix(second)).magnitude()
    expected = np.sum(space.template.face_areas * angles**2)
    assert space.metric.squared_dist(first, second) == pytest.approx(expected, rel=1e-13)


def test_small_distances_keep_their_digits(space):
    start = space.random_point(rng=2)
    vector = space.random_tangent_vec(start, rng=3)
    for size in (1e-4, 1e-9, 1e-13):
        step = size / space.metric.norm(vector, start) * vector
        end = space.metric.exp(step, start)
        assert space.metric.dist(start, end) == pytest.approx(size, abs=1e-15)
    assert space.metric.dist(start, start) == 0


def test_inner_product_is_that_of_angular_velocities(space):
    # At a turn about z, R [(0, 0, a)]× has the squared length a².
    turned = np.broadcast_to(Rotation.from_euler("z", 0.3).as_matrix(), space.shape)
    velocity = turned @ np.array([[0.0, -2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    expected = 4.0 * space.template.face_areas.sum()
    assert space.metric.squared_norm(velocity, turned) == pytest.approx(expected)


def test_half_turns_are_the_cut_locus(space):
    start = space.random_point(rng=4)
    half = Rotation.from_euler("y", 180, degrees=True).as_matrix()
    for end in (start @ half, half @ start):
        assert space.metric.squared_dist(start, end) == pytest.approx(
            np.pi**2 * space.template.face_areas.sum()
        )
        with pytest.raises(OutsideManifoldError, match="the angle π"):
            space.metric.log(end, start)
    nearly = start @ Rotation.from_euler("y", np.pi - 1e-6).as_matrix()
    np.testing.assert_allclose(
        space.metric.exp(space.metric.log(nearly, start), start), nearly, atol=1e-9
    )


def test_what_is_no_field_of_rotations(space):
    point = space.random_point(rng=6)
    mirrored, stretched = point.copy(), point.copy()
    mirrored[3] *= -1
    stretched[3] *= 1.001
    candidates = np.stack([point, mirrored, stretched])
    np.testing.assert_array_equal(space.belongs(candidates), [True, False, False])
    for wrong in (mirrored, stretched):
        with pytest.raises(ArgumentError, match="point_b must hold rotations"):
            space.metric.dist(point, wrong)
    assert space.belongs(space.projection(stretched))


def test_random_points_are_uniform(space):
    points = space.random_point(100, rng=7)
    assert points.shape == (100, *space.shape)
    assert np.abs(points.mean(axis=(0, 1))).max() < 0.02
    angles = Rotation.from_matrix(points.reshape(-1, 3, 3)).magnitude()
    # Angles of uniform rotations have the density (1 − cos θ)/π.
    assert np.mean(angles < np.pi / 2) == pytest.approx(0.5 - 1 / np.pi, abs=0.02)
