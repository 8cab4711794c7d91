"""Angles and hyperbolic distances by polynomials, without branches, in both precisions.

Loops over pairs call them with the `PRECISION` of their features. NumPy's functions would be called
once for each number: measured in such loops, squared angles take 30 times as long in single
precision and 10 times in double, logarithms 4 and 2, sines 7 and 4.
"""

from __future__ import annotations

import math
from functools import cache
from typing import TypeAlias

import numpy as np
from numpy.polynomial import Chebyshev, Polynomial

from riemhuman.arrays import Array
from riemhuman.kernels.compilation import FUSED, compiled


def _in_single(*coefficients: float) -> tuple[float, ...]:
    # Single-precision numbers, which type checkers do not count as float.
    return tuple(np.array(coefficients, dtype=np.float32))


# fmt: off
# θ²/p for p in [0, 2]; the largest relative errors are 1e-8 and 1e-16.
_SINGLE_ARC = _in_single(
    1.0, 0.0833329484, 0.0111162076, 0.00176024658, 0.000380191312, -2.4703817e-05,
    7.68320388e-05, -2.45728515e-05, 5.56007217e-06,
)
_ARC = (
    1.0, 0.0833333333333205, 0.011111111111878005, 0.0017857142675714339, 0.00031746054353039055,
    6.012334749789467e-05, 1.190145497780534e-05, 2.3980475012020936e-06, 5.842167643945109e-07,
    -3.5749647809176705e-08, 2.2820448805102648e-07, -2.1628319740394816e-07,
    1.8342623990398518e-07, -1.1331536542028546e-07, 5.278573124328368e-08,
    -1.7707505291974977e-08, 4.091256168225173e-09, -5.823618089617082e-10,
    3.9471653680487684e-11,
)
# log(1 + f)/f for f in [√½ − 1, √2 − 1], to 1e-7 and 1e-16.
_SINGLE_LOGARITHM = _in_single(
    1.0, -0.49999997, 0.333341926, -0.25001353, 0.199559331, -0.165779904, 0.14977406,
    -0.14269276, 0.0853332356,
)
_LOGARITHM = (
    1.0, -0.4999999999999992, 0.3333333333332591, -0.25000000000033595, 0.20000000002057028,
    -0.16666666663491556, 0.14285714065188576, -0.1249999999679701, 0.11111122928967049,
    -0.10000012800878164, 0.09090558853866064, -0.08332649680408159, 0.07698139171184266,
    -0.07159308276300465, 0.06616915684158244, -0.060449282600514576, 0.06002360097192043,
    -0.0679349615676611, 0.06249763728523732, -0.027579240684232197,
)
# sin²(a)/a² as a function of a² in [0, π²/4], to 1e-7 and 1e-16.
_SINGLE_SINE = _in_single(
    1.0, -0.333333343, 0.0444444194, -0.00317454338, 0.000141023731, -4.23364781e-06,
    8.13311729e-08,
)
_SINE = (
    1.0, -0.3333333333333333, 0.04444444444444425, -0.0031746031746019434, 0.0001410934744228115,
    -4.2755598235467655e-06, 9.396833899534907e-08, -1.5661323426627297e-09,
    2.0469089716147505e-11, -2.1448942470805523e-13, 1.6907591059828979e-15,
)
# fmt: on
# sin(2a)/(2a) as a function of a² in [0, π²/4]: the next term of the series is below 1e-17.
_DOUBLE_SINE = tuple((-4.0) ** k / math.factorial(2 * k + 1) for k in range(15))

_LOWEST_SINGLE = np.float32(math.sqrt(0.5)).view(np.int32)
_LOWEST = np.float64(math.sqrt(0.5)).view(np.int64)

LARGEST_RATIO = 0.01
"""Up to this b/a one polynomial in cosh ℓ − 1 is exact to rounding, see `half_angle_fit`."""

_DEGREES = {np.dtype(np.float32): 7, np.dtype(np.float64): 12}


Flag: TypeAlias = tuple[float, ...]
"""What loops are told by a tuple that is empty or not.

Lengths of tuples are known when loops are compiled: branches that are not taken are left out.
"""

NO: Flag = ()
YES: Flag = (1.0,)  # unlike a bool, never a part of the type

PRECISION = {np.dtype(np.float32): NO, np.dtype(np.float64): YES}
"""Whether the precision of features is double, for the functions below.

Slopes, which paths alone need, are NaN in single precision.
"""


# Longer loops over coefficients are not unrolled, and loops around them not vectorised.
_UNROLLED = 10


@compiled(forceinline=True, fastmath=FUSED)
def polynomial(coefficients: tuple[float, ...], x: float) -> float:
    """Return the polynomial in x, by Horner's rule; the constant term comes first."""
    value = coefficients[-1]
    for k in range(len(coefficients) - 2, -1, -1):
        value = value * x + coefficients[k]
    return value


@compiled(forceinline=True, fastmath=FUSED)
def long_polynomial(coefficients: tuple[float, ...], x: float) -> float:
    """Return the `polynomial` of more than `_UNROLLED` + 1 coefficients."""
    value = polynomial(coefficients[_UNROLLED:], x)
    for k in range(_UNROLLED - 1, -1, -1):
        value = value * x + coefficients[k]
    return value


