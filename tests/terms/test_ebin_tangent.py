"""Inner products of the Ebin metric, against their definition (equation 2, corrected)."""

import ebin_matrices
import numpy as np
import oracles
import pytest
from ebin_matrices import LAMBDAS, N_PAIRS, matrices

from riemhuman.terms import _cone_geodesics


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.mark.parametrize("lam", LAMBDAS)
def test_inner_product_agrees_with_its_definition(lam):
    rng = np.random.default_rng(7)
    g = matrices(N_PAIRS, 5.0, rng)
    a, b = _cone_geodesics.symmetric_part(rng.normal(size=(2, *g.shape)))
    expected = [oracles.ebin_inner_product(x, y, m, lam) for x, y, m in zip(a, b, g, strict=True)]
    np.testing.assert_allclose(
        ebin_matrices.inner_product(a, b, g, lam), expected, rtol=1e-10, atol=1e-12
    )


def test_squared_norms_of_anisotropic_matrices_are_not_negative():
    rng = np.random.default_rng(9)
    g = matrices(500, 1e12, rng)
    a = _cone_geodesics.symmetric_part(rng.normal(size=g.shape))
    assert np.all(ebin_matrices.inner_product(a, a, g, 1e-4) > 0)


def test_whitening():
    rng = np.random.default_rng(10)
    g = matrices(N_PAIRS, 50.0, rng)
    a = _cone_geodesics.symmetric_part(rng.normal(size=g.shape))
    factor = np.linalg.cholesky(g)
    inverse = np.linalg.inv(factor)
    white = _cone_geodesics.whiten(a, g)
    np.testing.assert_allclose(
        white, inverse @ a @ np.swapaxes(inverse, 1, 2), rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(
        _cone_geodesics.whiten(g, g), np.tile(np.eye(2), (N_PAIRS, 1, 1)), atol=1e-13
    )
    np.testing.assert_allclose(_cone_geodesics.unwhiten(white, g), a, atol=1e-12)
    velocity = np.linalg.solve(g, a)
    np.testing.assert_allclose(
        _cone_geodesics.trace(white), np.trace(velocity, axis1=1, axis2=2), rtol=1e-9
    )
