"""In preconditioned variables the energy of paths in a flat space is a sum of squares."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.solvers.preconditioner import CholeskyFactor, PathPreconditioner


def positive_matrix(size, rng=0, rank=None):
    root = np.random.default_rng(rng).standard_normal((size, rank or size))
    return root @ root.T


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_factor_solves(scale):
    matrix = scale * positive_matrix(6)
    factor = CholeskyFactor(matrix)
    columns = np.random.default_rng(1).standard_normal((6, 4))
    solution = factor.solve_transposed(factor.solve(columns))
    np.testing.assert_allclose(matrix @ solution, columns, atol=1e-4)
    inverse_root = factor.solve(np.eye(6))
    np.testing.assert_allclose(inverse_root @ matrix @ inverse_root.T, np.eye(6), atol=1e-5)
    np.testing.assert_allclose(factor.solve_transposed(np.eye(6)), inverse_root.T, rtol=1e-12)


def test_singular_matrices_get_a_ridge():
    for matrix in (positive_matrix(5, rank=3), np.zeros((5, 5))):
        assert np.all(np.isfinite(CholeskyFactor(matrix).solve(np.eye(5))))


@pytest.mark.parametrize("entry", [-1.0, np.nan])
def test_indefinite_matrices_are_refused(entry):
    with pytest.raises(ArgumentError, match="not positive semidefinite, or not finite.*check_metr"):
        CholeskyFactor(np.diag([1.0, entry, 1.0]))


def test_what_is_not_finite_is_passed_on():
    factor = CholeskyFactor(positive_matrix(3))
    for solve in (factor.solve, factor.solve_transposed):
        assert not np.isfinite(solve(np.full((3, 1), np.nan))).any()


def hessian_in_variables(gram, n_segments, assumed_gram):
    """Return the Hessian in β of n Σ (x_{i+1} − x_i)ᵀ G (x_{i+1} − x_i), ends fixed."""
    change = PathPreconditioner(CholeskyFactor(assumed_gram), n_segments)
    shape = (n_segments - 1, len(gram))

    def gradient(coefficients):
        path = np.pad(coefficients, ((1, 1), (0, 0)))
        steps = np.diff(path, axis=0) @ gram
        return -2.0 * n_segments * np.diff(steps, axis=0)

    columns = []
    for unit in np.eye(np.prod(shape)):
        columns.append(change.gradient(gradient(change.coefficients(unit.reshape(shape)))).ravel())
    return np.stack(columns)


@pytest.mark.parametrize("n_segments", [2, 3, 10])
def test_hessian_is_the_identity(n_segments):
    gram = positive_matrix(4)
    hessian = hessian_in_variables(gram, n_segments, gram)
    np.testing.assert_allclose(hessian, np.eye(len(hessian)), atol=1e-6)


def test_hessian_with_another_gram_matrix_is_not():
    hessian = hessian_in_variables(positive_matrix(4), 10, positive_matrix(4, rng=5))
    assert np.abs(hessian - np.eye(len(hessian))).max() > 0.1


def test_gradient_is_the_transpose_of_coefficients():
    change = PathPreconditioner(CholeskyFactor(positive_matrix(4)), 6)
    rng = np.random.default_rng(2)
    variables, slopes = rng.standard_normal((2, 5, 4))
    np.testing.assert_allclose(
        np.sum(change.coefficients(variables) * slopes),
        np.sum(variables * change.gradient(slopes)),
        rtol=1e-12,
    )


@pytest.mark.parametrize("n_segments", [2, 3, 10])
def test_inverse_of_the_hessian(n_segments):
    """Both triangles at once do what the change of variables does in two steps."""
    rng = np.random.default_rng(3)
    factor = CholeskyFactor(positive_matrix(4))
    change = PathPreconditioner(factor, n_segments)
    gradient = rng.standard_normal((n_segments - 1, 4))
    np.testing.assert_allclose(
        change.inverse(gradient), change.coefficients(change.gradient(gradient)), rtol=1e-9
    )
