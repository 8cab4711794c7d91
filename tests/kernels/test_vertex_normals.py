"""Normals at the vertices of surfaces whose normals are known."""

import numpy as np
from parametric_surfaces import sphere

from riemhuman.kernels.surface import vertex_normals


def test_normals_of_a_sphere_point_away_from_its_centre():
    template = sphere(3)
    normals = vertex_normals(template.vertices, template.faces)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    assert np.sum(normals * template.vertices, axis=1).min() > 0.999


def test_triangles_count_by_their_areas():
    # At the first corner, a triangle across z and one of twice the area across x.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2], [5, 5, 5]])
    normals = vertex_normals(points, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(normals[0], np.array([2.0, 0, 1]) / np.sqrt(5.0), atol=1e-12)
    assert not normals[4].any()
