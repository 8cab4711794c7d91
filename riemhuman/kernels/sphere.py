"""The unit sphere S², point by point: angles, exponential, logarithm, transport."""

from __future__ import annotations

import autograd.numpy as np

from riemhuman.arrays import Array
from riemhuman.kernels.surface import dot, square_root

# Rounding errors of the squared length of a unit vector.
_UNIT = 8 * np.finfo(float).eps


def sine_cardinal(x: Array) -> Array:
    """Return sin(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sin(x) / np.where(x == 0, 1.0, x))


def angle(n1: Array, n2: Array) -> Array:
    """Return the angle between unit vectors, in [0, π]."""
    difference, total = n1 - n2, n1 + n2
    return 2.0 * np.arctan2(
        square_root(dot(difference, difference)), square_root(dot(total, total))
    )


def to_tangent(v: Array, n: Array) -> Array:
    """Return v − (n·v) n, the part of v tangent at n."""
    return v - np.expand_dims(dot(n, v), -1) * n


ANTIPODAL = np.pi - 8 * np.finfo(float).eps
"""From this angle on, the direction to a unit vector or a rotation is rounding error alone."""


def log(n1: Array, n2: Array) -> Array:
    """Return the initial velocity of the minimal geodesic from n₁ to n₂, n₂ ≠ −n₁."""
    # The tangent part of n₂ − n₁ or n₂ + n₁, whichever is the shorter and so the more exact.
    shorter = np.where((dot(n1, n2) >= 0)[..., None], n2 - n1, n2 + n1)
    direction = to_tangent(shorter, n1)
    sine = square_root(dot(direction, direction))
    scale = np.where(sine > 0, angle(n1, n2) / np.where(sine > 0, sine, 1.0), 1.0)
    return scale[..., None] * direction


def exp(v: Array, n: Array) -> Array:
    """Return the end point of the great circle from n with velocity v, cos‖v‖ n + sin‖v‖ v/‖v‖."""
    length = np.expand_dims(square_root(dot(v, v)), -1)
    end = np.cos(length) * n + sine_cardinal(length) * v
    # Rounding errors along n would otherwise grow from step to step of an iteration.
    squared = np.expand_dims(dot(end, end), -1)
    is_unit = np.abs(squared - 1.0) <= _UNIT
    return end / np.where(is_unit, 1.0, square_root(np.where(is_unit, 1.0, squared)))


def parallel_transport(w: Array, n: Array, v: Array) -> Array:
    r"""Transport w along the great circle from n with velocity v, for unit time.

    .. math:: w + \frac{\langle v, w\rangle}{\|v\|^2}\left((\cos\|v\| - 1)\, v
              - \|v\|\sin\|v\|\, n\right)
    """
    length = square_root(dot(v, v))[..., None]
    along = dot(v, w)[..., None]
    half = sine_cardinal(0.5 * length)
    return w - along * (0.5 * half**2 * v + sine_cardinal(length) * n)
