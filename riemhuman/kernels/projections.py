"""Projections of rows to principal components, and coordinates of fields."""

from __future__ import annotations

from collections.abc import Callable
from typing import Self

import numpy as np

from riemhuman.arrays import Array, Points
from riemhuman.kernels.surface import joined_axes
from riemhuman.kernels.threads import slices

# Eigenvalues of a Gram matrix below this share of the largest are rounding errors.
_ROUNDING = 1e-12
_BLOCK = 16  # points at a time


class Projection:
    """A projection that never increases distances: principal components and the residual's norm.

    For an orthogonal projection P, |u − v|² ≥ |Pu − Pv|² + (|u − Pu| − |v − Pv|)² by the triangle
    inequality for the residuals.
    """

    def __init__(self, mean: Array, components: Array) -> None:
        self.mean = mean
        self.components = components

    @classmethod
    def fit(cls, sample: Array, n_components: int) -> Self:
        """Return the projection to the principal components of a sample."""
        mean, components = principal_components(sample, n_components)
        # QR makes the components orthonormal to rounding; otherwise distances could increase.
        orthonormal, _ = np.linalg.qr(components.T)
        return cls(mean, np.ascontiguousarray(orthonormal.T))

    def __call__(self, rows: Array) -> Array:
        """Return the projected rows."""
        centered = rows - self.mean
        projected = centered @ self.components.T
        squared_residuals = np.sum(centered**2, axis=1) - np.sum(projected**2, axis=1)
        return np.column_stack([projected, np.sqrt(np.maximum(squared_residuals, 0.0))])


def principal_components(sample: Array, n_components: int | None = None) -> tuple[Array, Array]:
    """Return the mean of rows and their principal directions, shape (k, m), the largest first."""
    mean = sample.mean(axis=0)
    centered = sample - mean
    # By the Gram matrix: there are far fewer rows than columns.
    values, vectors = np.linalg.eigh(centered @ centered.T)
    ascending = np.flatnonzero(values > _ROUNDING * max(values[-1], 0.0))
    largest = ascending[::-1][:n_components]
    return mean, (vectors[:, largest] / np.sqrt(values[largest])).T @ centered


def with_positive_peaks(rows: Array) -> Array:
    """Return rows with signs that make the largest entry of each positive."""
    peaks = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)
    return rows * np.sign(peaks)


def field_coordinates(values: Array, areas: Array) -> Array:
    r"""Return coordinates whose distances are those of fields, :math:`L^2(T)`."""
    return joined_axes(np.sqrt(areas)[:, None] * values, 2)


def in_blocks(function: Callable[[Array], Array], points: Points) -> Array:
    """Return rows that a function computes of points, some at a time to save memory."""
    if not len(points):
        return function(points)
    return np.concatenate([function(points[part]) for part in slices(len(points), _BLOCK)])
