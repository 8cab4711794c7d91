"""Cholesky factors of metrics, and inverse Hessians of paths."""

import numpy as np
import pytest
from cases import CASES, HalfPlane, cases_that, name_of, sphere_template
from scipy import sparse

from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric
from riemhuman.solvers import _preconditioners
from riemhuman.solvers._preconditioners import (
    BlockCholeskyFactor,
    DenseCholeskyFactor,
    PathPreconditioner,
    SparseCholeskyFactor,
    metric_factor,
)

RIDGE = _preconditioners._RIDGE


def positive_matrix(size, rng=0, rank=None):
    root = np.random.default_rng(rng).standard_normal((size, rank or size))
    return root @ root.T


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_factor_solves(scale):
    matrix = scale * positive_matrix(6)
    factor = DenseCholeskyFactor(matrix)
    columns = np.random.default_rng(1).standard_normal((6, 4))
    np.testing.assert_allclose(matrix @ factor.inverse(columns), columns, atol=1e-4)


def test_singular_gram_matrices_get_a_ridge():
    for matrix in (positive_matrix(5, rank=3), np.zeros((5, 5))):
        assert np.all(np.isfinite(DenseCholeskyFactor(matrix).inverse(np.eye(5))))


@pytest.mark.parametrize("entry", [-1.0, np.nan])
def test_indefinite_gram_matrices_raise(entry):
    with pytest.raises(ArgumentError, match="not positive semidefinite, or not finite.*check_metr"):
        DenseCholeskyFactor(np.diag([1.0, entry, 1.0]))


@pytest.mark.parametrize("n_segments", [2, 3, 10])
def test_inverse_of_the_hessian_of_paths(n_segments):
    """Of n Σ (x_{i+1} − x_i)ᵀ G (x_{i+1} − x_i), ends fixed."""
    gram = positive_matrix(4)
    preconditioner = PathPreconditioner(DenseCholeskyFactor(gram), n_segments)
    coefficients = np.random.default_rng(2).standard_normal((n_segments - 1, 4))
    steps = np.diff(np.pad(coefficients, ((1, 1), (0, 0))), axis=0) @ gram
    gradient = -2.0 * n_segments * np.diff(steps, axis=0)
    found = preconditioner(gradient.ravel())
    np.testing.assert_allclose(found, coefficients.ravel(), rtol=1e-5)


def quotients(factor, matrix):
    """Return the eigenvalues of A⁻¹ M, ascending: nearly 1 where M is not nearly singular."""
    return np.sort(np.linalg.eigvals(factor.inverse(matrix @ np.eye(len(matrix)))).real)


def check_symmetric(factor, size):
    x, y = np.random.default_rng(0).standard_normal((2, size, 3))
    np.testing.assert_allclose(
        np.sum(factor.inverse(x) * y), np.sum(x * factor.inverse(y)), rtol=1e-6
    )


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_sparse_factor(scale):
    rng = np.random.default_rng(1)
    root = sparse.random_array((42, 42), density=0.05, rng=rng) + 2 * sparse.eye_array(42)
    matrix = scale * sparse.csr_array(root @ root.T)
    factor = SparseCholeskyFactor(matrix)
    np.testing.assert_allclose(factor.inverse(matrix.toarray()), np.eye(42), atol=30 * RIDGE)
    check_symmetric(factor, 42)


@pytest.mark.parametrize("scale", [1e-60, 1.0, 1e60])
def test_factor_in_single_precision(scale):
    """It is as good in any unit, for right sides of any size."""
    root = sparse.random_array((42, 42), density=0.05, rng=np.random.default_rng(1))
    matrix = sparse.csr_array(root @ root.T + sparse.eye_array(42))
    sides = np.random.default_rng(2).standard_normal((42, 9))
    expected = SparseCholeskyFactor(matrix).inverse(sides)
    for size in (1e-60, 1e60):
        found = SparseCholeskyFactor(scale * matrix, single=True).inverse(size * sides)
        np.testing.assert_allclose(found * (scale / size), expected, rtol=0, atol=1e-5)
    assert np.all(SparseCholeskyFactor(matrix, single=True).inverse(0.0 * sides) == 0.0)


