"""The fits of angles and lengths against mpmath, over their whole range, in both precisions."""

import numpy as np
import pytest
from mpmath import mp
from numba import njit

from riemhuman.terms import _polynomial_fits as fits

PRECISIONS = {"single": np.float32, "double": np.float64}
each_precision = pytest.mark.parametrize("precision", PRECISIONS)
ROUNDING = {name: float(np.finfo(real).eps) for name, real in PRECISIONS.items()}
LAMBDAS = [1e-8, 1e-4, 0.02, 1.0, 1e4]


def relative_errors(function, exact, arguments, real):
    """Return the relative errors of a function at arguments rounded to a precision."""
    arguments = np.asarray(arguments).astype(real)
    found = np.array([function(x) for x in arguments], dtype=np.float64)
    with mp.workdps(40):
        expected = np.array([float(exact(mp.mpf(float(x)))) for x in arguments])
    return np.abs(found - expected) / np.abs(expected)


@njit
def half_angle(m, quarter, double):
    """Return sin²(½ min(π, ψ)) of ψ² = 4 · quarter · ℓ²."""
    squared, _ = fits.squared_length_and_slope(m, double)
    return fits.half_sine_squared_and_slope(quarter * squared, double)[0]


def as_compiled(function):
    """Return a compiled call of a function that compiled ones inline."""
    return njit(lambda *given: function(*given))


squared_arc_and_slope = as_compiled(fits.squared_arc_and_slope)
half_sine_of_share = as_compiled(fits.half_sine_of_share)


@each_precision
def test_short_arcs(precision):
    real = PRECISIONS[precision]
    double = fits.PRECISION[np.dtype(real)]
    chords = np.concatenate([np.logspace(-30, -1, 50), np.linspace(0.1, 2.0, 100)])
    errors = relative_errors(
        lambda p: squared_arc_and_slope(p, True, double)[0],
        lambda p: (2 * mp.asin(mp.sqrt(p) / 2)) ** 2,
        chords,
        real,
    )
    assert errors.max() < 3 * ROUNDING[precision]


@pytest.mark.everyday("1e-08-double", "1.0-double", "1.0-single")
@each_precision
@pytest.mark.parametrize("lam", LAMBDAS)
def test_half_angles(precision, lam):
    real = PRECISIONS[precision]
    double, quarter = fits.PRECISION[np.dtype(real)], real(1.0 / (32.0 * lam))

    def exact(m):
        half = mp.sqrt(mp.mpf(float(quarter))) * 2 * mp.asinh(mp.sqrt(m / 2))
        return mp.sin(min(half, mp.pi / 2)) ** 2

    errors = relative_errors(
        lambda m: half_angle(m, quarter, double), exact, np.logspace(-28, 18, 100), real
    )
    assert errors.max() < 16 * ROUNDING[precision]
    assert half_angle(real(0.0), quarter, double) == 0.0


def test_an_excess_whose_square_overflows_is_nan():
    """Pairs in single precision are then computed again in double precision."""
    double = fits.PRECISION[np.dtype(np.float32)]
    assert np.isnan(half_angle(np.float32(1e25), np.float32(0.01), double))
    assert half_angle(1e25, 1e-6, fits.YES) < 1.0


@pytest.mark.parametrize(("real", "tolerance"), [(np.float32, 5e-7), (np.float64, 5e-15)])
@pytest.mark.parametrize("lam", [1e-8, 1e-6, 1e-4, 1e-3, fits.LARGEST_RATIO])
def test_half_angles_for_a_small_ratio(lam, real, tolerance):
    reach, coefficients = fits.excess_at_pi(lam), fits.half_angle_fit(lam, np.dtype(real))
    inverse = real(1.0 / reach)
    shares = np.concatenate([np.logspace(-20, -1, 40), np.linspace(0.1, 1.5, 80), [1e20]])

    def found(m):
        return half_sine_of_share(m * inverse, coefficients)

    def exact(m):
        theta = mp.acosh(1 + m) / (2 * mp.sqrt(2 * mp.mpf(lam)))
        return mp.sin(min(theta, mp.pi) / 2) ** 2

    assert relative_errors(found, exact, reach * shares, real).max() < tolerance
    theta = np.arccosh(1 + reach) / (2 * np.sqrt(2 * lam))
    assert theta == pytest.approx(np.pi, rel=1e-7)
