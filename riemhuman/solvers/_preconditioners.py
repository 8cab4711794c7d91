"""Inverse Hessians of path energies: Cholesky factors of a metric's matrix, and of the times.

Near a straight path the Hessian of the energy of n segments is close to 2n (D ⊗ G):
D = tridiag(−1, 2, −1) couples the times, G is the matrix of the metric in the coordinates of one
point, or its Gram matrix on a basis.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import numpy as np
from scipy import linalg, sparse

from riemhuman.arrays import Array, FeatureRows, Points, TangentVectors
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.manifold import holds_surfaces
from riemhuman.kernels.elimination import (
    WIDTH,
    eliminate,
    elimination_of,
    solve_lower,
    solve_upper,
)
from riemhuman.kernels.surface import add_blocks
from riemhuman.kernels.threads import slices
from riemhuman.surfaces.template import Template

_INDEFINITE = (
    "the matrix of the metric is not positive semidefinite, or not finite; "
    "riemhuman.testing.check_metric(metric, points) shows what is wrong"
)

# A Gram matrix is singular on deformations that the metric ignores, such as translations.
_RIDGE_OF_GRAM = 1e-8

# The matrix of a metric of surfaces is singular on translations, and nearly so on bends if c = 0;
# steps along them must not be endless.
_RIDGE = 1e-4

# Blocks of a metric of fields are singular only on directions that leave the manifold.
_RIDGE_OF_BLOCKS = 1e-8

# Random vectors that show how strongly a metric weighs each entry of a point.
_N_PROBES = 3

# Entries that are eliminated together, the coordinates of a vertex.
_BLOCK = 3
# Places of the diagonal in a block of 3 x 3 entries.
_ON_DIAGONAL = np.array([0, 4, 8])
# Those that are not part of its factor.
_LEFT_OVER = np.array([0, 3, 4, 6, 7, 8])

# Up to this many right-hand sides are not padded with zeros to `WIDTH`.
_FEW = 6

# Points with at most this many coordinates are one block.
_LARGEST_BLOCK = 16


class CholeskyFactor(ABC):
    """Factor L of a positive semidefinite matrix with a tiny ridge, A ≈ L Lᵀ."""

    @abstractmethod
    def inverse(self, columns: Array) -> Array:
        """Return A⁻¹ X."""

    def __call__(self, vector: TangentVectors) -> Array:
        """Return A⁻¹ x."""
        return self.inverse(vector.reshape(-1, 1)).ravel()


class DenseCholeskyFactor(CholeskyFactor):
    """Cholesky factor of a matrix, such as a Gram matrix, with a ridge."""

    def __init__(self, matrix: Array) -> None:
        size = np.trace(matrix) / len(matrix)
        ridge = _RIDGE_OF_GRAM * (np.diag(matrix) + (size if size > 0 else 1.0))
        try:
            self._lower = linalg.cholesky(matrix + np.diag(ridge), lower=True)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ArgumentError(_INDEFINITE) from error

    def inverse(self, columns: Array) -> Array:
        half = linalg.solve_triangular(self._lower, columns, lower=True, check_finite=False)
        solved: Array = linalg.solve_triangular(
            self._lower, half, lower=True, trans="T", check_finite=False
        )
        return solved


class PathPreconditioner:
    """The inverse of the Hessian 2n (D ⊗ G) of paths of n segments, given the factor of G."""

    def __init__(self, gram: CholeskyFactor, n_segments: int) -> None:
        steps = np.diff(np.eye(n_segments), axis=0)
        self._inverse_time = DenseCholeskyFactor(steps @ steps.T).inverse(np.eye(n_segments - 1))
        self._gram = gram
        self._scale = 1.0 / (2.0 * n_segments)

    def __call__(self, gradient: Array) -> Array:
        """Return the image of a gradient, the coordinates of all interior points in one row."""
        rows = gradient.reshape(len(self._inverse_time), -1)
        return (self._scale * self._inverse_time @ self._gram.inverse(rows.T).T).ravel()


class SparseCholeskyFactor(CholeskyFactor):
    """Cholesky factor, up to a permutation, of a sparse semidefinite matrix with a ridge.

    In single precision, which is enough to precondition, it is read in half the time.
    """

    def __init__(
        self, matrix: sparse.csr_array, ridge: float = _RIDGE, *, single: bool = False
    ) -> None:
        diagonal = matrix.diagonal()
        size = diagonal.mean()
        added = ridge * (diagonal + (size if size > 0 else 1.0))
        blocks = sparse.csr_array(matrix).tobsr((_BLOCK, _BLOCK))
        elimination = elimination_of(blocks)
        self._order = (_BLOCK * elimination.order[:, None] + np.arange(_BLOCK)).ravel()
        lower = np.zeros((len(elimination.rows), _BLOCK**2))
        lower[elimination.targets] = blocks.data.reshape(-1, _BLOCK**2)[elimination.sources]
        lower[elimination.ends[:-1, None], _ON_DIAGONAL] += added[self._order].reshape(-1, _BLOCK)
        pivots = np.empty((len(elimination.order), _BLOCK))
        eliminate(
            elimination.ends,
            elimination.rows,
            elimination.columns,
            elimination.row_ends,
            elimination.by_row,
            lower,
            pivots,
        )
        if not np.all(pivots > 0.0):
            raise ArgumentError(_INDEFINITE)
        self._ends, self._rows = elimination.ends, elimination.rows
        # Whatever the unit, the numbers that are stored are about 1: of blocks on the diagonal,
        # what is left of the matrix is not.
        lower[elimination.ends[:-1, None], _LEFT_OVER] = 0.0
        self._size = pivots.mean()
        real = np.float32 if single else np.float64
        self._lower: FeatureRows = lower.astype(real, copy=False)
        self._pivots = (pivots / self._size).astype(real).reshape(-1, 1)

    def inverse(self, columns: Array) -> Array:
        rows = np.ascontiguousarray(columns.T)
        largest = np.abs(rows).max(initial=0.0) or 1.0
        solutions = np.empty(rows.shape)
        # `WIDTH` columns at a time, with zeros for those that are missing; a few columns are not
        # filled up, as the loops take less time for them.
        n = len(rows)
        width = n if n <= _FEW else WIDTH
        # A tuple whose length tells compiled loops the number of columns, None for few.
        lanes = (0,) * WIDTH if width == WIDTH else None
        for part in slices(n, WIDTH):
            n_columns = part.stop - part.start
            x = np.zeros((rows.shape[1], width), self._lower.dtype)
            x[:, :n_columns] = (rows[part, self._order] / largest).T
            blocks = x.reshape(len(x) // _BLOCK, -1)
            solve_lower(self._ends, self._rows, self._lower, blocks, lanes)
            x /= self._pivots
            solve_upper(self._ends, self._rows, self._lower, blocks, lanes)
            solutions[part, self._order] = x[:, :n_columns].T
        solutions *= largest / self._size
        return solutions.T


class BlockCholeskyFactor(CholeskyFactor):
    """Cholesky factor of a matrix with diagonal blocks, shape (m, k, k), and a ridge."""

    def __init__(self, blocks: Array) -> None:
        _, _, k = blocks.shape
        sizes = np.trace(blocks, axis1=-2, axis2=-1) / k
        ridge = _RIDGE_OF_BLOCKS * (sizes + (sizes.mean() if sizes.any() else 1.0))
        try:
            lower = np.linalg.cholesky(blocks + ridge[:, None, None] * np.eye(k))
        except np.linalg.LinAlgError as error:
            raise ArgumentError(_INDEFINITE) from error
        self._inverse = np.linalg.inv(lower)

    def inverse(self, columns: Array) -> Array:
        m, k, _ = self._inverse.shape
        half = self._inverse @ columns.reshape(m, k, *columns.shape[1:])
        return (np.swapaxes(self._inverse, -1, -2) @ half).reshape(columns.shape)


def metric_factor(
    metric: RiemannianMetric,
    points: Points,
    scale: float = 1.0,
    directions: TangentVectors | None = None,
    stiffness: float = 0.0,
    ridge: float = _RIDGE,
    *,
    single: bool = False,
) -> CholeskyFactor:
    """Return a factor of M / scale, M the mean of the metric's matrix or Gram matrix at points.

    A sparse one may be in single precision.
    """
    if directions is not None:
        vectors = directions.reshape(-1, *metric.space.shape)
        return DenseCholeskyFactor(metric.gram_matrix(vectors, points) / scale)
    # What costs nothing to first order, as bending if c = 0, still affects distances between
    # surfaces further apart: `stiffness` weighs the Dirichlet energy, relative to the diagonals.
    if metric.has_metric_matrix:
        matrix = metric.metric_matrix(points)
        if stiffness > 0 and holds_surfaces(metric.space):
            dirichlet = _mean_dirichlet_energy(points, metric.space.template)
            share = matrix.diagonal().mean() / dirichlet.diagonal().mean()
            matrix = matrix + stiffness * share * dirichlet
        return SparseCholeskyFactor(matrix / scale, ridge, single=single)
    return BlockCholeskyFactor(_block_norms(metric, points) / scale)


def _mean_dirichlet_energy(surfaces: Points, template: Template) -> sparse.csr_array:
    """Return the mean matrix of the surfaces' Dirichlet energies, by the template's areas."""
    # It sees changes relative to a triangle's height, also of its area, which metrics of normals
    # ignore: where a triangle loses its area, steps are far shorter than elsewhere.
    blocks = np.zeros((template.n_faces, 9, 9))
    for surface in surfaces:
        add_blocks(blocks, surface, template.faces, [(np.eye(6), template.face_areas)])
    return template.assembler.assemble(blocks / len(surfaces))


def _block_norms(metric: RiemannianMetric, points: Points) -> Array:
    """Estimate (Σ_j M_ij M_ijᵀ)^½ for each entry i along a point's first axis; on fields M_ii."""
    shape = metric.space.shape
    one_block = math.prod(shape) <= _LARGEST_BLOCK
    length = 1 if one_block else shape[0]
    size = math.prod(shape) // length
    rng = np.random.default_rng(0)
    squares = np.zeros((length, size, size))
    n_probes = 1 if one_block else _N_PROBES
    for _ in range(n_probes):
        signs = rng.choice([-1.0, 1.0], length)
        # Entry i of probe k is ± the k-th unit vector.
        probes = signs[:, None] * np.eye(size)[:, None, :]
        probes = probes.reshape(size, 1, *shape) + np.zeros_like(points)
        at = points + np.zeros_like(probes)
        images = metric.covector(metric.space.to_tangent(probes, at), at)
        rows = np.mean(images, axis=1).reshape(size, length, size)
        # Of entry i: the products of its numbers a and b, summed over the probes k.
        squares += np.einsum("kia,kib->iab", rows, rows)
    values, vectors = np.linalg.eigh(squares)
    roots = np.sqrt(np.maximum(values, 0.0) / n_probes)
    norms: Array = (vectors * roots[:, None, :]) @ np.swapaxes(vectors, -1, -2)
    return norms
