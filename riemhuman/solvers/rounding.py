"""Energies of rounding errors, below which a minimum that may be zero counts as zero."""

from __future__ import annotations

import numpy as np
from numpy import ndarray

from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import PathEnergy
from riemhuman.solvers.energies import SegmentEnergy

# Relative rounding errors of a point's entries.
_ROUNDING = 1e-13


def rounding_energy(
    metric: RiemannianMetric,
    point: ndarray,
    energy: PathEnergy | None = None,
    size: float = _ROUNDING,
) -> float:
    r"""Return the energy of the path from a point to itself with rounding errors.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    point : array, shape (\*shape,)
        A point.
    energy : PathEnergy, optional
        Energy of paths, by default `SegmentEnergy`.
    size : float
        Relative errors of the point's entries.

    Returns
    -------
    float
        A squared distance that cannot be told from 0.
    """
    near = metric.space.projection(rounded(point, size))
    return (energy or SegmentEnergy()).value(metric, np.stack([point, near]))


def rounded(point: ndarray, size: float) -> ndarray:
    r"""Return a point with rounding errors, the same ones at every call.

    Parameters
    ----------
    point : array, shape (\*shape,)
        A point.
    size : float
        Largest relative error of its entries.

    Returns
    -------
    array, shape (\*shape,)
    """
    return point * (1.0 + np.random.default_rng(0).uniform(-size, size, point.shape))


def path_floor(metric: RiemannianMetric, energy: PathEnergy, path: ndarray) -> float:
    r"""Return the energy of a constant path with rounding errors.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    energy : PathEnergy
        Energy of paths.
    path : array, shape (n_nodes, \*shape)
        A path.

    Returns
    -------
    float
    """
    both = [rounding_energy(metric, point, energy) for point in path[[0, -1]]]
    return (len(path) - 1) ** 2 * max(both)
