"""Correspondence between the points of a surface and a body model or template of another mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import sparse

from riemhuman.bodies.skinned_model import SkinnedModel
from riemhuman.checks import integer_array, real_array
from riemhuman.errors import ArgumentError
from riemhuman.surfaces.template import Template

_SUM_TOLERANCE = 1e-6


def combination_of_vertices(
    model: SkinnedModel | Template, correspondence: Any
) -> sparse.csr_array:
    """Return the points of a correspondence as combinations of a model's vertices.

    Parameters
    ----------
    model : SkinnedModel or Template
        The model, or any mesh.
    correspondence : array_like of int, pair, or sparse matrix, optional
        Numbers of vertices, shape (n_points,); or a pair of numbers of triangles, shape
        (n_points,), and barycentric coordinates, shape (n_points, 3); or a matrix, shape
        (n_points, V), whose rows sum to one. By default every vertex is a point.

    Returns
    -------
    matrix : scipy.sparse.csr_array, shape (n_points, V)

    Raises
    ------
    ArgumentTypeError
        If it does not hold numbers of the right kind.
    ArgumentError
        If it has another shape, refers to vertices or triangles that do not exist, or has rows that
        do not sum to one.
    """
    n_vertices = model.n_vertices
    if correspondence is None:
        return sparse.csr_array(sparse.eye_array(n_vertices))
    if sparse.issparse(correspondence):
        matrix = sparse.csr_array(correspondence, dtype=np.float64)
        if matrix.shape[1] != n_vertices:
            raise ArgumentError(
                f"correspondence must have shape (n_points, {n_vertices}); found {matrix.shape}"
            )
        matrix.sum_duplicates()
        coordinates = matrix.data
        sums = matrix.sum(axis=1)
    elif (
        isinstance(correspondence, Sequence)
        and len(correspondence) == 2
        and np.ndim(correspondence[0])
    ):
        triangles = integer_array(correspondence[0], "triangles of correspondence", ("n_points",))
        _refuse_outside(triangles, len(model.faces), "triangles")
        shape = (len(triangles), 3)
        coordinates = real_array(
            correspondence[1], "barycentric coordinates of correspondence", shape, batched=False
        )
        rows = np.repeat(np.arange(len(triangles)), 3)
        entries = (coordinates.ravel(), (rows, model.faces[triangles].ravel()))
        matrix = sparse.csr_array(entries, shape=(len(triangles), n_vertices))
        sums = coordinates.sum(axis=1)
    else:
        vertices = integer_array(correspondence, "correspondence", ("n_points",))
        _refuse_outside(vertices, n_vertices, "vertices")
        entries = (np.ones(len(vertices)), (np.arange(len(vertices)), vertices))
        return sparse.csr_array(entries, shape=(len(vertices), n_vertices))
    if not np.isfinite(coordinates).all() or (np.abs(sums - 1.0) > _SUM_TOLERANCE).any():
        worst = int(np.argmax(np.abs(sums - 1.0)))
        raise ArgumentError(
            f"correspondence must have rows that sum to one; row {worst} sums to {sums[worst]:g}"
        )
    return matrix


def _refuse_outside(numbers: np.ndarray, count: int, name: str) -> None:
    if not numbers.size or numbers.min() < 0 or numbers.max() >= count:
        found = f"numbers from {numbers.min()} to {numbers.max()}" if numbers.size else "none"
        raise ArgumentError(
            f"correspondence must number {name} of the model, from 0 to {count - 1}; found {found}"
        )
