"""Which blocks elimination fills."""

import numpy as np
import pytest
from scipy import linalg, sparse

from riemhuman.kernels.elimination import (
    WIDTH,
    SymmetricSolver,
    eliminate,
    elimination_of,
    solve_lower,
    solve_upper,
)


def arrow(tip):
    coupled = np.eye(7, dtype=bool)
    coupled[tip] = coupled[:, tip] = True
    return coupled


def scattered():
    coupled = np.random.default_rng(3).random((40, 40)) < 0.04
    return coupled | coupled.T | np.eye(40, dtype=bool)


# Which blocks of a matrix are not 0.
COUPLINGS = {
    "one block": np.eye(1, dtype=bool),
    "diagonal": np.eye(5, dtype=bool),
    "dense": np.ones((6, 6), dtype=bool),
    "chain": np.abs(np.subtract.outer(range(9), range(9))) <= 1,
    "arrow at the first": arrow(0),
    "arrow at the last": arrow(6),
    "random": scattered(),
}


def pattern_of(coupled):
    return elimination_of(sparse.bsr_array(np.kron(coupled, np.ones((3, 3))), blocksize=(3, 3)))


@pytest.mark.parametrize("kind", COUPLINGS)
def test_filled_blocks_are_those_of_a_dense_factor(kind):
    """No entries cancel where all beside the diagonal are negative."""
    coupled = COUPLINGS[kind]
    found = pattern_of(coupled)
    n = len(coupled)
    dense = np.where(coupled, -1.0, 0.0) + 2.0 * n * np.eye(n)
    expected = np.linalg.cholesky(dense[np.ix_(found.order, found.order)]) != 0.0
    filled = np.zeros((n, n), dtype=bool)
    filled[found.rows, found.columns] = True
    np.testing.assert_array_equal(filled, expected)
    assert len(found.rows) == filled.sum()


def test_arrows_are_eliminated_from_their_ends():
    """The tip last, or nothing would stay empty."""
    found = pattern_of(COUPLINGS["arrow at the first"])
    assert len(found.rows) == 2 * 7 - 1


def test_patterns_are_kept():
    assert pattern_of(COUPLINGS["chain"]) is pattern_of(COUPLINGS["chain"])


def positive_definite(coupled):
    """Return a matrix of random blocks, full ones, whose couplings are given."""
    n = len(coupled)
    rng = np.random.default_rng(n)
    dense = np.where(np.kron(coupled, np.ones((3, 3))), rng.standard_normal((3 * n, 3 * n)), 0.0)
    dense = dense + dense.T
    return dense + (1.0 - np.linalg.eigvalsh(dense)[0]) * np.eye(3 * n)


def factored(dense):
    """Return the elimination of a dense matrix, and what it leaves."""
    blocks = sparse.bsr_array(dense, blocksize=(3, 3))
    found = elimination_of(blocks)
    lower = np.zeros((len(found.rows), 9))
    lower[found.targets] = blocks.data.reshape(-1, 9)[found.sources]
    pivots = np.empty((len(found.order), 3))
    eliminate(found.ends, found.rows, found.columns, found.row_ends, found.by_row, lower, pivots)
    return found, lower, pivots


def ordered(dense, found):
    """Return a matrix in the order of elimination."""
    order = (3 * found.order[:, None] + np.arange(3)).ravel()
    return dense[np.ix_(order, order)]


@pytest.mark.parametrize("kind", COUPLINGS)
def test_factors_are_those_of_dense_matrices(kind):
    dense = positive_definite(COUPLINGS[kind])
    found, lower, pivots = factored(dense)
    expected = linalg.cholesky(ordered(dense, found), lower=True)
    n = len(pivots)
    whole = np.zeros((n, 3, n, 3))
    whole[found.rows, :, found.columns, :] = lower.reshape(-1, 3, 3).transpose(0, 2, 1)
    unit = np.tril(whole.reshape(3 * n, 3 * n), -1) + np.eye(3 * n)
    np.testing.assert_allclose(unit * np.sqrt(pivots.ravel()), expected, atol=1e-12)


@pytest.mark.parametrize("n_sides", [1, 4, WIDTH])
@pytest.mark.parametrize("kind", COUPLINGS)
def test_right_sides(kind, n_sides):
    """Both triangles one after the other, the pivots between them, are the inverse."""
    dense = positive_definite(COUPLINGS[kind])
    found, lower, pivots = factored(dense)
    x = np.random.default_rng(0).standard_normal((len(dense), n_sides))
    lanes = (0,) * n_sides if n_sides == WIDTH else None
    sides = x.reshape(len(pivots), -1).copy()
    solve_lower(found.ends, found.rows, lower, sides, lanes)
    sides.reshape(-1, n_sides)[:] /= pivots.reshape(-1, 1)
    solve_upper(found.ends, found.rows, lower, sides, lanes)
    solution = np.linalg.solve(ordered(dense, found), x)
    np.testing.assert_allclose(sides.reshape(x.shape), solution, rtol=1e-9, atol=1e-12)


def test_symmetric_systems():
    rng = np.random.default_rng(8)
    matrix = sparse.random_array((30, 30), density=0.1, rng=rng)
    matrix = matrix @ matrix.T + sparse.diags_array(rng.uniform(0.5, 2.0, 30))
    solver = SymmetricSolver(matrix)
    for shape in ((30,), (30, 1), (30, 8), (30, 9), (30, 21), (30, 0)):
        values = rng.standard_normal(shape)
        expected = np.linalg.solve(matrix.toarray(), values)
        np.testing.assert_allclose(solver.solve(values), expected, rtol=1e-11, atol=1e-12)
