r"""Compiled distances of all pairs of points, in single or double precision.

Every function exists in both precisions and takes that of its arguments. Angles come from
polynomials in the squared sine of their half, without branches, so that loops run over whole vector
registers: with p the shorter squared chord of two unit vectors, n₁ to n₂ or n₁ to −n₂,
θ² = p Q(p) or (π − √(p Q(p)))²; and sin²(½ min(π, θ)) = a² S(a²) with a = ½ min(π, κℓ),
ℓ = log(1 + m + √(m(m + 2))), or, for small λ, the polynomial of `half_angle_fit`.

Sums run over chunks of triangles, always the same ones, and over chunks in double precision: the
bits of a distance depend on its two points alone, not on other points, tiles or threads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numba import types
from numba.extending import intrinsic
from numpy import ndarray

from riemhuman.kernels.compilation import njit
from riemhuman.kernels.compiled_features import of_one_kind
from riemhuman.kernels.half_angle_fit import (
    LARGEST_LAMBDA,
    excess_at_pi,
    half_angle_polynomial,
)

# θ²/p for p in [0, 2]; the largest relative errors are 1e-8 and 1e-16.
_ARC = (
    (1.0, 0.0833329484, 0.0111162076, 0.00176024658, 0.000380191312, -2.4703817e-05)
    + (7.68320388e-05, -2.45728515e-05, 5.56007217e-06),
    (1.0, 0.0833333333333205, 0.011111111111878005, 0.0017857142675714339)
    + (0.00031746054353039055, 6.012334749789467e-05, 1.190145497780534e-05)
    + (2.3980475012020936e-06, 5.842167643945109e-07, -3.5749647809176705e-08)
    + (2.2820448805102648e-07, -2.1628319740394816e-07, 1.8342623990398518e-07)
    + (-1.1331536542028546e-07, 5.278573124328368e-08, -1.7707505291974977e-08)
    + (4.091256168225173e-09, -5.823618089617082e-10, 3.9471653680487684e-11),
)
# sin²(a)/a² as a function of a² in [0, π²/4], to 1e-7 and 1e-16.
_SINE = (
    (1.0, -0.333333343, 0.0444444194, -0.00317454338, 0.000141023731, -4.23364781e-06)
    + (8.13311729e-08,),
    (1.0, -0.3333333333333333, 0.04444444444444425, -0.0031746031746019434)
    + (0.0001410934744228115, -4.2755598235467655e-06, 9.396833899534907e-08)
    + (-1.5661323426627297e-09, 2.0469089716147505e-11, -2.1448942470805523e-13)
    + (1.6907591059828979e-15,),
)
# log(1 + f)/f for f in [√½ − 1, √2 − 1], to 1e-7 and 1e-16.
_LOGARITHM = (
    (1.0, -0.49999997, 0.333341926, -0.25001353, 0.199559331, -0.165779904, 0.14977406)
    + (-0.14269276, 0.0853332356),
    (1.0, -0.4999999999999992, 0.3333333333332591, -0.25000000000033595, 0.20000000002057028)
    + (-0.16666666663491556, 0.14285714065188576, -0.1249999999679701, 0.11111122928967049)
    + (-0.10000012800878164, 0.09090558853866064, -0.08332649680408159, 0.07698139171184266)
    + (-0.07159308276300465, 0.06616915684158244, -0.060449282600514576, 0.06002360097192043)
    + (-0.0679349615676611, 0.06249763728523732, -0.027579240684232197),
)

# Triangles summed in the precision of the features before they join the sum over all.
_CHUNK = 512
# Pairs times values of one tile: some milliseconds of work, so that features read are used often.
_TILE_WORK = 20_000_000

# Products may join sums; where terms may also change places, only sums of terms are concerned.
_FUSED = {"contract", "nsz"}
_SUM = {"contract", "nsz", "reassoc"}


def _polynomial(single: tuple[float, ...], double: tuple[float, ...]) -> Callable[..., Any]:
    """Return a compiled polynomial, with coefficients for each precision, constant term first."""

    @intrinsic
    def evaluate(typing_context: Any, x: Any) -> Any:
        coefficients = single if x == types.float32 else double

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            value, *others = (context.get_constant(x, c) for c in reversed(coefficients))
            for coefficient in others:
                product = builder.fmul(value, arguments[0], flags=("contract",))
                value = builder.fadd(product, coefficient, flags=("contract",))
            return value

        return x(x), generate

    return evaluate


_arc = _polynomial(*_ARC)
_sine = _polynomial(*_SINE)
_logarithm = _polynomial(*_LOGARITHM)


@intrinsic
def _evaluate(typing_context: Any, coefficients: Any, x: Any) -> Any:
    """Return the polynomial in x with these coefficients, constant term first."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        packed, argument = arguments
        value = builder.extract_value(packed, coefficients.count - 1)
        for k in range(coefficients.count - 2, -1, -1):
            product = builder.fmul(value, argument, flags=("contract",))
            value = builder.fadd(product, builder.extract_value(packed, k), flags=("contract",))
        return value

    return x(coefficients, x), generate


