r"""Bodies described by the rotations and stretches of parts instead of vertex positions.

The deformation gradient of a triangle, which takes it and its normal from the template to a body,
is close to a combination of the mean gradients :math:`A_k` of a few parts,
:math:`G_f = \sum_k w_{fk} A_k`. Clustering finds the parts, triangles that move alike on many
bodies, and regression the weights :math:`w`. The polar decomposition :math:`A_k = R_k S_k`
separates the rotation of a part from its stretch. The surface follows from the :math:`A_k` by a
Poisson equation, which is linear (Sumner and Popović, "Deformation transfer for triangle meshes",
2004; Gao, Lai, Yang, Zhang, Xia and Kobbelt, "Sparse data driven mesh deformation", 2019, use such
features of single vertices).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.cluster.vq import kmeans2
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from riemhuman.errors import ArgumentError
from riemhuman.kernels.special_orthogonal import log, nearest_rotations
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.kernels.triangle_frames import (
    deformation_gradients,
    stacked_derivatives,
    triangle_frames,
)
from riemhuman.representation import Record
from riemhuman.surfaces.template import Template
from riemhuman.surfaces.triangle_heat import adjacent_triangles

# Number of surfaces whose gradients are held in memory together.
_BLOCK = 64
# Dimensions in which motions of triangles are compared, relative ridge of the regression of the
# weights, and rounds of clustering.
_DIRECTIONS, _RIDGE, _ROUNDS = 64, 1e-5, 30
# Entries of a symmetric matrix.
_ROWS, _COLUMNS = np.triu_indices(3)


@dataclass(frozen=True, eq=False, repr=False)
class Parts(Record):
    """Parts of a template: from surfaces to rotations and stretches of parts, and back.

    Attributes
    ----------
    template : Template
        The template.
    part_of : array of int, shape (F,)
        Part of each triangle.
    weights : array, shape (F, K)
        Weight of each part in the deformation gradient of each triangle.
    parents : array of int, shape (K,)
        Part that the rotation of each part is relative to; -1 for the root, whose rotation is
        relative to the whole body.
    """

    template: Template
    part_of: ndarray
    weights: ndarray
    parents: ndarray

    @property
    def n_parts(self) -> int:
        """Number of parts K."""
        return len(self.parents)

    @cached_property
    def levels(self) -> list[tuple[ndarray, ndarray]]:
        """Parts at each depth of the tree, with the positions of their parents one level above."""
        found = []
        above = np.flatnonzero(self.parents < 0)
        found.append((above, np.zeros(1, dtype=np.int64)))
        while len(above):
            below = np.flatnonzero(np.isin(self.parents, above))
            places = np.searchsorted(above, self.parents[below])
            if len(below):
                found.append((below, places))
            above = below
        return found

    @cached_property
    def operator(self) -> ndarray:
        """Matrix from gradients of parts to vertices about their mean, shape (V, 3 K)."""
        template = self.template
        frames = triangle_frames(template.vertices, template.differential_operator)
        nowhere = np.zeros((template.n_vertices, 3))
        columns = [
            template.interpolator.surface_of(
                stacked_derivatives(weight[:, None, None] * frames), nowhere
            )
            for weight in self.weights.T
        ]
        return np.concatenate(columns, axis=1)

    def split(self, points: ndarray) -> tuple[ndarray, ndarray]:
        """Return rotations and stretches of all parts, and the rotations of the bodies.

        Parameters
        ----------
        points : array, shape (n, V, 3)
            Surfaces without triangles of zero area.

        Returns
        -------
        features : array, shape (n, 9 K)
            Rotation vectors of all parts relative to their parents, in radians, then the upper
            triangles of S - I.
        frames : array, shape (n, 3, 3)
            Rotation of each body: the nearest to the mean of all gradients.
        """
        features = np.empty((len(points), 9 * self.n_parts))
        frames = np.empty((len(points), 3, 3))
        for start in range(0, len(points), _BLOCK):
            some = slice(start, start + _BLOCK)
            features[some], frames[some] = self._split(points[some])
        return features, frames

    def gradients(self, points: ndarray) -> ndarray:
        """Return the mean deformation gradients of all parts, and their stretches.

        Parameters
        ----------
        points : array, shape (n, V, 3)
            Surfaces without triangles of zero area.

        Returns
        -------
        array, shape (n, 15 K)
            The gradients, then the upper triangles of S - I.
        """
        found = np.empty((len(points), 15 * self.n_parts))
        for start in range(0, len(points), _BLOCK):
            some = slice(start, start + _BLOCK)
            means = self._gradients(points[some])
            halves = _stretches(means, nearest_rotations(means))
            found[some, : 9 * self.n_parts] = means.reshape(len(means), -1)
            found[some, 9 * self.n_parts :] = halves.reshape(len(means), -1)
        return found

    def _gradients(self, points: ndarray) -> ndarray:
        """Return the mean gradients of all parts, shape (n, K, 3, 3)."""
        moved = np.swapaxes(gradients(self.template, points), 0, 1)
        means = self._means @ moved.reshape(self.template.n_faces, -1)
        return np.swapaxes(means.reshape(self.n_parts, len(points), 3, 3), 0, 1)

    def _split(self, points: ndarray) -> tuple[ndarray, ndarray]:
        means = self._gradients(points)
        turns = nearest_rotations(means)
        frames = nearest_rotations(np.tensordot(means, self._shares, axes=(1, 0)))
        against = np.where(
            (self.parents < 0)[:, None, None], frames[:, None], turns[:, self.parents]
        )
        vectors = log(against, turns)
        halves = _stretches(means, turns)
        flat = [part.reshape(len(points), -1) for part in (vectors, halves)]
        return np.concatenate(flat, axis=1), frames

    def surfaces(self, features: Any, backend: ModuleType = np, operator: Any = None) -> Any:
        """Return the surfaces with given rotations and stretches of parts.

        Parameters
        ----------
        features : array, shape (n, 9 K)
            Features as `split` returns them.
        backend : module
            NumPy, or PyTorch if the features are a tensor.
        operator : tensor, optional
            Rows of `operator` for the vertices to return; by default all.

        Returns
        -------
        array, shape (n, V, 3)
            Surfaces without the rotations of the bodies, with the mean vertex at the origin.
        """
        count = self.n_parts
        n_bodies = features.shape[0]
        vectors = features[:, : 3 * count].reshape(n_bodies, count, 3)
        halves = features[:, 3 * count :].reshape(n_bodies, count, 6)
        turns = self._chained(_rotations(vectors, backend), backend)
        xx, xy, xz, yy, yz, zz = (halves[..., i] for i in range(6))
        entries = [1.0 + xx, xy, xz, xy, 1.0 + yy, yz, xz, yz, 1.0 + zz]
        stretches = backend.stack(entries, -1).reshape(n_bodies, count, 3, 3)
        means = backend.swapaxes(turns @ stretches, 2, 3).reshape(n_bodies, 3 * count, 3)
        return (self.operator if operator is None else operator) @ means

    def _chained(self, own: Any, backend: ModuleType) -> Any:
        found = [own[:, self.levels[0][0]]]
        for parts, places in self.levels[1:]:
            found.append(found[-1][:, places] @ own[:, parts])
        order = np.concatenate([parts for parts, _ in self.levels])
        return backend.concatenate(found, 1)[:, np.argsort(order)]

    @cached_property
    def _means(self) -> sparse.csr_array:
        """Matrix from values at triangles to their means over parts, shape (K, F)."""
        areas = self.template.face_areas
        sums = np.bincount(self.part_of, areas, self.n_parts)
        entries = areas / sums[self.part_of]
        return sparse.csr_array((entries, (self.part_of, np.arange(len(areas)))))

    @cached_property
    def _shares(self) -> ndarray:
        """Share of each part in the area of the template, shape (K,)."""
        sums = np.bincount(self.part_of, self.template.face_areas, self.n_parts)
        return sums / sums.sum()


def gradients(template: Template, points: ndarray) -> ndarray:
    """Return the deformation gradients of all triangles.

    Parameters
    ----------
    template : Template
        The template.
    points : array, shape (n, V, 3)
        Surfaces without triangles of zero area.

    Returns
    -------
    array, shape (n, F, 3, 3)
    """
    operator = template.differential_operator
    return deformation_gradients(
        triangle_frames(template.vertices, operator), triangle_frames(points, operator)
    )


def _stretches(means: ndarray, turns: ndarray) -> ndarray:
    """Return the upper triangles of S - I of polar decompositions R S, shape (n, K, 6)."""
    stretches = turns.swapaxes(-1, -2) @ means
    stretches = 0.5 * (stretches + stretches.swapaxes(-1, -2)) - np.eye(3)
    return stretches[..., _ROWS, _COLUMNS]


def find_parts(
    template: Template, points: ndarray, n_parts: int, rng: np.random.Generator
) -> Parts:
    """Find parts whose triangles move alike on many bodies.

    Parameters
    ----------
    template : Template
        The template.
    points : array, shape (n, V, 3)
        Bodies of different people in different poses.
    n_parts : int
        Largest number of parts.
    rng : numpy.random.Generator
        Generator of the start of clustering.

    Returns
    -------
    Parts

    Raises
    ------
    ArgumentError
        If the template has too few triangles, or is not connected.
    """
    areas, n_faces = template.face_areas, template.n_faces
    if n_parts >= n_faces:
        raise ArgumentError(
            f"n_parts={n_parts} must be less than the number of triangles, {n_faces}"
        )
    moved = gradients(template, points).transpose(1, 0, 2, 3).reshape(n_faces, -1)
    with single_threaded_libraries():
        scale = np.sqrt(areas)[:, None]
        directions, squares = _principal(scale * moved)
        # Motions of triangles, as metres that the end of a limb of one metre moves, and places.
        ways = directions * np.sqrt(squares / moved.shape[1]) / scale
        places = template.vertices[template.faces].mean(axis=1)
        part_of = kmeans2(
            np.concatenate([ways, places], axis=1), n_parts, _ROUNDS, minit="++", rng=rng
        )[1]
        _, part_of = np.unique(part_of, return_inverse=True)
        n_parts = int(part_of.max()) + 1
        sums = np.bincount(part_of, areas)
        means = sparse.csr_array((areas / sums[part_of], (part_of, np.arange(n_faces)))) @ moved
        products = means @ means.T
        products += _RIDGE * np.trace(products) / n_parts * np.eye(n_parts)
        weights = np.linalg.solve(products, means @ moved.T).T
    # In half precision, the precision of files.
    weights = weights.astype(np.float16).astype(np.float64)
    turns = nearest_rotations(means.reshape(n_parts, -1, 3, 3))
    return Parts(template, part_of, weights, _tree(template, part_of, turns))


def _principal(rows: ndarray) -> tuple[ndarray, ndarray]:
    """Return the leading left singular vectors as columns, and the squared singular values."""
    n_rows, n_columns = rows.shape
    kept = slice(-min(_DIRECTIONS, n_rows, n_columns), None)
    if n_rows <= n_columns:
        values, vectors = np.linalg.eigh(rows @ rows.T)
        return vectors[:, kept], np.maximum(values[kept], 0.0)
    values, vectors = np.linalg.eigh(rows.T @ rows)
    squares = np.maximum(values[kept], np.finfo(float).eps * values[-1])
    return rows @ vectors[:, kept] / np.sqrt(squares), squares


def _tree(template: Template, part_of: ndarray, turns: ndarray) -> ndarray:
    """Return the parent of each part: a neighbour with a similar rotation."""
    pairs = np.unique(np.sort(part_of[adjacent_triangles(template.faces)[0]], axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    angles = np.linalg.norm(log(turns[pairs[:, 0]], turns[pairs[:, 1]]), axis=-1)
    costs = np.sqrt(np.mean(angles**2, axis=1)) + 1e-6
    n_parts = len(turns)
    graph = sparse.csr_array((costs, tuple(pairs.T)), shape=(n_parts, n_parts))
    tree = minimum_spanning_tree(graph)
    root = int(np.argmax(np.bincount(part_of, template.face_areas)))
    reached, before = breadth_first_order(tree, root, directed=False)
    if len(reached) < n_parts:
        raise ArgumentError("template must be connected; found parts without neighbours")
    return np.where(before < 0, -1, before).astype(np.int64)


def _rotations(vectors: Any, backend: ModuleType) -> Any:
    """Return rotation matrices of rotation vectors (Rodrigues' formula)."""
    squares = (vectors * vectors).sum(-1)
    angles = backend.sqrt(squares + 1e-12)
    sine, half = backend.sin(angles) / angles, backend.sin(0.5 * angles) / angles
    cosine = 2.0 * half * half
    x, y, z = (vectors[..., i] for i in range(3))
    entries = [
        1.0 - cosine * (y * y + z * z),
        cosine * x * y - sine * z,
        cosine * x * z + sine * y,
        cosine * x * y + sine * z,
        1.0 - cosine * (x * x + z * z),
        cosine * y * z - sine * x,
        cosine * x * z - sine * y,
        cosine * y * z + sine * x,
        1.0 - cosine * (x * x + y * y),
    ]
    return backend.stack(entries, -1).reshape(*vectors.shape, 3)
