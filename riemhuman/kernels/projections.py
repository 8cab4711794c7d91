"""Projections of rows and fields to fewer coordinates: principal components, means over patches."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy import ndarray


class Projection:
    """A projection that never increases distances: principal components and the residual's norm.

    For an orthogonal projection P, |u − v|² ≥ |Pu − Pv|² + (|u − Pu| − |v − Pv|)² by the triangle
    inequality for the residuals.
    """

    def __init__(self, mean: ndarray, components: ndarray) -> None:
        self.mean = mean
        self.components = components

    @classmethod
    def fit(cls, sample: ndarray, n_components: int) -> Self:
        """Return the projection to the principal components of a sample."""
        mean = sample.mean(axis=0)
        centered = sample - mean
        values, vectors = np.linalg.eigh(centered @ centered.T)
        kept = np.flatnonzero(values > 1e-12 * values[-1])[::-1][:n_components]
        # QR makes the components orthonormal to rounding; otherwise distances could increase.
        orthonormal, _ = np.linalg.qr(centered.T @ (vectors[:, kept] / np.sqrt(values[kept])))
        return cls(mean, np.ascontiguousarray(orthonormal.T))

    def __call__(self, rows: ndarray) -> ndarray:
        """Return the projected rows."""
        centered = rows - self.mean
        projected = centered @ self.components.T
        rest = np.sum(centered**2, axis=1) - np.sum(projected**2, axis=1)
        return np.column_stack([projected, np.sqrt(np.maximum(rest, 0.0))])


def patch_coordinates(values: ndarray, areas: ndarray, patches: ndarray | None = None) -> ndarray:
    r"""Return coordinates whose distances are at most those of fields, :math:`L^2(T)`.

    A field on a patch P is its mean and a rest, orthogonal to each other. With w_P the area of P,
    ‖u − v‖² ≥ Σ_P (w_P |ū_P − v̄_P|² + (‖rest of u‖_P − ‖rest of v‖_P)²): Jensen's inequality, and
    the triangle inequality for the rest.
    """
    leading = values.shape[:-2]
    if patches is None:
        return (np.sqrt(areas)[:, None] * values).reshape(*leading, -1)
    order = np.argsort(patches, kind="stable")
    starts = np.flatnonzero(np.diff(patches[order], prepend=-1))
    weighted = (areas[:, None] * values)[..., order, :]
    patch_areas = np.add.reduceat(areas[order], starts)[:, None]
    means = np.add.reduceat(weighted, starts, axis=-2) / patch_areas
    rest = values[..., order, :] - np.repeat(means, np.diff(starts, append=len(order)), axis=-2)
    squares = np.sum(areas[order, None] * rest**2, axis=-1)
    rests = np.sqrt(np.add.reduceat(squares, starts, axis=-1))[..., None]
    coordinates = np.concatenate([np.sqrt(patch_areas) * means, rests], axis=-1)
    return coordinates.reshape(*leading, -1)


def triangle_patches(vertices: ndarray, faces: ndarray, n_patches: int) -> ndarray:
    """Group triangles into patches, halving the largest along its longest side again and again."""
    centers = vertices[faces].mean(axis=1)
    groups = [np.arange(len(centers))]
    while len(groups) < min(n_patches, len(centers)):
        largest = max(range(len(groups)), key=lambda k: len(groups[k]))
        members = groups.pop(largest)
        axis = np.argmax(np.ptp(centers[members], axis=0))
        ranked = members[np.argsort(centers[members, axis], kind="stable")]
        half = len(ranked) // 2
        groups += [ranked[:half], ranked[half:]]
    patches = np.empty(len(centers), dtype=np.int64)
    for number, members in enumerate(groups):
        patches[members] = number
    return patches