@intrinsic
def _split(typing_context: Any, x: Any) -> Any:
    """Return k and 2⁻ᵏ, for x > 0, such that 2⁻ᵏ x lies in [√½, √2)."""
    n_digits, bias = (23, 127) if x == types.float32 else (52, 1023)
    integer = types.int32 if x == types.float32 else types.int64
    lowest = int(np.asarray(math.sqrt(0.5), str(x)).view(str(integer)))

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        def constant(value: int) -> Any:
            return context.get_constant(integer, value)

        bits = builder.bitcast(arguments[0], context.get_value_type(integer))
        exponent = builder.ashr(builder.sub(bits, constant(lowest)), constant(n_digits))
        scale = builder.shl(builder.sub(constant(bias), exponent), constant(n_digits))
        real = arguments[0].type
        pair = (builder.sitofp(exponent, real), builder.bitcast(scale, real))
        return context.make_tuple(builder, signature.return_type, pair)

    return types.UniTuple(x, 2)(x), generate


@njit(forceinline=True, fastmath=_FUSED)
def squared_angle(x1: float, y1: float, z1: float, x2: float, y2: float, z2: float) -> float:
    """Return the squared angle between two unit vectors.

    Parameters
    ----------
    x1, y1, z1, x2, y2, z2 : float
        Components, all in one precision.

    Returns
    -------
    float
    """
    real = type(x1)
    acute = x1 * x2 + y1 * y2 + z1 * z2 >= real(0.0)
    sign = real(1.0) if acute else real(-1.0)
    x, y, z = x1 - sign * x2, y1 - sign * y2, z1 - sign * z2
    chord = x * x + y * y + z * z
    squared = chord * _arc(chord)
    obtuse = real(math.pi) - np.sqrt(squared)
    return squared if acute else obtuse * obtuse


@njit(forceinline=True, fastmath=_FUSED)
def half_angle_sine_squared(m: float, half_kappa: float) -> float:
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
    exponent, scale = _split(real(1.0) + growth)
    fraction = growth * scale + (scale - real(1.0))
    length = exponent * real(math.log(2.0)) + fraction * _logarithm(fraction)
    angle = half_kappa * length
    right = real(0.5 * math.pi)
    angle = angle if angle < right else right
    squared = angle * angle
    return squared * _sine(squared) + real(0.0) * growth


@njit(forceinline=True, fastmath=_FUSED)
def bounded_half_angle_sine_squared(
    m: float, inverse_reach: float, coefficients: tuple[float, ...]
) -> float:
    """Return sin²(½ min(π, θ)) by the polynomial of `half_angle_fit`.

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
    return share * _evaluate(coefficients, share)


@njit(forceinline=True, fastmath=_FUSED)
def _excess(x1: float, y1: float, h1: float, x2: float, y2: float, h2: float) -> float:
    """Return m = cosh ℓ − 1, with h = 1/(√2 y)."""
    x, y = x1 - x2, y1 - y2
    return (x * x + y * y) * (h1 * h2)


@njit(forceinline=True, fastmath=_FUSED)
def _cone(s1: float, s2: float, half: float) -> float:
    """Return (s₁ − s₂)² + 4 s₁ s₂ sin²(½θ)."""
    s, product = s1 - s2, s1 * s2
    product += product
    return s * s + (product + product) * half


@njit(forceinline=True, fastmath=_SUM)
def _cone_chunk(a: ndarray, b: ndarray, half_kappa: float, first: int, last: int) -> float:
    x1, y1, h1, s1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    x2, y2, h2, s2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    total = type(half_kappa)(0.0)
    for t in range(last - first):
        m = _excess(x1[t], y1[t], h1[t], x2[t], y2[t], h2[t])
        total += _cone(s1[t], s2[t], half_angle_sine_squared(m, half_kappa))
    return total


@njit(forceinline=True, fastmath=_SUM)
def _bounded_cone_chunk(
    a: ndarray,
    b: ndarray,
    inverse_reach: float,
    coefficients: tuple[float, ...],
    first: int,
    last: int,
) -> float:
    x1, y1, h1, s1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    x2, y2, h2, s2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    total = type(inverse_reach)(0.0)
    for t in range(last - first):
        m = _excess(x1[t], y1[t], h1[t], x2[t], y2[t], h2[t])
        half = bounded_half_angle_sine_squared(m, inverse_reach, coefficients)
        total += _cone(s1[t], s2[t], half)
    return total


@njit(forceinline=True, fastmath=_SUM)
def _normal_chunk(a: ndarray, b: ndarray, weights: ndarray, first: int, last: int) -> float:
    x1, y1, z1 = a[0, first:last], a[1, first:last], a[2, first:last]
    x2, y2, z2 = b[0, first:last], b[1, first:last], b[2, first:last]
    w = weights[first:last]
    total = weights.dtype.type(0.0)
    for t in range(last - first):
        total += w[t] * squared_angle(x1[t], y1[t], z1[t], x2[t], y2[t], z2[t])
    return total


@njit(forceinline=True, fastmath=_SUM)
def _flat_chunk(a: ndarray, b: ndarray, first: int, last: int) -> float:
    u, v = a[first:last], b[first:last]
    total = a.dtype.type(0.0)
    for t in range(last - first):
        difference = u[t] - v[t]
        total += difference * difference
    return total


@njit(nogil=True)
def _cone_tile(a: ndarray, b: ndarray, half_kappa: float, within: bool, squared: ndarray) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, _CHUNK):
        last = min(first + _CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _cone_chunk(a[i], b[j], half_kappa, first, last)


@njit(nogil=True)
def _bounded_cone_tile(
    a: ndarray,
    b: ndarray,
    inverse_reach: float,
    coefficients: tuple[float, ...],
    within: bool,
    squared: ndarray,
) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, _CHUNK):
        last = min(first + _CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _bounded_cone_chunk(
                    a[i], b[j], inverse_reach, coefficients, first, last
                )


@njit(nogil=True)
def _normal_tile(a: ndarray, b: ndarray, weights: ndarray, within: bool, squared: ndarray) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, _CHUNK):
        last = min(first + _CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _normal_chunk(a[i], b[j], weights, first, last)


@njit(nogil=True)
def _flat_tile(a: ndarray, b: ndarray, within: bool, squared: ndarray) -> None:
    n_values = a.shape[1]
    for first in range(0, n_values, _CHUNK):
        last = min(first + _CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _flat_chunk(a[i], b[j], first, last)


def ebin_distances(a: ndarray, b: ndarray, lam: float, n_threads: int = 1) -> ndarray:
    """Return all squared distances of metric fields in the Ebin metric.

    Parameters
    ----------
    a, b : array of float32 or float64, shape (n_a, 4, F⁺) and (n_b, 4, F⁺)
        Metric fields, see `compiled_features.metric_field_features`; one array twice for the
        distances within one set.
    lam : float
        λ > 0.
    n_threads : int
        Number of threads.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    real = a.dtype.type
    if lam <= LARGEST_LAMBDA:
        bounds = (real(1.0 / excess_at_pi(lam)), half_angle_polynomial(lam, a.dtype))
        squared = _in_tiles(_bounded_cone_tile, a, b, bounds, n_threads)
    else:
        half_kappa = real(0.25 / math.sqrt(2.0 * lam))
        squared = _in_tiles(_cone_tile, a, b, (half_kappa,), n_threads)
    squared *= 16.0 * lam
    return squared


