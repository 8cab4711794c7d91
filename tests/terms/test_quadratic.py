"""Terms of zeroth, first and second order: the compiled forms are those of the definitions."""

from itertools import pairwise

import numpy as np
import pytest
from autograd import grad
from cases import TEMPLATES, deformations, open_template, sphere_template, surfaces
from every_term import QUADRATIC_TERMS, quadratic_terms
from oracles import taylor_slope

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.surfaces.template import Template
from riemhuman.terms import _quadratic
from riemhuman.terms._quadratic import (
    FirstOrderWeights,
    NormalPartTerm,
    ZerothOrderTerm,
    by_vertex,
    corner_averages,
)
from riemhuman.terms._sums import SumOfQuadraticTerms

WEIGHTS = {
    "all": FirstOrderWeights(0.7, 0.3, 1.1, 0.9, 0.4),
    **{name: FirstOrderWeights(**{name: 1.0}) for name in FirstOrderWeights._fields},
}


def compiled(term, h, f):
    value, in_vectors, in_surfaces = term.squared_norms_and_slopes(by_vertex(h), by_vertex(f))
    return value, by_vertex(in_vectors), by_vertex(in_surfaces)


every_term = pytest.mark.parametrize("name", QUADRATIC_TERMS)


@every_term
@pytest.mark.parametrize("shape", ["sphere", "open"])
def test_values_slopes_and_matrices(name, shape):
    template = TEMPLATES[shape]()
    term = quadratic_terms(template)[name]
    f, h = surfaces(template, 3, rng=1), deformations(template, 3, rng=2)
    value, in_vectors, in_surfaces = compiled(term, h, f)
    np.testing.assert_allclose(value, term.inner_product(h, h, f).sum(), rtol=1e-12)
    for found, argument in ((in_vectors, 0), (in_surfaces, 1)):
        expected = grad(lambda h, f: np.sum(term.inner_product(h, h, f)), argument)(h, f)
        assert np.abs(found - expected).max() <= 1e-11 * np.abs(expected).max()
    products = term.inner_product(h[:, None], h, f[0])
    flat = h.reshape(3, -1)
    found = flat @ (term.matrix(f[0]) @ flat.T)
    np.testing.assert_allclose(found, products, rtol=0, atol=1e-11 * np.abs(products).max())


@every_term
@pytest.mark.parametrize("corners", [[1], [1, 2]], ids=["edge", "point"])
def test_triangles_without_area_cost_infinitely_much(name, corners):
    template = sphere_template()
    term = quadratic_terms(template)[name]
    f, h = surfaces(template, 3, rng=3), deformations(template, 3, rng=4)
    f[1, template.faces[7, corners]] = f[1, template.faces[7, 0]]
    value, *slopes = compiled(term, h, f)
    assert value == np.inf
    assert np.isfinite(slopes).all()


@every_term
def test_many_surfaces_run_in_threads_as_few_do_alone(name):
    template = sphere_template(2)
    term = quadratic_terms(template)[name]
    f, h = surfaces(template, 64, rng=6), deformations(template, 64, rng=7)
    assert len(f) * template.n_faces > 20_000
    value, *slopes = compiled(term, h, f)
    parts = [slice(first, first + 16) for first in range(0, 64, 16)]
    alone = [compiled(term, h[part], f[part]) for part in parts]
    assert value == pytest.approx(sum(value_of_part for value_of_part, *_ in alone), rel=1e-13)
    for k, part in enumerate(parts):
        for slope, slope_of_part in zip(slopes, alone[k][1:], strict=True):
            np.testing.assert_array_equal(slope[part], slope_of_part)


def test_sums_of_terms():
    template = sphere_template()
    terms = list(quadratic_terms(template).values())[:2]
    both = SumOfQuadraticTerms(terms, template)
    path, h = surfaces(template, 4, rng=10), deformations(template, 2, rng=11)
    products = sum(term.inner_product(h[0], h[1], path[:3]) for term in terms)
    np.testing.assert_allclose(both.inner_product(h[0], h[1], path[:3]), products, rtol=1e-13)
    found = h[0].ravel() @ (both.matrix(path[:3]) @ h[1].ravel())
    np.testing.assert_allclose(found, np.mean(products), rtol=1e-10)
    # Of the step from one surface to the next, at their mean, in a third of the time.
    squares = [
        term.inner_product(after - before, after - before, 0.5 * (before + after))
        for before, after in pairwise(path)
        for term in terms
    ]
    energy, gradient = both.path_energy(path)
    np.testing.assert_allclose(energy, 3 * np.sum(squares), rtol=1e-12)
    direction = deformations(template, 4, rng=12)
    assert taylor_slope(lambda x: both.path_energy(x)[0], path, direction, gradient) >= 1.9


