"""Soft assignment of scan points to body points: expectation step and likelihood.

A scan point x with normal m belongs to the body's point v with normal n and share of area A with
the probability P ∝ A exp(−|v − x|²/2σ² + κ (n·m − 1)); a uniform density models points that belong
to none. This is the mixture of coherent point drift (Myronenko and Song 2010, equations 2 to 4)
with areas as weights and a von Mises–Fisher factor for the normals.
"""

from __future__ import annotations

import math

import numpy as np

from riemhuman.kernels.compiled import SUM, compiled

KAPPA = 2.0
"""Concentration κ of the normals."""

OUTLIERS = 0.05
"""Expected share of scan points that do not belong to the body, spread over a cubic metre."""


@compiled(forceinline=True, fastmath=SUM)
def assign(
    points: np.ndarray,
    normals: np.ndarray,
    areas: np.ndarray,
    scan: np.ndarray,
    scan_normals: np.ndarray,
    sigma: float,
    signed: bool,
    masses: np.ndarray,
    targets: np.ndarray,
) -> float:
    """Fill masses and targets of the body's points, and return the mean log-likelihood.

    Parameters
    ----------
    points, normals : array, shape (3, n), float32
        Points and unit normals of the body.
    areas : array, shape (n,), float32
        Shares of the area.
    scan, scan_normals : array, shape (m, 3), float32
        Points and unit normals of the scan.
    sigma : float
        Standard deviation σ, metres.
    signed : bool
        Whether the signs of the scan's normals are known.
    masses : array, shape (n,), float32
        Filled with the expected number of scan points that belong to each point.
    targets : array, shape (3, n), float32
        Filled with the sums of these scan points.

    Returns
    -------
    likelihood : float
        Mean logarithm of the density of the scan points, per cubic metre.
    """
    n = points.shape[1]
    share = np.empty(n, np.float32)
    # exp(−t) as (1 − t/1024)^1024, which needs only multiplications.
    scale = np.float32(0.5 / (sigma * sigma) / 1024.0)
    angular = np.float32(KAPPA / 1024.0)
    one, zero = np.float32(1.0), np.float32(0.0)
    # The mean of exp(κ (n·m − 1)) over all directions.
    turned = (1.0 - math.exp(-2.0 * KAPPA)) / (2.0 * KAPPA)
    volume = (2.0 * math.pi * sigma * sigma) ** 1.5 * turned / (1.0 - OUTLIERS)
    outliers = np.float32(OUTLIERS * volume)
    place_x, place_y, place_z = points[0], points[1], points[2]
    normal_x, normal_y, normal_z = normals[0], normals[1], normals[2]
    target_x, target_y, target_z = targets[0], targets[1], targets[2]
    masses[:] = zero
    targets[:] = zero
    likelihood = 0.0
    for j in range(scan.shape[0]):
        x, y, z = scan[j, 0], scan[j, 1], scan[j, 2]
        p, q, r = scan_normals[j, 0], scan_normals[j, 1], scan_normals[j, 2]
        total = zero
        for i in range(n):
            dx, dy, dz = place_x[i] - x, place_y[i] - y, place_z[i] - z
            cosine = normal_x[i] * p + normal_y[i] * q + normal_z[i] * r
            cosine = cosine if signed else abs(cosine)
            t = one - (dx * dx + dy * dy + dz * dz) * scale - (one - cosine) * angular
            t = t if t > zero else zero
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= t
            t *= areas[i]
            share[i] = t
            total += t
        likelihood += math.log(total + outliers)
        factor = one / (total + outliers)
        for i in range(n):
            t = share[i] * factor
            masses[i] += t
            target_x[i] += t * x
            target_y[i] += t * y
            target_z[i] += t * z
    return likelihood / scan.shape[0] - math.log(volume)
