"""Sparse operators and differentials under autograd."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad, make_jvp
from scipy.sparse import random_array

from riemhuman.kernels.surface import apply_operator, differential, square_root


@pytest.mark.parametrize("leading", [(), (4,), (2, 3), (0,), (2, 0)])
def test_operators_and_their_derivatives(leading):
    operator = random_array((7, 5), density=0.5, rng=np.random.default_rng(0), format="csr")
    rng = np.random.default_rng(2)
    values, tangent = rng.normal(size=(2, *leading, 5, 3))
    weights = rng.normal(size=(*leading, 7, 3))
    expected = np.einsum("ij,...jk->...ik", operator.toarray(), values)
    np.testing.assert_allclose(apply_operator(operator, values), expected, atol=1e-14)

    def value(x):
        return anp.sum(weights * apply_operator(operator, x) ** 2)

    gradient = grad(value)(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, values)
    )
    np.testing.assert_allclose(gradient, expected, atol=1e-13)
    pushed = make_jvp(lambda x: apply_operator(operator, x))(values)(tangent)[1]
    np.testing.assert_allclose(pushed, apply_operator(operator, tangent), atol=1e-14)
    # Of second order.
    second = grad(lambda x: anp.sum(tangent * grad(value)(x)))(values)
    expected = 2 * np.einsum(
        "ij,...ik->...jk", operator.toarray(), weights * apply_operator(operator, tangent)
    )
    np.testing.assert_allclose(second, expected, atol=1e-12)


def test_differential():
    def cube_sums(x):
        return anp.stack([anp.sum(x**3, axis=-1), x[..., 0] * x[..., 1]], axis=-1)

    x, v = np.random.default_rng(3).normal(size=(2, 4, 3))
    expected = np.stack(
        [np.sum(3 * x**2 * v, axis=-1), x[:, 0] * v[:, 1] + x[:, 1] * v[:, 0]], axis=-1
    )
    np.testing.assert_allclose(differential(cube_sums, v, x), expected, atol=1e-14)
    by_vector = grad(lambda w: anp.sum(differential(cube_sums, w, x)))(v)
    by_point = grad(lambda p: anp.sum(differential(cube_sums, v, p)))(x)
    np.testing.assert_allclose(by_vector, 3 * x**2 + x[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)
    np.testing.assert_allclose(by_point, 6 * x * v + v[:, [1, 0, 2]] * [1, 1, 0], atol=1e-13)


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


def test_square_root():
    np.testing.assert_array_equal(square_root(np.array([0.0, 4.0, -1e-17])), [0.0, 2.0, 0.0])
    np.testing.assert_array_equal(
        [grad(square_root)(x) for x in (0.0, 4.0, -1e-17)], [0.0, 0.25, 0.0]
    )
    np.testing.assert_allclose(grad(grad(square_root))(4.0), -1 / 32)
    assert grad(grad(square_root))(0.0) == 0.0
