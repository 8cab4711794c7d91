"""The nearest places of surfaces, against every triangle one by one."""

import numpy as np
import pytest
import trimesh
from open_bodies import coarse_bodies

from riemhuman.errors import RiemhumanError
from riemhuman.surfaces.nearest_points import nearest_points


def every_triangle(queries, points, faces):
    """Return the least distances by trimesh, of all triangles."""
    corners = points[faces]
    distances = []
    for query in queries:
        closest = trimesh.triangles.closest_point(corners, np.tile(query, (len(faces), 1)))
        distances.append(np.linalg.norm(closest - query, axis=1).min())
    return np.array(distances)


def uneven_mesh(rng):
    """Return a sheet of small triangles, beside large and thin ones, and vertices without any."""
    grid = np.stack(np.meshgrid(np.arange(9.0), np.arange(9.0)), axis=-1).reshape(-1, 2)
    points = np.column_stack([0.02 * grid, 0.005 * rng.standard_normal(81)])
    first = np.concatenate([np.arange(row, row + 8) for row in range(0, 72, 9)])
    faces = [np.column_stack([first, first + 1, first + 9])]
    far = rng.uniform(-1.0, 1.0, (9, 3))
    far[1::3] = far[::3] + 1e-3  # slivers
    faces.append(81 + np.arange(9).reshape(3, 3))
    return np.concatenate([points, far, rng.uniform(-0.2, 0.2, (50, 3))]), np.concatenate(faces)


@pytest.mark.parametrize("scale", [0.01, 0.3, 3.0])
def test_nearest_of_all_triangles(scale):
    rng = np.random.default_rng(int(100 * scale))
    bodies = coarse_bodies()
    for points, faces in (uneven_mesh(rng), (bodies[3], bodies.template.faces)):
        near = points[rng.integers(len(points), size=20)]
        queries = near + scale * rng.standard_normal((20, 3))
        places, distances = nearest_points(queries, points, faces)
        np.testing.assert_allclose(distances, every_triangle(queries, points, faces), atol=1e-12)
        assert places.barycentric.min() >= 0.0
        np.testing.assert_allclose(places.barycentric.sum(axis=1), 1.0, atol=1e-12)
        found = np.einsum("nk,nkx->nx", places.barycentric, points[faces[places.triangles]])
        np.testing.assert_allclose(np.linalg.norm(found - queries, axis=1), distances, atol=1e-12)


def test_points_of_a_surface_are_found():
    bodies = coarse_bodies()
    faces, rng = bodies.template.faces, np.random.default_rng(2)
    triangles = rng.integers(len(faces), size=100)
    barycentric = rng.dirichlet(np.ones(3), size=100)
    queries = np.einsum("nk,nkx->nx", barycentric, bodies[5][faces[triangles]])
    places, distances = nearest_points(queries, bodies[5], faces)
    np.testing.assert_allclose(distances, 0.0, atol=1e-9)
    np.testing.assert_array_equal(places.triangles, triangles)
    np.testing.assert_allclose(places.barycentric, barycentric, atol=1e-6)


def test_no_points_have_no_places():
    bodies = coarse_bodies()
    places, distances = nearest_points(np.empty((0, 3)), bodies[0], bodies.template.faces)
    assert places.barycentric.shape == (0, 3)
    assert distances.shape == (0,)


def test_no_queries_points_or_triangles_are_refused():
    points, faces = np.eye(3), [[0, 1, 2]]
    found, distances = nearest_points(points, points, faces)
    assert found.triangles.tolist() == [0, 0, 0]
    np.testing.assert_allclose(distances, 0.0, atol=1e-12)
    for arguments, message in (
        ((points * np.nan, points, faces), "queries holds 9 NaN or infinite entries"),
        ((points, points, [[0, 1, 3]]), "refers to a vertex out of range"),
        ((points, points, np.empty((0, 3), dtype=int)), "faces is empty"),
    ):
        with pytest.raises(RiemhumanError, match=message):
            nearest_points(*arguments)
