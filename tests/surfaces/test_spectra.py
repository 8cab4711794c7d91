"""Spectra and harmonics: the sphere, rectangles, meshes of all kinds."""

import numpy as np
import pytest
from known_surfaces import (
    flat_torus,
    sheet,
    sphere,
)

from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    DegenerateSurfaceError,
)
from riemhuman.kernels.surface import cotangent_laplacian
from riemhuman.surfaces import spectrum
from riemhuman.surfaces.spectra import harmonics
from riemhuman.surfaces.template import Template


@pytest.mark.parametrize(
    ("n", "m", "width", "height", "n_eigenvalues"),
    [
        (12, 10, 1.0, 0.7, 30),
        # A square's eigenvalues are multiple, and Lanczos iterations miss a copy.
        (24, 24, 1.0, 1.0, 24),
    ],
)
def test_flat_torus_has_the_spectrum_of_the_grid(n, m, width, height, n_eigenvalues):
    # Of right triangles the cotangent Laplacian is the five-point one, whose spectrum is closed.
    along = (2 - 2 * np.cos(2 * np.pi * np.arange(n) / n)) * (n / width) ** 2
    across = (2 - 2 * np.cos(2 * np.pi * np.arange(m) / m)) * (m / height) ** 2
    exact = np.sort(np.add.outer(along, across).ravel())[1 : n_eigenvalues + 1]
    found = spectrum(*flat_torus(n, m, width, height), n_eigenvalues)
    np.testing.assert_allclose(found.eigenvalues, exact, rtol=1e-10)


def test_components_borders_and_unused_vertices():
    (vertices, faces), n = sphere(2), 162
    points = np.concatenate([vertices, [[9.0, 9.0, 9.0]], 2 * vertices + 5])
    found = spectrum(points, np.concatenate([faces, faces + n + 1]), 8)
    alone = spectrum(vertices, faces, 8).eigenvalues
    both = np.sort(np.concatenate([alone, alone / 4]))[:8]
    np.testing.assert_allclose(found.eigenvalues, both, rtol=1e-8)
    assert found.eigenvalues.min() > 0.4  # neither of the two zeros is among them
    area = found.areas[:n].sum()
    np.testing.assert_allclose(found.constants[:n], 1 / area)
    np.testing.assert_allclose(found.constants[n + 1 :], 1 / (4 * area))
    assert found.constants[n] == found.areas[n] == 0
    np.testing.assert_array_equal(found.functions[:, n], 0.0)
    gram = (found.functions * found.areas) @ found.functions.T
    np.testing.assert_allclose(gram, np.eye(8), atol=1e-9)

    width, height = 2.0, 1.1
    border = spectrum(*sheet(61, 41, width, height), 5)
    m, n = np.meshgrid(np.arange(5), np.arange(5))
    exact = np.sort(((np.pi * m / width) ** 2 + (np.pi * n / height) ** 2).ravel())[1:6]
    np.testing.assert_allclose(border.eigenvalues, exact, rtol=5e-3)


def test_meshes_with_flat_triangles_are_refused():
    vertices, faces = sheet(9, 7)
    flat = np.concatenate([faces, [[0, 1, 2]]])  # three vertices of one straight side
    with pytest.raises(DegenerateSurfaceError, match=r"1 of 97 triangles without area"):
        spectrum(vertices, flat, 3)


def test_asking_for_too_many():
    with pytest.raises(ArgumentError, match=r"n_eigenvalues=3 exceeds the 2 of a mesh with 3"):
        spectrum(np.eye(3), [[0, 1, 2]], 3)
    assert len(spectrum(np.eye(3), [[0, 1, 2]], 2).eigenvalues) == 2


def test_bad_arguments():
    vertices, faces = sphere(1)
    with pytest.raises(ArgumentTypeError, match="n_eigenvalues must be a whole number"):
        spectrum(vertices, faces, 2.5)
    with pytest.raises(ArgumentError, match="refers to a vertex out of range"):
        spectrum(vertices[:10], faces, 3)


def sphere_mesh(subdivisions):
    return Template(*sphere(subdivisions))


def bumpy(seed=0):
    template = sphere_mesh(2)
    noise = np.random.default_rng(seed).normal(scale=0.05, size=template.vertices.shape)
    return Template(template.vertices + noise, template.faces)


@pytest.mark.parametrize("n_harmonics", [10, 161], ids=["iterative", "dense"])
def test_functions_solve_the_eigenvalue_problem(n_harmonics):
    template = bumpy()
    values, functions = harmonics(template, n_harmonics)
    areas = template.vertex_areas
    residual = (
        functions @ cotangent_laplacian(template.vertices, template.faces)
        - values[:, None] * functions * areas
    )
    assert np.abs(residual).max() < 1e-9 * values.max()
    np.testing.assert_allclose((functions * areas) @ functions.T, np.eye(n_harmonics), atol=1e-9)
    np.testing.assert_allclose(functions @ areas, 0.0, atol=1e-9)
    assert (np.diff(values) >= -1e-9 * values.max()).all()
    assert values[0] > 0.1


@pytest.mark.parametrize("n_parts", [3, 300])
def test_parts_are_solved_each_for_itself(n_parts):
    # Triangles of n sizes: every one has two eigenvalues, which scale with 1 / area.
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.1, 0.8, 0.0]])
    sizes = np.random.default_rng(0).uniform(1.0, 2.0, n_parts)
    vertices = (sizes[:, None, None] * corners + 3.0 * np.arange(n_parts)[:, None, None]).reshape(
        -1, 3
    )
    found = spectrum(vertices, np.arange(3 * n_parts).reshape(-1, 3), 4)
    alone = spectrum(corners, [[0, 1, 2]], 2).eigenvalues
    expected = np.sort(np.divide.outer(alone, sizes**2).ravel())[:4]
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=1e-9)
    gram = (found.functions * found.areas) @ found.functions.T
    np.testing.assert_allclose(gram, np.eye(4), atol=1e-9)
