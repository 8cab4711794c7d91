"""The polynomials of the half-angle for small λ, over their whole range, against mpmath."""

import numpy as np
import pytest
from mpmath import mp

from riemhuman.terms.half_angle_fit import (
    LARGEST_LAMBDA,
    bounded_half_angle,
    excess_at_pi,
    half_angle_polynomial,
)


@mp.workdps(40)
def exact(m, lam):
    theta = mp.acosh(1 + mp.mpf(float(m))) / (2 * mp.sqrt(2 * mp.mpf(lam)))
    return float(mp.sin(min(theta, mp.pi) / 2) ** 2)


@pytest.mark.parametrize(("real", "tolerance"), [(np.float32, 5e-7), (np.float64, 5e-15)])
@pytest.mark.parametrize("lam", [1e-8, 1e-6, 1e-4, 1e-3, LARGEST_LAMBDA])
def test_half_angle_over_its_whole_range(lam, real, tolerance):
    reach = excess_at_pi(lam)
    coefficients = half_angle_polynomial(lam, np.dtype(real))
    shares = np.concatenate([np.logspace(-20, -1, 100), np.linspace(0.1, 1.5, 1000), [1e20]])
    excesses = (reach * shares).astype(real)
    inverse_reach = real(1.0 / reach)
    found = [bounded_half_angle(m, inverse_reach, coefficients) for m in excesses]
    np.testing.assert_allclose(found, [exact(m, lam) for m in excesses], rtol=tolerance)
    assert bounded_half_angle(real(0.0), inverse_reach, coefficients) == 0.0


def test_reach_is_where_theta_is_pi():
    for lam in (1e-8, 1e-4, 0.01):
        theta = np.arccosh(1 + excess_at_pi(lam)) / (2 * np.sqrt(2 * lam))
        assert theta == pytest.approx(np.pi, rel=1e-7)
