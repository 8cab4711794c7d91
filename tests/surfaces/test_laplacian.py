"""Eigenfunctions of the cotangent Laplacian: the sphere, meshes of all kinds."""

import numpy as np
import pytest
import trimesh

from riemhuman.errors import ArgumentError
from riemhuman.kernels.laplacian import cotangent_laplacian
from riemhuman.surfaces.laplacian import harmonics
from riemhuman.surfaces.template import Template


def sphere(subdivisions):
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions)
    return Template(mesh.vertices, mesh.faces)


def grid(n_columns, n_rows, width, height):
    """Return a rectangle in the plane, an open mesh."""
    x, y = np.meshgrid(np.linspace(0, width, n_columns), np.linspace(0, height, n_rows))
    index = np.arange(x.size).reshape(x.shape)
    corner, right, up, far = (
        block.ravel() for block in (index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:])
    )
    faces = np.concatenate([np.stack([corner, right, far], 1), np.stack([corner, far, up], 1)])
    return Template(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces)


def bumpy(seed=0):
    template = sphere(2)
    noise = np.random.default_rng(seed).normal(scale=0.05, size=template.vertices.shape)
    return Template(template.vertices + noise, template.faces)


def test_eigenvalues_converge_to_those_of_the_sphere():
    exact = np.repeat([2.0, 6.0, 12.0], [3, 5, 7])  # l (l + 1), each 2 l + 1 times
    errors, spacings = [], []
    for subdivisions in (2, 3, 4):
        template = sphere(subdivisions)
        values, _ = harmonics(template, 15)
        errors.append(np.abs(values / exact - 1).max())
        spacings.append(np.sqrt(template.face_areas.mean()))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(spacings))
    assert errors[-1] < 0.01
    np.testing.assert_allclose(slopes, 2.0, atol=0.1)


def test_lowest_eigenfunctions_of_the_sphere_are_the_coordinates():
    template = sphere(3)
    _, functions = harmonics(template, 3)
    coordinates = np.linalg.qr(template.vertices)[0]
    functions = np.linalg.qr(functions.T)[0]
    np.testing.assert_allclose(
        np.linalg.svd(coordinates.T @ functions, compute_uv=False), 1.0, atol=1e-6
    )


def test_free_boundaries_have_neumann_conditions():
    width, height = 2.0, 1.1
    values, _ = harmonics(grid(61, 41, width, height), 5)
    m, n = np.meshgrid(np.arange(5), np.arange(5))
    exact = np.sort(((np.pi * m / width) ** 2 + (np.pi * n / height) ** 2).ravel())[1:6]
    np.testing.assert_allclose(values, exact, rtol=5e-3)


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


def test_iterative_and_dense_agree():
    template = bumpy()
    few, many = harmonics(template, 10), harmonics(template, 161)
    np.testing.assert_allclose(few[0], many[0][:10], rtol=1e-9)
    np.testing.assert_allclose(few[1], many[1][:10], atol=1e-7)


def test_result_is_repeatable_and_scales():
    template = bumpy()
    values, functions = harmonics(template, 6)
    np.testing.assert_array_equal(harmonics(template, 6)[1], functions)
    large = harmonics(Template(1e3 * template.vertices, template.faces), 6)
    np.testing.assert_allclose(large[0], 1e-6 * values, rtol=1e-8)
    np.testing.assert_allclose(large[1], 1e-3 * functions, atol=1e-9)


def test_every_component_has_a_constant_and_unused_vertices_have_no_part():
    one = bumpy()
    n = one.n_vertices
    vertices = np.concatenate([one.vertices, [[9.0, 9.0, 9.0]], 2 * one.vertices + 5])
    template = Template(vertices, np.concatenate([one.faces, one.faces + n + 1]))
    values, functions = harmonics(template, 8)
    alone = harmonics(one, 8)[0]
    np.testing.assert_allclose(values, np.sort(np.concatenate([alone, alone / 4]))[:8], rtol=1e-9)
    np.testing.assert_array_equal(functions[:, n], 0.0)
    areas = template.vertex_areas
    for part in (slice(0, n), slice(n + 1, None)):
        np.testing.assert_allclose(functions[:, part] @ areas[part], 0.0, atol=1e-9)


def test_asking_for_too_many_is_refused():
    template = Template(np.eye(3), [[0, 1, 2]])
    assert harmonics(template, 2)[1].shape == (2, 3)
    with pytest.raises(ArgumentError, match=r"n_harmonics=3 exceeds the 2 harmonics"):
        harmonics(template, 3)
