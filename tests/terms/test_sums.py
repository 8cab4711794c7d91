"""Sums of terms: energies, features and sums over pairs are those of the definitions."""

from functools import partial

import numpy as np
import pytest
from autograd import value_and_grad
from cases import SURFACES, TEMPLATES, name_of, open_template, sphere_template, surfaces
from every_term import features_of_fields

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import (
    AlignedSurfaces,
    ElasticMetric,
    RiemannianMetric,
    SRNFMetric,
    SurfaceMetric,
    VectorSpace,
)
from riemhuman.kernels import threads
from riemhuman.surfaces import Template
from riemhuman.terms import (
    ConeTerm,
    EbinTerm,
    FlatTerm,
    NormalTerm,
    RootNormalTerm,
    RotationTerm,
)
from riemhuman.terms._sums import SumOfFields, SumOfTerms

COMPILED = [case for case in SURFACES if isinstance(case.metric, SurfaceMetric)]


def check_against_definition(metric, path, rtol=1e-10):
    energy, gradient = metric.energy_and_gradient(path)
    expected, expected_gradient = value_and_grad(partial(RiemannianMetric.energy, metric))(path)
    np.testing.assert_allclose(energy, expected, rtol=rtol)
    scale = np.abs(expected_gradient).max()
    np.testing.assert_allclose(gradient, expected_gradient, rtol=0, atol=rtol * scale)


@pytest.mark.parametrize("size", [1e-5, 1e-3, 0.03, 0.3, 3.0])
@pytest.mark.parametrize("case", COMPILED, ids=name_of)
def test_compiled_energy_agrees_at_all_distances(case, size):
    template = case.space.template
    path = surfaces(template, 5, rng=12, size=size)
    if size == 1e-5:
        # Rounding in the differences of near-equal surfaces is all that differs.
        check_against_definition(case.metric, path, rtol=1e-8)
    else:
        check_against_definition(case.metric, path)


# Triangles without area.


def collapsed_path(template):
    """Return a path with a triangle shrunk to an edge, and one shrunk to a point."""
    path = surfaces(template, 4, rng=13)
    faces = template.faces
    path[2, faces[3, 1]] = path[2, faces[3, 0]]
    path[3, faces[5]] = path[3, faces[5, 0]]
    return path


@pytest.mark.parametrize("template_name", ["sphere", "open"])
def test_degenerate_triangles(template_name):
    template = TEMPLATES[template_name]()
    space = AlignedSurfaces(template, equip=False)
    path = collapsed_path(template)
    for metric in (ElasticMetric(space, 1.0, 0.3, 0.0), SRNFMetric(space)):
        check_against_definition(metric, path)
    energy, gradient = ElasticMetric(space, 1.0, 0.3, 0.2).energy_and_gradient(path)
    assert energy == np.inf
    assert np.all(np.isfinite(gradient))


class Uncompiled(FlatTerm):
    """A term that runs by its definition."""

    def field(self, first):
        return first.area_vectors


LONG_TERMS = [EbinTerm(1.0, 0.3), NormalTerm(0.2), RootNormalTerm(0.7), Uncompiled(0.4)]


def test_long_paths_are_the_sum_of_their_parts():
    """They run in threads, a few triangles after the others; short paths run in one pass."""
    template, n_parts = TEMPLATES["sphere"](), 55
    total, path = SumOfTerms(LONG_TERMS, template), surfaces(template, 12 * n_parts + 1, rng=3)
    energy, gradient = total.path_energy(path)
    expected, slopes = 0.0, np.zeros_like(path)
    for first in range(0, 12 * n_parts, 12):
        part = slice(first, first + 13)
        energy_of_part, slopes_of_part = total.path_energy(path[part])
        expected += n_parts * energy_of_part
        slopes[part] += n_parts * slopes_of_part
    np.testing.assert_allclose(energy, expected, rtol=1e-12)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())
    assert total.path_energy(path, gradient=False)[0] == pytest.approx(energy, rel=1e-14)


def test_distances_on_large_meshes_are_the_sum_over_their_parts():
    """They run in threads, in one pass over the triangles after the other; each part in one."""
    whole, weights = sphere_template(5), np.array([0.2, 1.3, 0.7])
    f, *others = surfaces(whole, 4, rng=3)
    squared, gradient = SumOfTerms(LONG_TERMS, whole).squared_dists(f, others, weights)
    total, slopes = np.zeros(3), np.zeros_like(f)
    for first in range(0, whole.n_faces, 4096):
        part = Template(whole.vertices, whole.faces[first : first + 4096])
        squared_of_part, slope = SumOfTerms(LONG_TERMS, part).squared_dists(f, others, weights)
        total += squared_of_part
        slopes += slope
    np.testing.assert_allclose(squared, total, rtol=1e-12)
    np.testing.assert_allclose(gradient, slopes, rtol=0, atol=1e-12 * np.abs(slopes).max())


