"""Independent computations to compare with: written from the formulas, not from the code.

Matrices here are single 2 × 2 arrays. `exact_*` works with 60 decimal digits, so that its own
rounding never counts.
"""

from __future__ import annotations

import mpmath
import numpy as np
from mpmath import mp

mp.dps = 60


def exact_log_parts(g1, g2):
    """Return s₁, s₂ and the traceless part L₀ of log(g₁⁻¹g₂), from its eigenvalues."""
    g1, g2 = as_exact(g1), as_exact(g2)
    s1, s2 = (mp.root(mp.det(g), 4) for g in (g1, g2))
    quotient = g1**-1 * g2
    mean = (quotient[0, 0] + quotient[1, 1]) / 2
    traceless = quotient - mean * mp.eye(2)
    gap = mp.sqrt(mean**2 - mp.det(quotient))
    if gap == 0:
        return s1, s2, mp.zeros(2, 2)
    return s1, s2, mp.log((mean + gap) / (mean - gap)) / (2 * gap) * traceless


def exact_angle(g1, g2, lam):
    """Return θ = √(tr L₀²/λ)/4 (Theorem 1, corrected)."""
    shear = exact_log_parts(g1, g2)[2]
    return mp.sqrt((shear * shear)[0, 0] + (shear * shear)[1, 1]) / mp.sqrt(lam) / 4


def exact_squared_dist(g1, g2, lam):
    """Return 16λ(s₁² − 2 s₁s₂ cos min(π, θ) + s₂²) (Theorem 1, corrected)."""
    s1, s2, _ = exact_log_parts(g1, g2)
    theta = min(mp.pi, exact_angle(g1, g2, lam))
    return 16 * mp.mpf(lam) * (s1**2 - 2 * s1 * s2 * mp.cos(theta) + s2**2)


def exact_log(g1, g2, lam):
    """Return the initial velocity of the geodesic from g₁ to g₂, as floats."""
    s1, s2, shear = exact_log_parts(g1, g2)
    theta = exact_angle(g1, g2, lam)
    sine = mp.sin(theta) / theta if theta else mp.mpf(1)
    inner = s2 / s1 * sine * shear + 2 * (s2 * mp.cos(theta) - s1) / s1 * mp.eye(2)
    return as_floats(as_exact(g1) * inner)


def exact_exp(delta_g, g, lam):
    """Return the end of the geodesic from g with velocity δg, as floats."""
    g, delta_g = as_exact(g), as_exact(delta_g)
    velocity = g**-1 * delta_g
    trace = velocity[0, 0] + velocity[1, 1]
    shear = velocity - trace / 2 * mp.eye(2)
    size = mp.sqrt(((shear * shear)[0, 0] + (shear * shear)[1, 1]) / 2)
    nu = mp.sqrt(2 * size**2 / lam) / 4
    along, across = 1 + trace / 4, nu
    length = mp.atan2(across, along) / nu * size if nu else mp.mpf(0)
    rotation = mp.cosh(length) * mp.eye(2)
    if size:
        rotation += mp.sinh(length) / size * shear
    return as_floats((along**2 + across**2) * (g * rotation))


def exact_arc(n1, n2):
    """Return the angle of two vectors, which need not have unit length."""
    a, b = as_exact(n1), as_exact(n2)
    a, b = a / mp.norm(a), b / mp.norm(b)
    return 2 * mp.atan2(mp.norm(a - b), mp.norm(a + b))


def as_exact(array):
    """Return an array of floats, or an mpmath matrix, as an mpmath matrix."""
    if isinstance(array, mpmath.matrix):
        return array
    return mp.matrix(np.asarray(array, dtype=float).tolist())


def as_floats(matrix):
    """Return an mpmath matrix as a float64 array."""
    return np.array(matrix.tolist(), dtype=object).astype(float)


def traceless(matrix):
    """Return A − ½ tr(A) I."""
    return matrix - np.trace(matrix) / 2 * np.eye(2)


def orders(errors):
    """Return the orders at which errors fall where a step is halved."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


def taylor_slope(function, x, direction, gradient, rounding=1e-13):
    """Return the order at which f(x + εh) − f(x) − ε⟨∇f, h⟩ tends to 0: 2 for an exact gradient.

    Taken over the four smallest steps ε whose rest is above the relative rounding of the function;
    infinite if there are fewer.
    """
    steps = np.logspace(-2, -6, 9)
    value = function(x)
    expected = np.sum(gradient * direction)
    remainders = np.array([abs(function(x + e * direction) - value - e * expected) for e in steps])
    seen = np.flatnonzero(remainders > rounding * (abs(value) + abs(expected)))[-4:]
    if len(seen) < 4:
        return np.inf
    return np.polyfit(np.log(steps[seen]), np.log(remainders[seen]), 1)[0]
