"""sin²(½ min(π, θ)) by polynomials, without branches, in single and in double precision.

For small λ one polynomial is enough, fitted once for every λ.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from riemhuman.kernels.compiled import FUSED, compiled, evaluate, polynomial, split

LARGEST_LAMBDA = 0.01
"""Up to this λ the polynomials are exact to rounding errors."""

_DEGREES = {np.dtype(np.float32): 7, np.dtype(np.float64): 12}


def excess_at_pi(lam: float) -> float:
    """Return m_π, the value of cosh ℓ − 1 where θ = π.

    Parameters
    ----------
    lam : float
        λ > 0, at most `LARGEST_LAMBDA`.

    Returns
    -------
    float
    """
    return float(2.0 * np.sinh(np.pi * np.sqrt(2.0 * lam)) ** 2)


@cache
def half_angle_polynomial(lam: float, dtype: np.dtype) -> tuple[float, ...]:
    """Return the coefficients P of sin²(½θ) = z P(z), z = m/m_π in [0, 1].

    Parameters
    ----------
    lam : float
        λ > 0, at most `LARGEST_LAMBDA`.
    dtype : dtype
        float32 or float64: the precision of the coefficients, and for which they are enough.

    Returns
    -------
    tuple of float
        Coefficients, constant term first.
    """
    kappa, reach = 0.5 / np.sqrt(2.0 * lam), excess_at_pi(lam)

    def quotient(z: np.ndarray) -> np.ndarray:
        return np.sin(kappa * np.arcsinh(np.sqrt(0.5 * reach * z))) ** 2 / z

    fit = Chebyshev.interpolate(quotient, _DEGREES[dtype], domain=[0.0, 1.0])
    powers = fit.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
    return tuple(dtype.type(c) for c in powers.coef)


# sin²(a)/a² as a function of a² in [0, π²/4], to 1e-7 and 1e-16.
_sine = polynomial(
    (1.0, -0.333333343, 0.0444444194, -0.00317454338, 0.000141023731, -4.23364781e-06)
    + (8.13311729e-08,),
    (1.0, -0.3333333333333333, 0.04444444444444425, -0.0031746031746019434)
    + (0.0001410934744228115, -4.2755598235467655e-06, 9.396833899534907e-08)
    + (-1.5661323426627297e-09, 2.0469089716147505e-11, -2.1448942470805523e-13)
    + (1.6907591059828979e-15,),
)
# sin(2a)/(2a) as a function of a² in [0, π²/4]: the next term of the series is below 1e-17.
_DOUBLE_SINE = tuple((-4.0) ** k / math.factorial(2 * k + 1) for k in range(15))
# log(1 + f)/f for f in [√½ − 1, √2 − 1], to 1e-7 and 1e-16.
_logarithm = polynomial(
    (1.0, -0.49999997, 0.333341926, -0.25001353, 0.199559331, -0.165779904, 0.14977406)
    + (-0.14269276, 0.0853332356),
    (1.0, -0.4999999999999992, 0.3333333333332591, -0.25000000000033595, 0.20000000002057028)
    + (-0.16666666663491556, 0.14285714065188576, -0.1249999999679701, 0.11111122928967049)
    + (-0.10000012800878164, 0.09090558853866064, -0.08332649680408159, 0.07698139171184266)
    + (-0.07159308276300465, 0.06616915684158244, -0.060449282600514576, 0.06002360097192043)
    + (-0.0679349615676611, 0.06249763728523732, -0.027579240684232197),
)


@compiled(forceinline=True, fastmath=FUSED)
def half_angle(m: float, half_kappa: float) -> float:
    """Return sin²(½ min(π, θ)) of θ = κℓ and m = cosh ℓ − 1.

    Parameters
    ----------
    m : float
        At least 0. Where m² is beyond the largest number, the result is NaN.
    half_kappa : float
        ½κ.

    Returns
    -------
    float
    """
    real = type(m)
    growth = m + np.sqrt(m * (m + real(2.0)))
    exponent, scale = split(real(1.0) + growth)
    fraction = growth * scale + (scale - real(1.0))
    length = exponent * real(math.log(2.0)) + fraction * _logarithm(fraction)
    angle = half_kappa * length
    right = real(0.5 * math.pi)
    angle = angle if angle < right else right
    squared = angle * angle
    return squared * _sine(squared) + real(0.0) * growth


@compiled(forceinline=True, fastmath=FUSED)
def half_angle_and_slope(m: float, half_kappa: float) -> tuple[float, float]:
    """Return sin²(½ min(π, θ)), and its slope ½κ² (sin θ)/θ ℓ/sinh ℓ in m = cosh ℓ − 1.

    Parameters
    ----------
    m : float
        At least 0, see `half_angle`.
    half_kappa : float
        ½κ.

    Returns
    -------
    value, slope : float
    """
    # Keeps 0/0 from m = 0, where ℓ/sinh ℓ = 1.
    tiny = 1e-300
    sinh = np.sqrt(m * (m + 2.0))
    exponent, scale = split(1.0 + (m + sinh))
    fraction = (m + sinh) * scale + (scale - 1.0)
    length = exponent * math.log(2.0) + fraction * _logarithm(fraction)
    angle = half_kappa * length
    inside = angle < 0.5 * math.pi
    squared = angle * angle if inside else 0.25 * math.pi**2
    slope = (
        2.0 * half_kappa**2 * evaluate(_DOUBLE_SINE, squared) * ((length + tiny) / (sinh + tiny))
    )
    return squared * _sine(squared), slope if inside else 0.0


@compiled(forceinline=True, fastmath=FUSED)
def bounded_half_angle(m: float, inverse_reach: float, coefficients: tuple[float, ...]) -> float:
    """Return sin²(½ min(π, θ)) by `half_angle_polynomial`.

    Parameters
    ----------
    m : float
        cosh ℓ − 1.
    inverse_reach : float
        1/m_π.
    coefficients : tuple of float
        Coefficients of the polynomial.

    Returns
    -------
    float
    """
    real = type(m)
    share = m * inverse_reach
    share = share if share < real(1.0) else real(1.0)
    return share * evaluate(coefficients, share)
