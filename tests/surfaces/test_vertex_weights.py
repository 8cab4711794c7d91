"""Weighted inner products, and Gram-Schmidt rows in them."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.surfaces.vertex_weights import (
    normalized_weights,
    orthonormal_rows,
    vectors_of_rows,
    weighted_rows,
)

RNG = np.random.default_rng(0)
VECTORS = RNG.normal(size=(4, 7, 3))
WEIGHTS = normalized_weights(RNG.uniform(0.5, 2.0, 7), 7)


def test_weights_have_mean_one_and_stay_as_they_are():
    assert WEIGHTS.mean() == pytest.approx(1.0, rel=1e-15)
    assert not WEIGHTS.flags.writeable
    np.testing.assert_allclose(normalized_weights(5 * WEIGHTS, 7), WEIGHTS, rtol=1e-15)
    assert normalized_weights(None, 7) is None


@pytest.mark.parametrize("weights", [None, WEIGHTS])
def test_rows_carry_the_inner_product_and_lead_back(weights):
    rows = weighted_rows(VECTORS, weights)
    factors = np.ones(7) if weights is None else weights
    expected = np.einsum("ivx,jvx,v->ij", VECTORS, VECTORS, factors)
    np.testing.assert_allclose(rows @ rows.T, expected, rtol=1e-12)
    np.testing.assert_allclose(vectors_of_rows(rows, weights), VECTORS, rtol=1e-14)


def test_orthonormal_rows_are_those_of_gram_and_schmidt():
    rows = weighted_rows(VECTORS, None) * np.array([1e-9, 1.0, 1e9, 1.0])[:, np.newaxis]
    found = orthonormal_rows(rows, "rows")
    done = []
    for row in rows:
        for other in done:
            row = row - (other @ row) * other
        done.append(row / np.linalg.norm(row))
    np.testing.assert_allclose(found, done, atol=1e-14)
    assert found.flags.c_contiguous


@pytest.mark.parametrize(
    ("rows", "rank"),
    [
        ([[1.0, 2.0, 3.0], [2.0, 4.0, 6.0]], 1),
        ([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], 1),
        ([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]], 2),
        ([[0.0, 0.0]], 0),
    ],
)
def test_dependent_rows_are_refused_with_their_rank(rows, rank):
    with pytest.raises(ArgumentError, match=rf"rank of these {len(rows)} is {rank}"):
        orthonormal_rows(np.array(rows), "rows")


@pytest.mark.parametrize(
    ("weights", "error", "message"),
    [
        (np.ones(6), ArgumentError, r"vertex_weights must have shape \(7\)"),
        ([1, 1, 0, 1, 1, 1, -2], ArgumentError, r"vertex_weights\[2\] = 0.0 is not positive"),
        ([1, 1, np.nan, 1, 1, 1, 1], ArgumentError, "NaN"),
        (["heavy"] * 7, ArgumentTypeError, "vertex_weights"),
    ],
)
def test_weights_refused(weights, error, message):
    with pytest.raises(error, match=message):
        normalized_weights(weights, 7)