def normal_distances(a: ndarray, b: ndarray, weights: ndarray, n_threads: int = 1) -> ndarray:
    """Return all squared distances Σ_t w_t θ_t² of normal fields.

    Parameters
    ----------
    a, b : array of float32 or float64, shape (n_a, 3, F⁺) and (n_b, 3, F⁺)
        Components of unit normals, see `compiled_features.normal_features`; one array twice for
        the distances within one set.
    weights : array, shape (F,)
        Weights w_t ≥ 0, of which not all are 0.
    n_threads : int
        Number of threads.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    largest = weights.max()
    relative = np.zeros(a.shape[2], dtype=a.dtype)
    relative[: len(weights)] = weights / largest
    squared = _in_tiles(_normal_tile, a, b, (relative,), n_threads)
    squared *= largest
    return squared


def flat_distances(a: ndarray, b: ndarray, n_threads: int = 1) -> ndarray:
    """Return all squared Euclidean distances of vectors, from their differences.

    Parameters
    ----------
    a, b : array of float32 or float64, shape (n_a, k⁺) and (n_b, k⁺)
        Vectors, see `compiled_features.vector_features`; one array twice for the distances within
        one set.
    n_threads : int
        Number of threads.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    return _in_tiles(_flat_tile, a, b, (), n_threads)


def _in_tiles(
    run: Callable[..., None], a: ndarray, b: ndarray, arguments: tuple[Any, ...], n_threads: int
) -> ndarray:
    """Return sums over pairs, computed tile by tile in threads."""
    within = a is b
    a, b = of_one_kind(a), of_one_kind(b)
    squared = np.zeros((len(a), len(b)))
    size = int(np.clip(math.sqrt(_TILE_WORK / max(a[:1].size, 1)), 8, 64))

    def fill(corner: tuple[int, int]) -> None:
        i, j = corner
        rows, columns = a[i : i + size], b[j : j + size]
        diagonal = within and i == j
        tile = np.zeros((len(rows), len(columns)))
        run(rows, columns, *arguments, diagonal, tile)
        if diagonal:
            tile += tile.T
        elif within:
            squared[j : j + size, i : i + size] = tile.T
        squared[i : i + size, j : j + size] = tile

    corners = [
        (i, j) for i in range(0, len(a), size) for j in range(i if within else 0, len(b), size)
    ]
    if n_threads == 1:
        for corner in corners:
            fill(corner)
    else:
        with ThreadPoolExecutor(n_threads) as pool:
            list(pool.map(fill, corners))
    return squared
