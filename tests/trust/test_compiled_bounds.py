"""Compiled loops of terms and kernels stay inside their arrays."""

from functools import partial

import numpy as np
import pytest
from block_patterns import couplings
from cases import deformations, open_template, surfaces
from every_term import QUADRATIC_TERMS, TERMS, features_of_fields, quadratic_terms
from interpreted import check_bounds, interpret
from scipy.sparse import bsr_array
from scipy.spatial.distance import cdist

from riemhuman.kernels import elimination, rotations, surface
from riemhuman.kernels.elimination import elimination_of
from riemhuman.kernels.threads import CHUNK, of_one_kind
from riemhuman.terms import (
    ConeTerm,
    EbinTerm,
    NormalTerm,
    RotationTerm,
    _polynomial_fits,
    _quadratic,
    _sums,
    cone,
    flat,
    normals,
)
from riemhuman.terms._quadratic import by_vertex
from riemhuman.terms._sums import SumOfTerms

TEMPLATE = open_template()
FACES, FRAMES, AREAS = TEMPLATE.faces, TEMPLATE.frame_coefficients, TEMPLATE.face_areas
WITHOUT_AREA = [term for term in TERMS if not term.needs_area]
# With functions of numbers alone: they would be compiled for these tests.
MODULES = (_sums, cone, flat, normals, _polynomial_fits)


def collapsed(points):
    """Return surfaces, a triangle of one of them without area."""
    points = points.copy()
    points[1, FACES[5]] = points[1, FACES[5, 0]]
    return points


def test_path_energy(monkeypatch):
    path = surfaces(TEMPLATE, 3, rng=1)
    path[2] = path[1] + 1e-3 * path[0]
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).path_energy(path),
        lambda: SumOfTerms(WITHOUT_AREA, TEMPLATE).path_energy(collapsed(path)),
    ]
    check_bounds(monkeypatch, MODULES, calls)


@pytest.mark.parametrize("precision", ["single", "double"])
def test_features(monkeypatch, precision):
    points = surfaces(TEMPLATE, 2, rng=2)
    calls = [
        lambda: SumOfTerms(TERMS, TEMPLATE).features(points, precision),
        lambda: SumOfTerms(WITHOUT_AREA, TEMPLATE).features(collapsed(points), precision),
    ]
    check_bounds(monkeypatch, MODULES, calls)


@pytest.mark.parametrize("name", QUADRATIC_TERMS)
def test_squared_norms(monkeypatch, name):
    term = quadratic_terms(TEMPLATE)[name]
    h, f = (by_vertex(make(TEMPLATE, 2, rng=6)) for make in (deformations, surfaces))
    check_bounds(monkeypatch, [_quadratic], [lambda: term.squared_norms_and_slopes(h, f)])


LOOPS = [
    (cone, EbinTerm(lam=0.3)),
    (cone, EbinTerm(lam=1e-3)),
    (cone, ConeTerm()),
    (normals, NormalTerm()),
    (normals, RotationTerm()),
]


@pytest.mark.parametrize(("module", "term"), LOOPS, ids=repr)
def test_pairs(monkeypatch, module, term):
    """In chunks of a few triangles, of which the last is shorter."""
    first = surface.derivatives(surfaces(TEMPLATE, 5, rng=3), TEMPLATE.differential_operator)
    features, _ = features_of_fields(term, term.fields(first), AREAS, "double")
    a, b = of_one_kind(features[:3]), of_one_kind(features[2:])
    expected = term.squared_distances(a, b, AREAS)
    within = np.triu(term.squared_distances(a, a, AREAS), 1)
    interpret(monkeypatch, MODULES)
    monkeypatch.setattr(module, "CHUNK", 24)
    np.testing.assert_allclose(term.squared_distances(a, b, AREAS), expected, atol=1e-12)
    np.testing.assert_allclose(term.squared_distances(a, a, AREAS), within, atol=1e-12)


@pytest.mark.parametrize("shape", [(7, 6), (4, 1), (3, 9)])
def test_flat_pairs(monkeypatch, shape):
    """Four rows and four columns at a time, at the edges fewer."""
    interpret(monkeypatch, [flat])
    n_values = 2 * CHUNK + 11  # more than a chunk
    a, b = (of_one_kind(np.random.default_rng(n).standard_normal((n, n_values))) for n in shape)
    distances = partial(flat.RootNormalTerm().squared_distances, areas=np.ones(n_values))
    np.testing.assert_allclose(distances(a, b), cdist(a, b) ** 2)
    np.testing.assert_allclose(np.triu(distances(a, a), 1), np.triu(cdist(a, a) ** 2))


# Compiled loops of kernels stay inside their arrays.


def test_nearest_rotations(monkeypatch):
    matrices = np.eye(3) + 0.1 * np.random.default_rng(6).standard_normal((4, 3, 3))
    calls = [lambda: [rotations.nearest_rotations(matrices)]]
    check_bounds(monkeypatch, [rotations], calls)


@pytest.mark.parametrize("n_sides", [elimination.WIDTH, 4])
def test_elimination(monkeypatch, n_sides):
    coupled = couplings("chain")
    n, lanes = len(coupled), None if n_sides == 4 else (0,) * n_sides
    dense = np.kron(coupled + 3.0 * np.eye(n), np.ones((3, 3))) + 9.0 * np.eye(3 * n)
    blocks = bsr_array(dense, blocksize=(3, 3))
    found = elimination_of(blocks)
    sides = np.random.default_rng(9).standard_normal((n, 3 * n_sides))

    def solved():
        lower, pivots, x = np.zeros((len(found.rows), 9)), np.empty((n, 3)), sides.copy()
        lower[found.targets] = blocks.data.reshape(-1, 9)[found.sources]
        where = (found.ends, found.rows)
        elimination.eliminate(*where, found.columns, found.row_ends, found.by_row, lower, pivots)
        elimination.solve_lower(*where, lower, x, lanes)
        elimination.solve_upper(*where, lower, x, lanes)
        return [lower, pivots, x]

    check_bounds(monkeypatch, [elimination], [solved])
