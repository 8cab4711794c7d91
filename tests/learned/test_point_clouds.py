"""Points spread over surfaces."""

import numpy as np
import pytest
from descriptor_meshes import sphere

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.learned.point_clouds import cloud_features, initial_cloud, surface_points


def test_points_lie_on_the_surface_and_are_spread_evenly():
    vertices, faces = sphere(3)
    points = surface_points(vertices, faces, 2000, np.random.default_rng(0))
    assert points.shape == (2000, 3)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, atol=1e-12)
    lengths = np.linalg.norm(points, axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(vertices, axis=1).mean(), rtol=0.1)
    # Every octant of a sphere has an eighth of its area.
    octants = np.bincount((points > 0) @ [1, 2, 4], minlength=8)
    np.testing.assert_allclose(octants, 250, atol=40)


def test_order_of_points_does_not_matter():
    rng = np.random.default_rng(0)
    parameters = initial_cloud(8, 5, rng)
    points = rng.standard_normal((2, 30, 3))
    found = cloud_features(parameters, points)
    assert found.shape == (2, 5)
    np.testing.assert_allclose(found, cloud_features(parameters, points[:, ::-1]))


def test_without_area_is_refused():
    with pytest.raises(DegenerateSurfaceError, match="no area"):
        surface_points(np.zeros((3, 3)), np.array([[0, 1, 2]]), 5, np.random.default_rng(0))