@pytest.mark.parametrize("n_sides", [1, 4, 9, 16, 20, 27, 45])
def test_right_sides_need_not_be_solved_for_together(n_sides):
    """Nor lie in one order in memory; some numbers of them are filled up with zeros."""
    root = sparse.random_array((42, 42), density=0.05, rng=np.random.default_rng(1))
    factor = SparseCholeskyFactor(sparse.csr_array(root @ root.T + sparse.eye_array(42)))
    sides = np.random.default_rng(2).standard_normal((n_sides, 42)).T
    one_by_one = np.hstack([factor.inverse(side[:, None].copy()) for side in sides.T])
    np.testing.assert_allclose(factor.inverse(sides), one_by_one, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("scale", [0.0, 1e-9, 1e6])
def test_singular_matrices_get_a_ridge(scale):
    matrix = scale * sparse.csr_array(np.ones((6, 6)))
    check_symmetric(SparseCholeskyFactor(matrix), 6)
    check_symmetric(BlockCholeskyFactor(matrix.toarray().reshape(1, 6, 6)), 6)


@pytest.mark.parametrize("entry", [-1.0, np.nan, np.inf])
def test_indefinite_matrices_are_refused(entry):
    dense = np.ones((6, 6)) + np.eye(6)
    dense[4, 4] = entry
    with pytest.raises(ArgumentError, match="not positive semidefinite, or not finite"):
        SparseCholeskyFactor(sparse.csr_array(dense))
    if np.isfinite(entry):
        with pytest.raises(ArgumentError, match="not positive semidefinite, or not finite"):
            BlockCholeskyFactor(np.stack([np.eye(6), dense]))


@pytest.mark.parametrize("name", ["all sphere", "stretch open", "srnf triangle"])
def test_surface_metrics_give_their_matrix(name):
    """In the directions that the metric sees, the factor makes it the identity."""
    metric, points = CASES[name].metric, CASES[name].points[:2]
    matrix = metric.metric_matrix(points) / 3.0
    factor = metric_factor(metric, points, 3.0)
    assert isinstance(factor, SparseCholeskyFactor)
    values = quotients(factor, matrix.toarray())
    assert values.max() < 1.0
    seen = np.linalg.eigvalsh(matrix.toarray()) > 0.05 * matrix.diagonal().mean()
    assert np.sum(values > 0.97) >= np.sum(seen) > 0


def test_steps_are_short_where_a_triangle_is_nearly_flat():
    """Also those that flatten it, which a metric of normals does not see; elsewhere they are not.

    Of the same pulls at a corner of the triangle and at the vertex farthest away.
    """
    template = sphere_template()
    metric = ElasticMetric(AlignedSurfaces(template, equip=False), a=0.0, lam=0.0, c=1.0)
    corner, *edge = template.faces[0]
    middle = template.vertices[edge].mean(axis=0)
    inward = middle - template.vertices[corner]
    farthest = np.argmax(np.linalg.norm(template.vertices - middle, axis=1))

    def ratio_of_steps(height):
        surface = template.vertices.copy()
        surface[corner] = middle - height * inward
        factor = metric_factor(metric, surface[None], stiffness=0.2)
        steps = []
        for vertex in (corner, farthest):
            pull = np.zeros_like(surface)
            pull[vertex] = inward
            steps.append(factor(pull.ravel()).reshape(-1, 3)[vertex] @ inward)
        return steps[0] / steps[1]

    assert ratio_of_steps(1.0) == pytest.approx(1.0, rel=0.1)
    assert ratio_of_steps(1e-3) < 0.1


def dense_matrix(metric, point):
    units = np.eye(point.size).reshape(-1, *point.shape)
    tangent = metric.space.to_tangent(units, point + np.zeros_like(units))
    images = metric.covector(tangent, point + np.zeros_like(units))
    return images.reshape(point.size, point.size)


# A product hides which coordinates belong together.
FIELDS = [case for case in cases_that("geodesic") if len(case.space.shape) > 1]


@pytest.mark.parametrize("case", FIELDS, ids=name_of)
def test_blocks_are_exact_on_fields(case):
    """On the tangent space, whose other directions carry no weight."""
    matrix = dense_matrix(case.metric, case.points[0])
    factor = metric_factor(case.metric, case.points[:1], 1.0)
    values = quotients(factor, matrix)
    is_zero = values < 1e-6
    np.testing.assert_allclose(values[~is_zero], 1.0, atol=2e-3)
    assert np.sum(~is_zero) == case.space.dim


@pytest.mark.parametrize("case", cases_that(), ids=name_of)
def test_factors_exist_for_every_metric(case):
    factor = metric_factor(case.metric, case.points, 1.0)
    check_symmetric(factor, case.points[0].size)


def test_small_points_are_one_block():
    class Skewed(RiemannianMetric):
        def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
            a, b = tangent_vec_a, tangent_vec_b
            return (
                2.0 * a[..., 0] * b[..., 0]
                + 0.9 * (a[..., 0] * b[..., 1] + a[..., 1] * b[..., 0])
                + a[..., 1] * b[..., 1]
                + 0.0 * base_point[..., 0]
            )

    factor = metric_factor(Skewed(HalfPlane()), np.ones((1, 2)), 1.0)
    matrix = np.array([[2.0, 0.9], [0.9, 1.0]])
    np.testing.assert_allclose(quotients(factor, matrix), 1.0, atol=1e-2)