def test_distances_from_one_surface_are_energies_of_single_steps():
    """Of surfaces whose vertices are numbered in another order, too."""
    template = TEMPLATES["sphere"]()
    total = SumOfTerms([EbinTerm(1.0, 0.3), NormalTerm(0.2), Uncompiled(0.4)], template)
    f, *others = surfaces(template, 4, rng=3)
    weights = np.array([0.2, 1.3, 0.7])
    steps = [total.path_energy(np.stack([other, f])) for other in others]
    expected = np.tensordot(weights, [slope[1] for _, slope in steps], 1)
    order = np.random.default_rng(4).permutation(template.n_vertices)
    for points, faces in (
        (np.stack(others), None),
        (np.stack(others)[:, order], np.argsort(order)[template.faces]),
    ):
        squared, gradient = total.squared_dists(f, points, weights, faces)
        np.testing.assert_allclose(squared, [energy for energy, _ in steps], rtol=1e-12)
        np.testing.assert_allclose(gradient, expected, atol=1e-12)


# What terms keep of each surface, against the definitions.

TEMPLATE = open_template()
PRECISIONS = {"single": np.float32, "double": np.float64}


BY_STRETCH_AND_BY_TURN = ConeTerm(1.0, 1e4, 1.0, 1e-4), ConeTerm(1.0, 1e-4, 1.0, 1e4)


@pytest.mark.parametrize(
    "term", [*BY_STRETCH_AND_BY_TURN, NormalTerm(), RootNormalTerm()], ids=repr
)
def test_rounding_is_little_more_than_the_distance_to_what_is_kept(term):
    tables, points = SumOfTerms([term], TEMPLATE), surfaces(TEMPLATE, 3, rng=5)
    exact, single = (tables.features(points, precision) for precision in ("double", "single"))
    kept = tuple(array.astype(np.float64) for array in single)
    distances = np.sqrt(np.diag(tables.squared_distances(exact, kept)))
    rounding = tables.rounding(single)
    assert np.all(distances <= (1.0 + 1e-6) * rounding)
    assert np.all(rounding <= 2.0 * distances)


def test_rounding_bounds_changes_of_right_angles():
    """There, an angle changes by √2 times the change of its chord, which rounding changes."""
    term, one_triangle = NormalTerm(), np.ones(1)
    normals, directions = np.random.default_rng(8).standard_normal((2, 1000, 1, 3))
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    right = np.cross(normals, directions)
    right /= np.linalg.norm(right, axis=2, keepdims=True)
    exact, ends = (
        features_of_fields(term, (vectors,), one_triangle, "double")[0]
        for vectors in (normals, right)
    )
    single, rounding = features_of_fields(term, (normals,), one_triangle, "single")
    before, after = (
        np.sqrt(np.diag(term.squared_distances(features, ends, one_triangle)))
        for features in (exact, single.astype(np.float64))
    )
    shares = np.abs(after - before) / rounding
    assert 0.95 < shares.max() <= 1.0 + 1e-6


def test_features_of_several_terms_are_those_of_each():
    terms, points = [EbinTerm(lam=0.3), NormalTerm(), RootNormalTerm()], surfaces(TEMPLATE, 3)
    tables = SumOfTerms(terms, TEMPLATE)
    joint = tables.features(points, "single")
    assert len(joint) == tables.n_arrays
    single = [SumOfTerms([term], TEMPLATE).features(points, "single") for term in terms]
    for array, expected in zip(joint, sum(single, ()), strict=True):
        np.testing.assert_array_equal(array, expected)
    points[1, TEMPLATE.faces[4]] = points[1, TEMPLATE.faces[4, 0]]
    with pytest.raises(DegenerateSurfaceError, match=r"triangle \d of item \(1,\), the first of"):
        tables.features(points, "single")


def test_range_of_single_precision():
    """Squares of what is kept, and products of squares, stay within its range."""
    limits = np.finfo(np.float32)
    assert limits.max > threads.LARGEST**2
    assert limits.tiny < threads.SMALLEST**2
    x, y, s = np.zeros((8, 1)), np.ones((8, 1)), np.ones((8, 1))
    x[0], x[1] = 0.95e15, -1.05e15
    y[2], y[3], y[4], y[5] = 0.95e15, 1.05e15, 1.05e-15, 0.95e-15
    s[6], s[7] = 0.95e15, 1.05e15
    _, rounding = features_of_fields(EbinTerm(lam=0.3), (x, y, s), np.ones(1), "single")
    assert np.isinf(rounding).tolist() == [False, True, False, True, False, True, False, True]
    vectors = np.array([[0.95e15], [-1.05e15]])
    _, rounding = VectorSpace((1,)).metric.features(vectors, "single")
    assert np.isinf(rounding).tolist() == [False, True]
    roots = np.array([[[np.nan, 0.0, 0.0]], [[1.0, 0.0, 0.0]]])
    _, rounding = features_of_fields(RootNormalTerm(), (roots,), np.ones(1), "single")
    assert np.isinf(rounding).tolist() == [True, False]