@compiled(forceinline=True, fastmath=FUSED)
def squared_arc_and_slope(chord: float, acute: bool, double: Flag) -> tuple[float, float]:
    """Return θ² and |dθ²/dp| = θ/sin θ of unit vectors n and m."""
    # By the shorter squared chord p ≤ 2, from n to m if `acute`, else from n to −m:
    # θ² = p Q(p) or (π − √(p Q(p)))². At antipodal vectors the slope is set to 0.
    real = type(chord)
    if len(double) == 0:
        squared = chord * polynomial(_SINGLE_ARC, chord)
        slope = obtuse = real(math.nan)
        angle = real(math.pi) - np.sqrt(squared)
    else:
        quotient = real(long_polynomial(_ARC, chord))
        squared, rest = chord * quotient, real(4.0) - chord
        angle = real(math.pi) - np.sqrt(squared)
        # sin θ = ½ √(p (4 − p)).
        slope = real(2.0) * np.sqrt(quotient / rest)
        obtuse = real(2.0) * angle / np.sqrt(chord * rest) if chord > real(0.0) else real(0.0)
    return (squared, slope) if acute else (angle * angle, obtuse)


@compiled(forceinline=True, fastmath=FUSED)
def _split(x: float, double: Flag) -> tuple[float, float]:
    """Return k and 2⁻ᵏ, for x > 0, such that 2⁻ᵏ x lies in [√½, √2), from the bits of x."""
    if len(double) > 0:
        k = (np.float64(x).view(np.int64) - _LOWEST) >> 52
        return type(x)(k), type(x)(np.int64((1023 - k) << 52).view(np.float64))
    bits = np.int32(np.float32(x).view(np.int32) - _LOWEST_SINGLE)
    power = np.int32(bits >> np.int32(23))
    scale = np.int32(np.int32(np.int32(127) - power) << np.int32(23))
    return type(x)(power), type(x)(np.int32(scale).view(np.float32))


@compiled(forceinline=True, fastmath=FUSED)
def hyperbolic_length(m: float, sinh: float, double: Flag) -> float:
    """Return ℓ = log(1 + m + sinh ℓ), where m = cosh ℓ − 1; NaN where sinh ℓ overflows."""
    real = type(m)
    growth = m + sinh
    exponent, scale = _split(real(1.0) + growth, double)
    fraction = growth * scale + (scale - real(1.0))
    if len(double) == 0:
        quotient = polynomial(_SINGLE_LOGARITHM, fraction)
    else:
        quotient = real(long_polynomial(_LOGARITHM, fraction))
    return exponent * real(math.log(2.0)) + fraction * quotient + real(0.0) * growth


@compiled(forceinline=True, fastmath=FUSED)
def squared_length_and_slope(m: float, double: Flag) -> tuple[float, float]:
    """Return ℓ² and dℓ²/dm = 2ℓ/sinh ℓ, where m = cosh ℓ − 1 ≥ 0; NaN where m² overflows."""
    real = type(m)
    tiny = real(1e-30)  # keeps 0/0 from m = 0, where ℓ/sinh ℓ = 1
    sinh = np.sqrt(m * (m + real(2.0)))
    length = hyperbolic_length(m, sinh, double)
    return length * length, real(2.0) * (length + tiny) / (sinh + tiny)


@compiled(forceinline=True, fastmath=FUSED)
def half_sine_squared_and_slope(squared: float, double: Flag) -> tuple[float, float]:
    """Return sin²(min(½ψ, ½π)), and its slope in ¼ψ²."""
    real = type(squared)
    limit = real(0.25 * math.pi**2)
    inside = squared < limit
    # In this order, NaN stays NaN.
    squared = limit if squared > limit else squared
    if len(double) == 0:
        value, slope = polynomial(_SINGLE_SINE, squared), real(math.nan)
    else:
        value = real(polynomial(_SINE, squared))
        slope = real(long_polynomial(_DOUBLE_SINE, squared))
    return squared * value, slope if inside else real(0.0)


@compiled(forceinline=True, fastmath=FUSED)
def half_sine_of_share(share: float, fit: tuple[float, ...]) -> float:
    """Return sin²(min(½ψ, ½π)) by a `half_angle_fit`."""
    real = type(share)
    share = share if share < real(1.0) else real(1.0)
    return share * polynomial(fit, share)


def excess_at_pi(ratio: float) -> float:
    """Return the value of cosh ℓ − 1 where ψ = π, for λ = b/a and c = 0."""
    return float(2.0 * np.sinh(np.pi * np.sqrt(2.0 * ratio)) ** 2)


@cache
def half_angle_fit(ratio: float, dtype: np.dtype[np.float64]) -> tuple[float, ...]:
    """Return the coefficients P of sin²(½ψ) = z P(z), z in [0, 1] the share of `excess_at_pi`."""
    kappa, reach = 0.5 / np.sqrt(2.0 * ratio), excess_at_pi(ratio)

    def quotient(z: Array) -> Array:
        half_sines: Array = np.sin(kappa * np.arcsinh(np.sqrt(0.5 * reach * z))) ** 2
        return half_sines / z

    fit = Chebyshev.interpolate(quotient, _DEGREES[dtype], domain=[0.0, 1.0])
    powers = fit.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
    return tuple(dtype.type(c) for c in powers.coef)
