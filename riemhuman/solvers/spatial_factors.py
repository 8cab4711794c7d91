"""Cholesky factors of metrics in all coordinates of a point, for preconditioning."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse

from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.block_triangles import WIDTHS, eliminate, solve_lower, solve_upper
from riemhuman.kernels.elimination import elimination_of
from riemhuman.kernels.laplacian import cotangent_laplacian
from riemhuman.solvers.preconditioner import INDEFINITE, CholeskyFactor

# The matrix of a metric of surfaces is singular on translations, and nearly so on bends if c = 0;
# steps along them must not be endless.
_RIDGE = 1e-4

# Blocks of a metric of fields are singular only on directions that leave the manifold.
_RIDGE_OF_BLOCKS = 1e-8

# Random vectors that show how strongly a metric weighs each entry of a point.
_N_PROBES = 3

# Entries that are eliminated together, the coordinates of a vertex.
_BLOCK = 3
_ON_DIAGONAL = np.array([0, 4, 8])

# So few right sides are not filled up with zeros to one of `WIDTHS`.
_FEW = 6

# Points of at most so many coordinates are one block.
_LARGEST_BLOCK = 16


class SparseCholeskyFactor(CholeskyFactor):
    """Cholesky factor, up to a permutation, of a sparse positive semidefinite matrix with a ridge.

    Parameters
    ----------
    matrix : sparse array, shape (3n, 3n)
        Symmetric positive semidefinite matrix, the coordinates of each vertex together.
    ridge : float
        Share of the diagonal that is added to the matrix.
    """

    def __init__(self, matrix: Any, ridge: float = _RIDGE) -> None:
        diagonal = matrix.diagonal()
        size = diagonal.mean()
        added = ridge * (diagonal + (size if size > 0 else 1.0))
        blocks = sparse.csr_array(matrix).tobsr((_BLOCK, _BLOCK))
        found = elimination_of(blocks)
        self._order = (_BLOCK * found.order[:, None] + np.arange(_BLOCK)).ravel()
        lower = np.zeros((len(found.rows), _BLOCK**2))
        lower[found.targets] = blocks.data.reshape(-1, _BLOCK**2)[found.sources]
        lower[found.ends[:-1, None], _ON_DIAGONAL] += added[self._order].reshape(-1, _BLOCK)
        pivots = np.empty((len(found.order), _BLOCK))
        eliminate(
            found.ends, found.rows, found.columns, found.row_ends, found.by_row, lower, pivots
        )
        if not np.all(pivots > 0.0):
            raise ArgumentError(INDEFINITE)
        self._lower = found.ends, found.rows, lower
        self._squared_scale = pivots.reshape(-1, 1)
        self._scale = np.sqrt(self._squared_scale)

    def inverse(self, columns: ndarray) -> ndarray:
        def both(x: ndarray) -> ndarray:
            x = self._solve_lower(x)
            x /= self._squared_scale
            return self._solve_upper(x)

        return _many_together(both, columns)

    def solve(self, columns: ndarray) -> ndarray:
        return _many_together(self._solve_lower, columns) / self._scale

    def solve_transposed(self, columns: ndarray) -> ndarray:
        return _many_together(self._solve_upper, columns / self._scale)

    def _solve_lower(self, columns: ndarray) -> ndarray:
        """Return the solution in the order of elimination, for a diagonal of 1."""
        x = columns[self._order]
        solve_lower(*self._lower, x.reshape(len(x) // _BLOCK, -1), _lanes(x))
        return x

    def _solve_upper(self, x: ndarray) -> ndarray:
        """Overwrite x; return the solution, back in the order of columns."""
        solve_upper(*self._lower, x.reshape(len(x) // _BLOCK, -1), _lanes(x))
        columns = np.empty_like(x)
        columns[self._order] = x
        return columns


def _lanes(x: ndarray) -> tuple[int, ...] | None:
    return (0,) * x.shape[1] if x.shape[1] in WIDTHS else None


def _many_together(solve: Callable[[ndarray], ndarray], columns: ndarray) -> ndarray:
    """Solve for one of `WIDTHS` right sides at a time, filled up with zeros, unless for few."""
    n = columns.shape[1]
    if n <= _FEW:
        return solve(np.ascontiguousarray(columns))
    n_parts = -(-n // max(WIDTHS))
    width = next(width for width in WIDTHS if n_parts * width >= n)
    solutions = []
    for first in range(0, n, width):
        some = columns[:, first : first + width]
        filled = np.zeros((len(columns), width))
        filled[:, : some.shape[1]] = some
        solutions.append(solve(filled)[:, : some.shape[1]])
    return solutions[0] if n_parts == 1 else np.hstack(solutions)


class BlockCholeskyFactor(CholeskyFactor):
    """Cholesky factor of a block-diagonal positive semidefinite matrix with a ridge.

    Parameters
    ----------
    blocks : array, shape (m, k, k)
        Symmetric positive semidefinite blocks along the diagonal, K = mk.
    """

    def __init__(self, blocks: ndarray) -> None:
        _, _, k = blocks.shape
        sizes = np.trace(blocks, axis1=-2, axis2=-1) / k
        ridge = _RIDGE_OF_BLOCKS * (sizes + (sizes.mean() if sizes.any() else 1.0))
        try:
            lower = np.linalg.cholesky(blocks + ridge[:, None, None] * np.eye(k))
        except np.linalg.LinAlgError as error:
            raise ArgumentError(INDEFINITE) from error
        self._inverse = np.linalg.inv(lower)

    def solve(self, columns: ndarray) -> ndarray:
        return self._apply(self._inverse, columns)

    def solve_transposed(self, columns: ndarray) -> ndarray:
        return self._apply(np.swapaxes(self._inverse, -1, -2), columns)

    @staticmethod
    def _apply(blocks: ndarray, columns: ndarray) -> ndarray:
        m, k, _ = blocks.shape
        return (blocks @ columns.reshape(m, k, *columns.shape[1:])).reshape(columns.shape)


def spatial_factor(
    metric: RiemannianMetric,
    points: ndarray,
    scale: float,
    stiffness: float = 0.0,
    ridge: float = _RIDGE,
) -> CholeskyFactor:
    r"""Return a factor of the metric's matrix M in all coordinates, averaged over points.

    Metrics with a method `metric_matrix` give the matrix itself. Otherwise the block of each entry
    i along a point's first axis is estimated as (Σ_j M_ij M_ijᵀ)^½ from the action of M on random
    vectors; this is M_ii where the metric couples no entries, as on fields.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    points : array, shape (n, \*shape)
        Points of a path.
    scale : float
        The matrix is divided by it.
    stiffness : float
        On surfaces, weight of the Dirichlet energy of deformations beside M, in units of its mean
        diagonal entry. Deformations that the metric does not see to first order, such as bending if
        c = 0 and stretching if a = 0, still affect its distances between surfaces further apart.
    ridge : float
        Share of the diagonal that is added to a matrix of surfaces.

    Returns
    -------
    CholeskyFactor
    """
    if metric.has_metric_matrix:
        matrix = metric.metric_matrix(points)
        if stiffness > 0 and metric.space.is_surface_space:
            template = metric.space.template
            laplacian = cotangent_laplacian(template.vertices, template.faces)
            share = matrix.diagonal().mean() / laplacian.diagonal().mean()
            dirichlet = sparse.kron(laplacian, sparse.eye_array(3), format="csr")
            matrix = matrix + stiffness * share * dirichlet
        return SparseCholeskyFactor(matrix / scale, ridge)
    return BlockCholeskyFactor(_block_norms(metric, points) / scale)


def _block_norms(metric: RiemannianMetric, points: ndarray) -> ndarray:
    shape = metric.space.shape
    one_block = math.prod(shape) <= _LARGEST_BLOCK
    length = 1 if one_block else shape[0]
    size = math.prod(shape) // length
    rng = np.random.default_rng(0)
    squares = np.zeros((length, size, size))
    for _ in range(1 if one_block else _N_PROBES):
        signs = rng.choice([-1.0, 1.0], length)
        # Entry i of probe k is ± the k-th unit vector.
        probes = signs[:, None] * np.eye(size)[:, None, :]
        probes = probes.reshape(size, 1, *shape) + np.zeros_like(points)
        at = points + np.zeros_like(probes)
        images = metric.covector(metric.space.to_tangent(probes, at), at)
        rows = np.mean(images, axis=1).reshape(size, length, size)
        squares += np.einsum("kia,kib->iab", rows, rows)
    values, vectors = np.linalg.eigh(squares)
    roots = np.sqrt(np.maximum(values, 0.0) / (1 if one_block else _N_PROBES))
    return (vectors * roots[:, None, :]) @ np.swapaxes(vectors, -1, -2)