def test_forms_say_the_weights():
    assert not np.any(FirstOrderWeights().forms())
    assert FirstOrderWeights.from_forms(*FirstOrderWeights().forms()) == FirstOrderWeights()
    for weights in WEIGHTS.values():
        found = FirstOrderWeights.from_forms(*weights.forms())
        np.testing.assert_allclose(found, weights, atol=1e-15)
    for scale in (1e-20, 1.0, 1e20):
        moving, still = (scale * form for form in WEIGHTS["all"].forms())
        found = FirstOrderWeights.from_forms(moving, still)
        np.testing.assert_allclose(found, scale * np.array(WEIGHTS["all"]), rtol=1e-14)
        moving[0, 1] += 1e-9 * scale
        assert FirstOrderWeights.from_forms(moving, still) is None
    along_u = np.diag([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    assert FirstOrderWeights.from_forms(along_u, np.zeros((6, 6))) is None
    assert FirstOrderWeights.from_forms(np.zeros((6, 6)), along_u) is None


def test_projections_to_normals():
    template = sphere_template()
    f, h = surfaces(template, 1, rng=8)[0], deformations(template, 1, rng=9)[0]
    over = template, corner_averages(template.faces, template.n_vertices)
    found = _quadratic.project(h, f, *over)
    normals = _quadratic.vertex_normals(f, *over)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-14)
    expected = [np.dot(one, n) * n for one, n in zip(h, normals, strict=True)]
    np.testing.assert_allclose(found, expected, atol=1e-14)
    corner = np.any(template.faces == 5, axis=1)
    sides = np.diff(f[template.faces[corner]], axis=1)
    around = np.cross(sides[:, 0], sides[:, 1]).sum(axis=0)
    np.testing.assert_allclose(normals[5], around / np.linalg.norm(around), rtol=1e-12)


def nearly_folded(share, size):
    """Return a template of two triangles, and two surfaces: a flat one and a folded one.

    Folded over their edge, the area vectors of the triangles cancel up to a share of the areas. The
    first vertex is outside both triangles.
    """
    template = Template(
        np.array([[5.0, 5, 5], [1, 0, 0], [0, 0, 0], [0, 1, 0], [0, -1, 0]]),
        np.array([[2, 1, 3], [1, 2, 4]]),
    )
    flat = template.vertices
    folded = flat.copy()
    # Areas ½ and ½ − d, d = share (1 − d).
    folded[4] = [0.3, 1.0 - 2.0 * share / (1.0 + share), 0.0]
    return template, size * np.stack([flat, folded])


@pytest.mark.parametrize("size", [2.0**-20, 1.0, 2.0**20])
def test_normals_cancel_up_to_a_share_of_the_areas(size):
    for share, cancels in ((0.0, True), (0.95e-12, True), (1.05e-12, False), (0.5, False)):
        template, both = nearly_folded(share, size)
        over = template, corner_averages(template.faces, template.n_vertices)
        term = NormalPartTerm(template, ZerothOrderTerm(template, 1.0))
        h = deformations(sphere_template(), 2, rng=13)[:, :5]
        value, *_ = compiled(term, h, both)
        assert np.isfinite(value) == (not cancels)
        if cancels:
            for given in (both[1], both[[0, 0, 1]]):
                with pytest.raises(DegenerateSurfaceError, match="around vertex 1 cancel"):
                    _quadratic.vertex_normals(given, *over)
            continue
        normals = _quadratic.vertex_normals(both, *over)
        np.testing.assert_allclose(normals[0], [[0, 0, 0], *4 * [[0, 0, 1]]], atol=1e-15)
        np.testing.assert_allclose(value, term.inner_product(h, h, both).sum())


def test_edges_at_which_triangles_turn_opposite_sides_up():
    opened = open_template()
    for faces in (opened.faces, opened.faces[:, ::-1], sphere_template().faces):
        assert len(_quadratic.mixed_edges(faces)) == 0
        sides = [{frozenset(pair) for pair in zip(t, np.roll(t, 1), strict=True)} for t in faces]
        for k in range(3, 9):
            flipped = faces.copy()
            flipped[k] = flipped[k, ::-1]
            shared = {side for j, other in enumerate(sides) if j != k for side in other & sides[k]}
            found = _quadratic.mixed_edges(flipped)
            assert {frozenset(edge) for edge in found.tolist()} == shared
            assert len(found) == len(shared)
    # Of three triangles at an edge, two go one way whatever they do.
    assert len(_quadratic.mixed_edges(np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))) == 0


def test_surrounded_vertices():
    closed, opened = sphere_template(), open_template()
    assert _quadratic.surrounded_vertices(closed.faces, closed.n_vertices).all()
    grid = _quadratic.surrounded_vertices(opened.faces, opened.n_vertices).reshape(4, 5)
    assert grid[1:-1, 1:-1].all()
    assert grid.sum() == 6
    assert not _quadratic.surrounded_vertices(closed.faces, closed.n_vertices + 1)[-1]
