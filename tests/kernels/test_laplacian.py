"""Entries of the cotangent Laplacian: from angles, by another library, and by its energy."""

import numpy as np
import pytest
from cases import open_template, sphere_template, surfaces
from parametric_surfaces import sphere

from riemhuman.kernels.surface import cotangent_laplacian, partial_derivatives
from riemhuman.surfaces.template import Template


def cotangents_by_hand(template):
    """Assemble -½ (cot α + cot β) edge by edge, from angles."""
    matrix = np.zeros((template.n_vertices, template.n_vertices))
    for face in template.faces:
        for corner in range(3):
            k, i, j = np.roll(face, -corner)
            a, b = template.vertices[i] - template.vertices[k], template.vertices[j]
            b = b - template.vertices[k]
            angle = np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b))
            matrix[i, j] -= 0.5 / np.tan(angle)
            matrix[j, i] -= 0.5 / np.tan(angle)
    return matrix - np.diag(matrix.sum(axis=1))


@pytest.mark.parametrize("template", [sphere_template(), open_template()], ids=["closed", "open"])
def test_entries_are_cotangents(template):
    np.testing.assert_allclose(
        cotangent_laplacian(template.vertices, template.faces).toarray(),
        cotangents_by_hand(template),
        atol=1e-11,
    )


def test_triangles_that_share_an_edge_in_threes_add_up():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0.2], [0.3, -1, 0], [0, 0.1, 1]]
    template = Template(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    np.testing.assert_allclose(
        cotangent_laplacian(template.vertices, template.faces).toarray(),
        cotangents_by_hand(template),
        atol=1e-13,
    )


def test_robust_laplacian_agrees():
    # It flips edges to be Delaunay; on the icosphere there is nothing to flip.
    robust_laplacian = pytest.importorskip("robust_laplacian")
    template = sphere(3)
    laplacian, _ = robust_laplacian.mesh_laplacian(
        np.array(template.vertices), np.array(template.faces), mollify_factor=0.0
    )
    difference = cotangent_laplacian(template.vertices, template.faces) - laplacian
    assert np.abs(difference.toarray()).max() < 1e-10


def test_the_energy_is_that_of_linear_functions():
    """hᵀL h = Σ_t w_t (h_u² + h_v²)."""
    template = open_template()
    h = surfaces(template, 1, rng=1)[0]
    h_u, h_v = partial_derivatives(h, template.differential_operator)
    expected = template.face_areas @ np.sum(h_u**2 + h_v**2, axis=1)
    laplacian = cotangent_laplacian(template.vertices, template.faces)
    np.testing.assert_allclose(np.sum(h * (laplacian @ h)), expected, rtol=1e-12)
