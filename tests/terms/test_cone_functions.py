"""Functions of one number and of matrices in the closed forms of cones, against many digits."""

import numpy as np
import pytest
from autograd import grad
from oracles import mp

from riemhuman.kernels.sphere import sine_cardinal
from riemhuman.terms._cone_geodesics import hyperbolic_sine_cardinal, product_minus_square
from riemhuman.terms.cone import inverse_hyperbolic_sine_cardinal

VALUES = (-30.0, -2.0, -1e-3, -1e-9, 0.0, 1e-300, 1e-9, 1e-4, 0.5, 3.0, 50.0)


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (sine_cardinal, lambda x: mp.sin(x) / x if x else mp.mpf(1)),
        (hyperbolic_sine_cardinal, lambda x: mp.sinh(x) / x if x else mp.mpf(1)),
        (
            inverse_hyperbolic_sine_cardinal,
            lambda x: x / mp.sinh(x) if x else mp.mpf(1),
        ),
    ],
)
def test_cardinal_functions(function, exact):
    expected = [float(exact(mp.mpf(x))) for x in VALUES]
    np.testing.assert_allclose([function(x) for x in VALUES], expected, rtol=1e-14)
    np.testing.assert_allclose(function(np.array(VALUES)), expected, rtol=1e-14)
    assert grad(function)(0.0) == 0.0
    for x in (-2.0, 0.5, 3.0):
        slope = float(mp.diff(exact, x))
        np.testing.assert_allclose(grad(function)(x), slope, rtol=1e-12)
    assert abs(grad(function)(1e-9)) < 1e-6


def test_far_values_do_not_overflow():
    assert inverse_hyperbolic_sine_cardinal(1e4) == 0.0
    assert inverse_hyperbolic_sine_cardinal(-1e4) == 0.0


def test_product_minus_square_is_exact():
    rng = np.random.default_rng(0)
    c = rng.normal(size=1000)
    a = np.exp(rng.normal(size=1000))
    for gap in (1.0, 1e-6, 1e-14, 0.0):
        b = c**2 / a * (1 + gap * rng.uniform(size=1000))
        exact = [
            float(mp.mpf(x) * mp.mpf(y) - mp.mpf(z) ** 2) for x, y, z in zip(a, b, c, strict=True)
        ]
        np.testing.assert_allclose(product_minus_square(a, b, c), exact, rtol=1e-15)
        with pytest.raises(AssertionError):
            # What plain arithmetic would give.
            np.testing.assert_allclose(a * b - c**2, exact, rtol=1e-15)
    for argument, expected in ((0, 3.0), (1, 2.0), (2, -10.0)):
        assert grad(product_minus_square, argument)(2.0, 3.0, 5.0) == expected
