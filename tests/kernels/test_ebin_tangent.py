"""Inner products of the Ebin metric, against their definition (equation 2, corrected)."""

import numpy as np
import oracles
import pytest
from ebin_matrices import LAMBDAS, N_PAIRS, matrices

from riemhuman.kernels import ebin_tangent, surface


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.mark.parametrize("lam", LAMBDAS)
def test_inner_product_agrees_with_its_definition(lam):
    rng = np.random.default_rng(7)
    g = matrices(N_PAIRS, 5.0, rng)
    a, b = ebin_tangent.symmetric_part(rng.normal(size=(2, *g.shape)))
    expected = [oracles.ebin_inner_product(x, y, m, lam) for x, y, m in zip(a, b, g, strict=True)]
    np.testing.assert_allclose(
        ebin_tangent.inner_product(a, b, g, lam), expected, rtol=1e-10, atol=1e-12
    )


def test_half_is_the_trace_of_the_square():
    rng = np.random.default_rng(8)
    g = matrices(N_PAIRS, 5.0, rng)
    a = ebin_tangent.symmetric_part(rng.normal(size=g.shape))
    velocity = np.linalg.solve(g, a)
    expected = np.trace(velocity @ velocity, axis1=1, axis2=2) * np.sqrt(np.linalg.det(g))
    np.testing.assert_allclose(ebin_tangent.inner_product(a, a, g, 0.5), expected, rtol=1e-12)


def test_squared_norms_of_anisotropic_matrices_are_not_negative():
    rng = np.random.default_rng(9)
    g = matrices(500, 1e12, rng)
    a = ebin_tangent.symmetric_part(rng.normal(size=g.shape))
    assert np.all(ebin_tangent.inner_product(a, a, g, 1e-4) > 0)


def test_whitening():
    rng = np.random.default_rng(10)
    g = matrices(N_PAIRS, 50.0, rng)
    a = ebin_tangent.symmetric_part(rng.normal(size=g.shape))
    factor = np.linalg.cholesky(g)
    inverse = np.linalg.inv(factor)
    white = ebin_tangent.whiten(a, g)
    np.testing.assert_allclose(
        white, inverse @ a @ np.swapaxes(inverse, 1, 2), rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(
        ebin_tangent.whiten(g, g), np.tile(np.eye(2), (N_PAIRS, 1, 1)), atol=1e-13
    )
    np.testing.assert_allclose(ebin_tangent.unwhiten(white, g), a, atol=1e-12)
    velocity = np.linalg.solve(g, a)
    np.testing.assert_allclose(
        ebin_tangent.trace(white), np.trace(velocity, axis1=1, axis2=2), rtol=1e-9
    )


def test_whitened_differential_is_the_differential_whitened():
    rng = np.random.default_rng(11)
    f_u, f_v, h_u, h_v = rng.standard_normal((4, N_PAIRS, 3))
    g = surface.first_fundamental_form(f_u, f_v)
    change = surface.first_fundamental_form_differential(f_u, f_v, h_u, h_v)
    found = ebin_tangent.whitened_differential(f_u, f_v, h_u, h_v)
    np.testing.assert_allclose(found, ebin_tangent.whiten(change, g), rtol=1e-10, atol=1e-11)
    np.testing.assert_array_equal(found, np.swapaxes(found, 1, 2))


def test_whitened_differential_of_slivers_keeps_digits():
    """Of δf_u = α f_u, δf_v = α f_v + β n × f_u/|f_u|: the strain 2αI and a change of height."""
    height = 10.0 ** -np.arange(1, 8)
    f_u = np.tile([0.6, 0.0, 0.8], (7, 1))
    up = np.tile([0.0, 1.0, 0.0], (7, 1))
    f_v = 0.7 * f_u + height[:, None] * up
    found = ebin_tangent.whitened_differential(f_u, f_v, 0.5 * f_u, 0.5 * f_v + 0.1 * f_v * up)
    np.testing.assert_allclose(found, np.tile(np.diag([1.0, 1.2]), (7, 1, 1)), atol=1e-15)
    of_matrices = ebin_tangent.whiten(
        surface.first_fundamental_form_differential(f_u, f_v, 0.5 * f_u, 0.6 * f_v),
        surface.first_fundamental_form(f_u, f_v),
    )
    assert np.abs(of_matrices[:, 1, 1] - 1.2).max() > 1e-6


def test_whitened_inner_product_is_that_of_the_identity():
    rng = np.random.default_rng(12)
    a, b = ebin_tangent.symmetric_part(rng.normal(size=(2, N_PAIRS, 2, 2)))
    expected = [oracles.ebin_inner_product(x, y, np.eye(2), 0.3) for x, y in zip(a, b, strict=True)]
    np.testing.assert_allclose(ebin_tangent.whitened_inner_product(a, b, 0.3), expected, atol=1e-13)