def test_rounding_is_at_most_the_way_through_the_apex():
    """However far rounding shears a triangle."""
    one = np.ones((1, 1))
    fields = 1e10 + 300.0 * one, one, one
    _, rounding = features_of_fields(EbinTerm(lam=0.3), fields, np.ones(1), "single")
    assert rounding[0] == pytest.approx(4.0 * np.sqrt(0.3) * (1.0 + 1.0))


TINY = 2.0**-80 * np.array([[1.0], [2.0]])  # exact in single precision, but not the squares
UNIT = np.ones((2, 1))


@pytest.mark.parametrize(
    ("term", "fields"),
    [
        (EbinTerm(lam=0.3), (0.0 * UNIT, UNIT, TINY)),
        (NormalTerm(), (np.stack([UNIT, TINY, 0.0 * UNIT], axis=2),)),
        (RootNormalTerm(), (np.stack([TINY, 0.0 * UNIT, 0.0 * UNIT], axis=2),)),
    ],
    ids=["cone", "normals", "flat"],
)
def test_squares_that_are_too_small_for_single_precision_count_as_rounding(term, fields):
    tables = SumOfFields(term, np.ones(1), lambda points: fields)
    made = {p: features_of_fields(term, fields, np.ones(1), p) for p in PRECISIONS}
    exact, single = (tables.squared_distances(made[p], made[p])[0, 1] for p in ("double", "single"))
    assert 0.0 == single < exact
    assert np.sqrt(exact) <= tables.rounding(made["single"]).sum()


# The compiled sums over pairs, against NumPy.

each_precision = pytest.mark.parametrize("precision", ["single", "double"])

F = 1290  # two chunks and a piece
WEIGHTS = threads.of_one_kind(np.random.default_rng(3).uniform(0.0, 1e-3, F))


class Numbers(FlatTerm):
    """Fields of one number."""

    def field(self, first):
        return first.e[..., None]


def metric_fields(n):
    rng = np.random.default_rng(n)
    x, s = rng.uniform(-1, 1, (n, F)), rng.uniform(0, 1.5, (n, F))
    s[:, 7] = 0.0
    return x, np.exp(rng.uniform(-1, 1, (n, F))), s


def unit_normals(n):
    normals = np.random.default_rng(n).standard_normal((n, F, 3))
    return (normals / np.linalg.norm(normals, axis=2, keepdims=True),)


def quaternions(n):
    found = np.random.default_rng(n).standard_normal((n, F, 4))
    return (found / np.linalg.norm(found, axis=2, keepdims=True),)


def numbers(n):
    return (metric_fields(n)[0][..., None],)


KERNELS = {
    "ebin": (EbinTerm(lam=0.3), metric_fields),
    "ebin, small lam": (EbinTerm(lam=3e-3), metric_fields),
    "normal": (NormalTerm(), unit_normals),
    "rotation": (RotationTerm(), quaternions),
    "flat": (Numbers(), numbers),
}
each_kernel = pytest.mark.parametrize(("term", "fields"), KERNELS.values(), ids=KERNELS)


def features(term, fields, precision):
    return features_of_fields(term, fields, WEIGHTS, precision)[0]


def distances(term, a, b, n_threads=1):
    def run(pair):
        return term.squared_distances(*pair[0], *pair[1], WEIGHTS)

    return threads.in_tiles(run, (a,), (b,), n_threads)


@each_kernel
@each_precision
def test_sums_agree_with_numpy(term, fields, precision):
    rows, columns = fields(23), fields(11)
    found = distances(term, *(features(term, one, precision) for one in (rows, columns)))
    every_pair = [v[:, None] for v in rows], [v[None] for v in columns]
    exact = np.sum(WEIGHTS * term.squared_dist(*every_pair), axis=-1)
    np.testing.assert_allclose(found, exact, rtol={"single": 1e-6, "double": 1e-14}[precision])


@each_kernel
@each_precision
def test_bits_do_not_depend_on_company(term, fields, precision):
    """Threads, tiles, neighbours and the order of a pair leave its distance alone."""
    a, b = (features(term, fields(n), precision) for n in (23, 11))
    whole = distances(term, a, b)
    np.testing.assert_array_equal(distances(term, a, b, n_threads=2), whole)
    np.testing.assert_array_equal(distances(term, b, a).T, whole)
    np.testing.assert_array_equal(distances(term, a[5:9], b[3:4]), whole[5:9, 3:4])
    np.testing.assert_array_equal(distances(term, np.asfortranarray(a), b[:]), whole)
    within = distances(term, a, a)
    np.testing.assert_array_equal(within, distances(term, a, a.copy()))
    np.testing.assert_array_equal(within, within.T)
    np.testing.assert_array_equal(np.diag(within), 0.0)
    # Tiles of eight points, as of the largest surfaces, which more threads have too.
    np.testing.assert_array_equal(distances(term, a, b, n_threads=9), whole)
    np.testing.assert_array_equal(distances(term, a, a, n_threads=9), within)
