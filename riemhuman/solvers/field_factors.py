"""Factors of a metric's matrix for preconditioning; of products, one for each factor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.solvers._preconditioners import CholeskyFactor, metric_factor


class BlockwiseFactor(CholeskyFactor):
    """Cholesky factors of a block diagonal matrix.

    Parameters
    ----------
    factors : sequence of CholeskyFactor
        Factors of the blocks.
    sizes : sequence of int
        Numbers of their rows.
    """

    def __init__(self, factors: Sequence[CholeskyFactor], sizes: Sequence[int]) -> None:
        self._factors = tuple(factors)
        self._ends = np.cumsum(sizes)[:-1]

    def solve(self, columns: ndarray) -> ndarray:
        return self._each("solve", columns)

    def solve_transposed(self, columns: ndarray) -> ndarray:
        return self._each("solve_transposed", columns)

    def _each(self, method: str, columns: ndarray) -> ndarray:
        parts = zip(self._factors, np.split(columns, self._ends), strict=True)
        return np.concatenate([getattr(factor, method)(part) for factor, part in parts])


def field_factor(metric: Any, point: ndarray, scale: float) -> CholeskyFactor:
    r"""Return a Cholesky factor of the metric's matrix at a point.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    point : array, shape (\*shape,)
        The point.
    scale : float
        The matrix is divided by it.

    Returns
    -------
    CholeskyFactor
    """
    if not metric.space.factors:
        return metric_factor(metric, point[None], scale)
    parts = metric.space.project_from_product(point)
    factors = [
        # What has no weight does not matter; 1 keeps its factor finite.
        field_factor(factor.metric, part, scale / (weight or 1.0))
        for factor, part, weight in zip(metric.space.factors, parts, metric.weights, strict=True)
    ]
    return BlockwiseFactor(factors, [part.size for part in parts])
