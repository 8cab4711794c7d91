r"""Parallel transport of the Ebin metric, pointwise on its cone over the hyperbolic plane.

A geodesic lies in a flat plane of the cone, spanned by the radial direction and its own shear. Of a
tangent vector the part in that plane keeps its Cartesian components, and the part across it, the
shear at right angles, keeps its norm and direction, since the hyperbolic plane carries it along.
"""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.linear import entry
from riemhuman.kernels.surface import symmetric_matrices
from riemhuman.terms.ebin import angle_per_distance
from riemhuman.terms.ebin_geodesics import angle_per_unit, traceless_exp
from riemhuman.terms.ebin_tangent import (
    size,
    symmetric_part,
    trace,
    traceless,
    unwhiten,
    whiten,
)


def parallel_transport(w: ndarray, g: ndarray, delta_g: ndarray, lam: float) -> ndarray:
    r"""Carry tangent vectors along the geodesic with initial velocity δg for unit time.

    With W = ωI + ξV + ηN the vector whitened at g, V the unit shear of δg and N the one at right
    angles to it, φ and r the angle and the ratio of radii of `ebin_geodesics.exp`, and κ = √(2λ),

    .. math:: \omega' = \frac1r\left(\omega\cos\varphi + \frac{\xi}{\kappa}\sin\varphi\right),
              \quad \xi' = \frac1r(\xi\cos\varphi - \kappa\,\omega\sin\varphi),
              \quad \eta' = \frac{\eta}{r}.

    Parameters
    ----------
    w : array, shape (..., 2, 2)
        Symmetric matrices, tangent at g.
    g : array, shape (..., 2, 2)
        Positive definite matrices.
    delta_g : array, shape (..., 2, 2)
        Symmetric matrices, the velocities; the geodesics stay clear of the apex.
    lam : float
        λ > 0.

    Returns
    -------
    array, shape (..., 2, 2)
        Tangent at the ends of the geodesics.
    """
    velocity, vector = whiten(delta_g, g), whiten(w, g)
    shear = traceless(velocity)
    length = size(shear)
    along = 1.0 + 0.25 * trace(velocity)
    across = angle_per_distance(lam) * length
    phi, ratio = np.arctan2(across, along), np.sqrt(along**2 + across**2)

    # Without shear any direction will do.
    turning = length > 0
    safe = np.where(turning, length, 1.0)
    a = np.where(turning, entry(shear, 0, 0) / safe, 1.0)
    b = np.where(turning, entry(shear, 0, 1) / safe, 0.0)
    omega = 0.5 * trace(vector)
    difference, mixed = 0.5 * (entry(vector, 0, 0) - entry(vector, 1, 1)), entry(vector, 0, 1)
    xi, eta = difference * a + mixed * b, mixed * a - difference * b

    kappa = np.sqrt(2.0 * lam)
    cosine, sine = np.cos(phi), np.sin(phi)
    omega, xi = omega * cosine + xi * sine / kappa, xi * cosine - kappa * omega * sine
    difference, mixed = xi * a - eta * b, xi * b + eta * a
    # Of the end r² g exp(L) the whitening goes by r exp(L/2).
    half = traceless_exp(shear, 0.5 * angle_per_unit(along, across))
    carried = half @ symmetric_matrices(omega + difference, mixed, omega - difference) @ half
    return unwhiten(ratio[..., None, None] * symmetric_part(carried), g)
