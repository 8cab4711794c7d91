"""Which blocks elimination fills."""

import numpy as np
import pytest
from block_patterns import KINDS, couplings
from scipy import sparse

from riemhuman.kernels.elimination import elimination_of


def pattern_of(coupled):
    return elimination_of(sparse.bsr_array(np.kron(coupled, np.ones((3, 3))), blocksize=(3, 3)))


@pytest.mark.parametrize("kind", KINDS)
def test_filled_blocks_are_those_of_a_dense_factor(kind):
    """No entries cancel where all beside the diagonal are negative."""
    coupled = couplings(kind)
    found = pattern_of(coupled)
    n = len(coupled)
    dense = np.where(coupled, -1.0, 0.0) + 2.0 * n * np.eye(n)
    expected = np.linalg.cholesky(dense[np.ix_(found.order, found.order)]) != 0.0
    filled = np.zeros((n, n), dtype=bool)
    filled[found.rows, found.columns] = True
    np.testing.assert_array_equal(filled, expected)
    assert len(found.rows) == filled.sum()


@pytest.mark.parametrize("kind", KINDS)
def test_columns_begin_on_the_diagonal_and_rows_end_there(kind):
    found = pattern_of(couplings(kind))
    n = len(found.order)
    np.testing.assert_array_equal(found.rows[found.ends[:-1]], np.arange(n))
    np.testing.assert_array_equal(found.columns[found.by_row[found.row_ends[1:] - 1]], np.arange(n))
    np.testing.assert_array_equal(np.sort(found.by_row), np.arange(len(found.rows)))
    rows, columns = found.rows[found.by_row], found.columns[found.by_row]
    assert np.all(np.diff(rows * n + columns) > 0)
    for ends in (found.ends, found.row_ends):
        assert (ends[0], ends[-1]) == (0, len(found.rows))


def test_arrows_are_eliminated_from_their_ends():
    """The tip last, or nothing would stay empty."""
    found = pattern_of(couplings("arrow at the first"))
    assert len(found.rows) == 2 * 7 - 1


def test_patterns_are_kept():
    assert pattern_of(couplings("chain")) is pattern_of(couplings("chain"))
