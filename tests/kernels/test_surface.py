"""First fundamental forms and normals, against coordinates of single triangles."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad, make_jvp
from cases import TEMPLATES, open_template, sphere_template, surfaces
from scipy.sparse import random_array

from riemhuman.kernels import surface
from riemhuman.kernels.surface import (
    apply_operator,
    cotangent_laplacian,
    deformation_gradients,
    differential,
    partial_derivatives,
    polar_frames,
    square_root,
    stacked_derivatives,
    triangle_frames,
    vertex_normals,
)


def derivatives(template, points):
    return surface.partial_derivatives(points, template.differential_operator)


def test_components_in_the_frame_of_a_triangle():
    """A body that swells by 2 has e_i·∂_j h = 2δ_ij, one that turns about ω has −ω × e_j."""
    rng = np.random.default_rng(7)
    f_u, f_v = rng.standard_normal((2, 9, 3))
    first = surface.follow_up(f_u, f_v)
    found = surface.frame_components(first, 2.0 * f_u, 2.0 * f_v)
    np.testing.assert_allclose(found, np.tile([2.0, 0, 0, 2.0, 0, 0], (9, 1)), atol=1e-12)
    e1 = f_u / np.linalg.norm(f_u, axis=-1, keepdims=True)
    n = surface.unit_normals(f_u, f_v)
    e2, axis = np.cross(n, e1), np.array([0.3, -0.5, 0.7])
    turned = surface.frame_components(first, np.cross(axis, f_u), np.cross(axis, f_v))
    expected = [surface.dot(e, np.cross(axis, d)) for e in (e1, e2, n) for d in (e1, e2)]
    np.testing.assert_allclose(turned, np.stack(expected, axis=-1), atol=1e-12)


@pytest.mark.parametrize("shape", [(), (5,), (2, 4)])
def test_inner_products_of_vectors(shape):
    rng = np.random.default_rng(3)
    a, b, w = rng.standard_normal((*shape, 3)), rng.standard_normal((4, 3)), 0.7
    if shape == (5,):
        b = b[0]
    np.testing.assert_allclose(surface.dot(a, b), np.sum(a * b, axis=-1), rtol=1e-14, atol=1e-15)
    for k in range(2):
        found = grad(lambda x, y: w * anp.sum(surface.dot(x, y) ** 2), k)(a, b)
        expected = grad(lambda x, y: w * anp.sum(anp.sum(x * y, axis=-1) ** 2), k)(a, b)
        np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)
        first = make_jvp(surface.dot, k)(a, b)((a, b)[k])[1]
        np.testing.assert_allclose(first, surface.dot(a, b), rtol=1e-14)


def test_forms_of_corners_are_those_of_components():
    template, rng = open_template(), np.random.default_rng(2)
    points, h, k = surfaces(template, 3, rng=3)
    scales = rng.uniform(0.5, 2.0, (2, template.n_faces))
    one, many = rng.normal(size=(6, 6)), rng.normal(size=(template.n_faces, 6, 6))
    forms = [(one, scales[0]), (many, scales[1])]
    before = rng.normal(size=(template.n_faces, 9, 9))
    blocks = before.copy()
    surface.add_blocks(blocks, points, template.faces, forms)
    h_corners, k_corners = (x[template.faces].reshape(-1, 9) for x in (h, k))
    operator = template.differential_operator
    first = surface.derivatives(points, operator)
    expected = surface.product_by_forms(h, k, first, operator, forms)
    found = np.einsum("fi,fij,fj", h_corners, blocks - before, k_corners)
    assert found == pytest.approx(expected, rel=1e-12)


def test_degenerate_triangles():
    f_u = np.array([[1.0, 0, 0], [1.0, 0, 0], [0, 0, 0], [1.0, 0, 0], [1e-9, 0, 0]])
    f_v = np.array([[0, 1.0, 0], [2.0, 0, 0], [0, 1.0, 0], [1.0, 1e-9, 0], [0, 1e-9, 0]])
    expected = [False, True, True, True, False]
    np.testing.assert_array_equal(surface.is_degenerate(f_u, f_v), expected)
    first = surface.follow_up(f_u, f_v)
    np.testing.assert_array_equal(first.areas[1:4], 1.0)
    np.testing.assert_array_equal(first.e[1:4], 1.0)


def test_forms_of_all_components_are_the_dirichlet_energy():
    """By the areas of a template, it does not depend on the size of the surface."""
    template = open_template()
    vertices, faces, areas = template.vertices, template.faces, template.face_areas
    expected = np.kron(cotangent_laplacian(vertices, faces).toarray(), np.eye(3))
    for size in (1.0, 3.0):
        blocks = np.zeros((template.n_faces, 9, 9))
        surface.add_blocks(blocks, size * vertices, faces, [(np.eye(6), areas)])
        found = template.assembler.assemble(blocks).toarray()
        np.testing.assert_allclose(found, expected / size**2, atol=1e-12)


def test_gradients_of_a_linear_map_are_the_map_along_the_surface():
    template = sphere_template()
    matrix = np.eye(3) + 0.3 * np.random.default_rng(0).standard_normal((3, 3))
    before, after = (
        triangle_frames(points, template.differential_operator)
        for points in (template.vertices, template.vertices @ matrix.T)
    )
    gradients = deformation_gradients(before, after)
    np.testing.assert_allclose((gradients @ before)[..., :2], (matrix @ before)[..., :2])
    np.testing.assert_allclose(gradients @ before, after, atol=1e-12)
    derivatives = template.differential_operator @ template.vertices
    np.testing.assert_array_equal(stacked_derivatives(before), derivatives)


@pytest.mark.parametrize("name", TEMPLATES)
def test_polar_frames_are_those_of_the_polar_decomposition(name):
    template = TEMPLATES[name]()
    f_u, f_v = partial_derivatives(surfaces(template, 2), template.differential_operator)
    frames = polar_frames(f_u, f_v)
    left, _, right = np.linalg.svd(np.stack([f_u, f_v], axis=-1), full_matrices=False)
    np.testing.assert_allclose(frames[..., :2], left @ right, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames), 1.0, rtol=1e-12)


def test_triangles_count_by_their_areas():
    # At the first corner, a triangle across z and one of twice the area across x.
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 2], [5, 5, 5]])
    normals = vertex_normals(points, np.array([[0, 1, 2], [0, 2, 3]]))
    np.testing.assert_allclose(normals[0], np.array([2.0, 0, 1]) / np.sqrt(5.0), atol=1e-12)
    assert not normals[4].any()


# Sparse operators and differentials under autograd.


@pytest.mark.parametrize("leading", [(), (4,), (2, 3), (0,), (2, 0)])
def test_operators_and_their_derivatives(leading):
    operator = random_array((7, 5), density=0.5, rng=np.random.default_rng(0), format="csr")
    rng = np.random.default_rng(2)
    values, tangent = rng.normal(size=(2, *leading, 5, 3))
    weights = rng.normal(size=(*leading, 7, 3))
    expected = np.einsum("ij,...jk->...ik", operator.toarray(), values)
    np.testing.assert_allclose(apply_operator(operator, values), expected, atol=1e-14)

    def value(x):
        return anp.sum(weights * apply_operator(operator, x) ** 2)

    gradient = grad(value)(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, values)
    )
    np.testing.assert_allclose(gradient, expected, atol=1e-13)
    pushed = make_jvp(lambda x: apply_operator(operator, x))(values)(tangent)[1]
    np.testing.assert_allclose(pushed, apply_operator(operator, tangent), atol=1e-14)
    # Of second order.
    second = grad(lambda x: anp.sum(tangent * grad(value)(x)))(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, tangent)
    )
    np.testing.assert_allclose(second, expected, atol=1e-12)


def test_differential():
    def cube_sums(x):
        return anp.stack([anp.sum(x**3, axis=-1), x[..., 0] * x[..., 1]], axis=-1)

    x, v = np.random.default_rng(3).normal(size=(2, 4, 3))
    expected = np.stack(
        [np.sum(3 * x**2 * v, axis=-1), x[:, 0] * v[:, 1] + x[:, 1] * v[:, 0]], axis=-1
    )
    np.testing.assert_allclose(differential(cube_sums, v, x), expected, atol=1e-14)
    by_vector = grad(lambda w: anp.sum(differential(cube_sums, w, x)))(v)
    by_point = grad(lambda p: anp.sum(differential(cube_sums, v, p)))(x)
    np.testing.assert_allclose(by_vector, 3 * x**2 + x[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)
    np.testing.assert_allclose(by_point, 6 * x * v + v[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)


pytestmark = pytest.mark.usefixtures("strict_floats")


def test_square_root():
    np.testing.assert_array_equal(square_root(np.array([0.0, 4.0, -1e-17])), [0.0, 2.0, 0.0])
    np.testing.assert_array_equal(
        [grad(square_root)(x) for x in (0.0, 4.0, -1e-17)], [0.0, 0.25, 0.0]
    )
    np.testing.assert_allclose(grad(grad(square_root))(4.0), -1 / 32)
    assert grad(grad(square_root))(0.0) == 0.0
