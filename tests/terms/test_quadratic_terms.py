"""Terms of zeroth, first and second order: the compiled forms are those of the definitions."""

import numpy as np
import pytest
from autograd import grad
from cases import TEMPLATES, deformations, open_template, sphere_template, surfaces
from oracles import taylor_slope

from riemhuman.kernels import moving_frames
from riemhuman.kernels.moving_frames import by_vertex
from riemhuman.terms import first_order, normal_projection, second_order, zeroth_order
from riemhuman.terms.first_order import FirstOrderWeights

WEIGHTS = [
    FirstOrderWeights(0.7, 0.3, 1.1, 0.9, 0.4),
    *(FirstOrderWeights(**{name: 1.0}) for name in FirstOrderWeights._fields),
]


class Terms:
    """Definitions and compiled forms over one template."""

    def __init__(self, template):
        self.template = template
        self.over = template.differential_operator, template.face_areas
        self.averages = zeroth_order.corner_averages(template.faces, template.n_vertices)
        self.surrounded = second_order.surrounded_vertices(template.faces, template.n_vertices)

    def definition(self, name, h, k, f):
        if name == "zeroth":
            return zeroth_order.inner_product(h, k, f, *self.over, self.averages)
        if name == "second":
            return second_order.inner_product(h, k, f, *self.over, self.averages, self.surrounded)
        return first_order.inner_product(h, k, f, name, *self.over)

    def compiled(self, name, h, f):
        faces, arrays = self.template.faces, (by_vertex(h), by_vertex(f))
        if name == "zeroth":
            found = zeroth_order.squared_norms_and_slopes(*arrays, faces)
        elif name == "second":
            found = second_order.squared_norms_and_slopes(*arrays, faces, self.surrounded)
        else:
            areas = self.template.face_areas
            found = first_order.squared_norms_and_slopes(*arrays, faces, areas, name)
        return found[0], by_vertex(found[1]), by_vertex(found[2])

    def matrix(self, name, f):
        masses = zeroth_order.vertex_areas(f, *self.over, self.averages)
        if name == "zeroth":
            return zeroth_order.matrix(masses)
        if name == "second":
            return second_order.matrix(f, self.template.faces, masses, self.surrounded)
        blocks = np.zeros((self.template.n_faces, 9, 9))
        areas = self.template.face_areas
        first_order.add_blocks(blocks, f, self.template.faces, areas, name)
        return self.template.assembler.assemble(blocks)


every_term = pytest.mark.parametrize("name", ["zeroth", "second", *WEIGHTS], ids=str)


@every_term
@pytest.mark.parametrize("template", ["sphere", "open"])
def test_values_slopes_and_matrices(name, template):
    terms = Terms(TEMPLATES[template]())
    f, h = surfaces(terms.template, 3, rng=1), deformations(terms.template, 3, rng=2)
    value, in_vectors, in_surfaces = terms.compiled(name, h, f)
    np.testing.assert_allclose(value, terms.definition(name, h, h, f).sum(), rtol=1e-12)
    for found, argument in ((in_vectors, 0), (in_surfaces, 1)):
        expected = grad(lambda h, f: np.sum(terms.definition(name, h, h, f)), argument)(h, f)
        error = np.abs(found - expected).max()
        assert error <= 1e-11 * np.abs(expected).max()
    products = terms.definition(name, h[:, None], h, f[0])
    flat = h.reshape(3, -1)
    np.testing.assert_allclose(
        flat @ (terms.matrix(name, f[0]) @ flat.T), products, atol=1e-11 * np.abs(products).max()
    )


@every_term
def test_slopes_are_derivatives(name):
    terms = Terms(sphere_template())
    f, h = surfaces(terms.template, 2, rng=3), deformations(terms.template, 2, rng=4)
    direction = deformations(terms.template, 2, rng=5)
    _, in_vectors, in_surfaces = terms.compiled(name, h, f)
    for slopes, function in (
        (in_vectors, lambda x: terms.compiled(name, x, f)[0]),
        (in_surfaces, lambda x: terms.compiled(name, h, x)[0]),
    ):
        at = h if slopes is in_vectors else f
        assert taylor_slope(function, at, direction, slopes) >= 1.9


def test_wrong_slopes_are_seen():
    terms = Terms(sphere_template())
    f, h = surfaces(terms.template, 2, rng=3), deformations(terms.template, 2, rng=4)
    _, _, slopes = terms.compiled("second", h, f)
    direction = deformations(terms.template, 2, rng=5)
    function = lambda x: terms.compiled("second", h, x)[0]  # noqa: E731
    assert taylor_slope(function, f, direction, 1.01 * slopes) < 1.5


@every_term
def test_threads_give_the_same_bits(name, monkeypatch):
    terms = Terms(sphere_template(2))
    f, h = surfaces(terms.template, 4, rng=6), deformations(terms.template, 4, rng=7)
    alone = terms.compiled(name, h, f)
    monkeypatch.setattr(moving_frames, "_WORTH_THREADS", 0)
    for one, other in zip(alone, terms.compiled(name, h, f), strict=True):
        np.testing.assert_array_equal(one, other)


def test_slopes_through_projections():
    template = sphere_template()
    f, h = surfaces(template, 2, rng=8), deformations(template, 2, rng=9)
    pull = deformations(template, 2, rng=10)
    averages = zeroth_order.corner_averages(template.faces, template.n_vertices)
    over = template.differential_operator, template.face_areas, averages

    def pulled(h, f):
        return np.sum(normal_projection.project(h, f, *over) * pull)

    projections = normal_projection.NormalProjections(by_vertex(f), template.faces)
    found = by_vertex(projections.project(by_vertex(h)))
    np.testing.assert_allclose(found, normal_projection.project(h, f, *over), atol=1e-14)
    for argument, slopes in enumerate(projections.slopes(by_vertex(h), by_vertex(pull))):
        expected = grad(pulled, argument)(h, f)
        np.testing.assert_allclose(by_vertex(slopes), expected, atol=1e-12 * np.abs(expected).max())
    normals = normal_projection.vertex_normals(f[0], *over)
    matrix = normal_projection.matrix(normals).toarray()
    np.testing.assert_allclose(matrix @ matrix, matrix, atol=1e-14)
    np.testing.assert_allclose(matrix @ h[0].ravel(), found[0].ravel(), atol=1e-14)


def test_surrounded_vertices():
    closed, opened = sphere_template(), open_template()
    assert second_order.surrounded_vertices(closed.faces, closed.n_vertices).all()
    grid = second_order.surrounded_vertices(opened.faces, opened.n_vertices).reshape(4, 5)
    assert grid[1:-1, 1:-1].all()
    assert grid.sum() == 6
    assert not second_order.surrounded_vertices(closed.faces, closed.n_vertices + 1)[-1]


def test_cotangents_on_a_right_triangle():
    """Angles of 90°, 45° and 45°: ½ cot 45° = ½ on the two sides about the right angle."""
    laplacian = second_order.cotangent_laplacian(
        np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]]), np.array([[0, 1, 2]])
    )
    expected = [[1.0, -0.5, -0.5], [-0.5, 0.5, 0.0], [-0.5, 0.0, 0.5]]
    np.testing.assert_allclose(laplacian.toarray(), expected, atol=1e-15)
