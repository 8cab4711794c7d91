"""The inner product of deformations, optionally weighted by vertex, and orthonormal rows."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import read_only


def normalized_weights(weights: ArrayLike | None, n_vertices: int) -> np.ndarray | None:
    """Return vertex weights scaled to mean 1.

    Parameters
    ----------
    weights : array_like, shape (V,), or None
        Positive weights; None stands for 1 everywhere.
    n_vertices : int
        Number of vertices V.

    Returns
    -------
    weights : array, shape (V,), read-only, or None

    Raises
    ------
    ArgumentTypeError
        If the weights are not real numbers.
    ArgumentError
        If the shape is wrong or a weight is not finite and positive.
    """
    if weights is None:
        return None
    values = real_array(weights, "vertex_weights", (n_vertices,), batched=False)
    if not (values > 0).all():
        first = int((values <= 0).argmax())
        raise ArgumentError(
            f"vertex_weights[{first}] = {float(values[first])!r} is not positive; a vertex "
            "without weight would make the inner product degenerate"
        )
    return read_only(values / values.mean())


def weighted_rows(vectors: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
    """Return vectors as rows whose dot products are the weighted inner products.

    Parameters
    ----------
    vectors : array, shape (K, V, 3)
        Deformations.
    weights : array, shape (V,), or None
        Vertex weights.

    Returns
    -------
    rows : array, shape (K, 3V)
    """
    if weights is not None:
        vectors = vectors * np.sqrt(weights)[:, np.newaxis]
    return vectors.reshape(len(vectors), -1)


def vectors_of_rows(rows: np.ndarray, weights: np.ndarray | None) -> np.ndarray:
    """Return vectors from rows, the inverse of `weighted_rows`.

    Parameters
    ----------
    rows : array, shape (K, 3V)
        Rows.
    weights : array, shape (V,), or None
        Vertex weights.

    Returns
    -------
    vectors : array, shape (K, V, 3)
    """
    vectors = rows.reshape(len(rows), -1, 3)
    return vectors if weights is None else vectors / np.sqrt(weights)[:, np.newaxis]


def orthonormal_rows(rows: np.ndarray, name: str) -> np.ndarray:
    """Orthonormalise rows by the Gram–Schmidt process.

    Parameters
    ----------
    rows : array, shape (K, n)
        Rows of any length.
    name : str
        Name of the rows, for messages.

    Returns
    -------
    rows : array, shape (K, n), C-contiguous
        The first k rows have the span of the first k given rows, for every k.

    Raises
    ------
    ArgumentError
        If the rows are linearly dependent.
    """
    sizes = np.linalg.norm(rows, axis=1)
    sizes[sizes == 0] = 1.0
    columns, triangle = np.linalg.qr((rows / sizes[:, np.newaxis]).T)
    values = np.linalg.svd(triangle, compute_uv=False)
    rank = int(np.sum(values > max(rows.shape) * np.finfo(np.float64).eps * values.max()))
    if rank < len(rows):
        raise ArgumentError(
            f"{name} must be linearly independent; the rank of these {len(rows)} is {rank}"
        )
    return np.ascontiguousarray((columns * np.sign(triangle.diagonal())).T)
