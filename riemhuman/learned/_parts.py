r"""Bodies described by the rotations and stretches of parts instead of vertex positions.

The deformation gradient of a triangle, which takes it and its normal from the template to a body,
is close to a combination of the mean gradients :math:`A_k` of a few parts,
:math:`G_f = \sum_k w_{fk} A_k`. The polar decomposition :math:`A_k = R_k S_k` separates the
rotation of a part from its stretch. The surface follows from the :math:`A_k` by a Poisson equation,
which is linear (Sumner and Popović, "Deformation transfer for triangle meshes", 2004; Gao, Lai,
Yang, Zhang, Xia and Kobbelt, "Sparse data driven mesh deformation", 2019, use such features of
single vertices).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array, ArrayLike, Integers
from riemhuman.errors import FileFormatError
from riemhuman.kernels.rotations import log, nearest_rotations, rotation_matrix
from riemhuman.kernels.surface import (
    deformation_gradients,
    is_degenerate,
    partial_derivatives,
    refuse_degenerate,
    stacked_derivatives,
    triangle_frames,
    unit_normals,
)
from riemhuman.kernels.threads import slices
from riemhuman.learned._weight_files import Weights
from riemhuman.surfaces import Template

# Number of surfaces whose gradients are held in memory together.
_BLOCK = 64

# Entries of a symmetric matrix.
_ROWS, _COLUMNS = np.triu_indices(3)


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of a template: from surfaces to rotations and stretches of parts, and back."""

    template: Template
    part_of: Integers  # (F,) the part of each triangle
    weights: Array  # (F, K) of each part in the gradient of each triangle
    # (K,) what each rotation is relative to: another part, or for the root, -1, the whole body
    parents: Integers

    @classmethod
    def read(cls, weights: Weights, n_parts: int) -> Parts:
        """Return the parts stored in a file."""
        template = weights.template
        part_of = weights.indices("part_of", (template.n_faces,), 0, n_parts)
        if len(np.unique(part_of)) < n_parts:
            raise FileFormatError("part_of must name every part")
        parents = weights.indices("part_parents", (n_parts,), -1, n_parts)
        blend = weights.numbers("part_weights", (template.n_faces, n_parts))
        parts = cls(template, part_of, blend, parents)
        if np.count_nonzero(parents < 0) != 1 or len(parts.order) < n_parts:
            raise FileFormatError("part_parents must be a tree, with one root and no cycle")
        return parts

    @property
    def n_parts(self) -> int:
        """Number of parts K."""
        return len(self.parents)

    @cached_property
    def order(self) -> list[int]:
        """The parts that the root reaches, parents before their children."""
        order = np.flatnonzero(self.parents < 0).tolist()
        for part in order:  # the list grows while it is read
            order += np.flatnonzero(self.parents == part).tolist()
        return order

    @cached_property
    def operator(self) -> Array:
        """Matrix from gradients of parts to vertices about their mean, shape (V, 3 K)."""
        template = self.template
        frames = triangle_frames(template.vertices, template.differential_operator)
        origin = np.zeros((template.n_vertices, 3))
        columns = [
            template.interpolator.surface_of(
                stacked_derivatives(weight[:, None, None] * frames), origin
            )
            for weight in self.weights.T
        ]
        return np.concatenate(columns, axis=1)

    def split(self, points: Array) -> tuple[Array, Array]:
        """Return features (n, 9 K) and rotations (n, 3, 3) of bodies (n, V, 3)."""
        if not len(points):
            return np.empty((0, 9 * self.n_parts)), np.empty((0, 3, 3))
        features = np.empty((len(points), 9 * self.n_parts))
        frames = np.empty((len(points), 3, 3))
        for block in slices(len(points), _BLOCK):
            features[block], frames[block] = self._split_block(points[block])
        return features, frames

    def _split_block(self, points: Array) -> tuple[Array, Array]:
        means = self._mean_gradients(points)
        rotations = nearest_rotations(means)
        frames = nearest_rotations(np.tensordot(means, self._shares, axes=(1, 0)))
        is_root = (self.parents < 0)[:, None, None]
        parents = np.where(is_root, frames[:, None], rotations[:, self.parents])
        vectors = log(parents, rotations).reshape(len(points), -1)
        stretches = rotations.swapaxes(-1, -2) @ means
        stretches = 0.5 * (stretches + stretches.swapaxes(-1, -2)) - np.eye(3)
        entries = stretches[..., _ROWS, _COLUMNS].reshape(len(points), -1)
        return np.concatenate([vectors, entries], axis=1), frames

    def _mean_gradients(self, points: Array) -> Array:
        """Return the mean gradients of all parts, shape (n, K, 3, 3)."""
        moved = gradients(self.template, points)
        rows = np.swapaxes(moved, 0, 1).reshape(moved.shape[1], -1)
        means = (self._means @ rows).reshape(self.n_parts, len(points), 3, 3)
        return np.swapaxes(means, 0, 1)

    def surfaces(
        self,
        features: Array,
        backend: ModuleType = np,
        operator: ArrayLike | None = None,
        matrices: Callable[[Array], Array] = rotation_matrix,
    ) -> Array:
        """Return the surfaces (n, V, 3) with given features (n, 9 K), by NumPy or PyTorch."""
        count = self.n_parts
        n_bodies = features.shape[0]
        vectors = features[:, : 3 * count].reshape(n_bodies, count, 3)
        halves = features[:, 3 * count :].reshape(n_bodies, count, 6)
        rotations = self._chain(matrices(vectors), backend)
        xx, xy, xz, yy, yz, zz = (halves[..., i] for i in range(6))
        entries = [1.0 + xx, xy, xz, xy, 1.0 + yy, yz, xz, yz, 1.0 + zz]
        stretches = backend.stack(entries, -1).reshape(n_bodies, count, 3, 3)
        means = backend.swapaxes(rotations @ stretches, 2, 3).reshape(n_bodies, 3 * count, 3)
        surfaces: Array = (self.operator if operator is None else operator) @ means
        return surfaces

    def _chain(self, transforms: Array, backend: ModuleType) -> Array:
        chained = [transforms[:, part] for part in range(self.n_parts)]
        for part in self.order[1:]:
            chained[part] = chained[self.parents[part]] @ chained[part]
        stacked: Array = backend.stack(chained, 1)
        return stacked

    @cached_property
    def _means(self) -> sparse.csr_array:
        """Matrix from values at triangles to their means over parts, shape (K, F)."""
        areas = self.template.face_areas
        entries = areas / np.bincount(self.part_of, areas, self.n_parts)[self.part_of]
        return sparse.csr_array((entries, (self.part_of, np.arange(len(entries)))))

    @cached_property
    def _shares(self) -> Array:
        """Share of each part in the area, shape (K,)."""
        sums = np.bincount(self.part_of, self.template.face_areas, self.n_parts)
        shares: Array = sums / sums.sum()
        return shares


def gradients(template: Template, points: Array) -> Array:
    """Return the deformation gradients of triangles, shape (n, F, 3, 3)."""
    operator = template.differential_operator
    f_u, f_v = partial_derivatives(points, operator)
    refuse_degenerate(is_degenerate(f_u, f_v), "X")
    after = np.stack([f_u, f_v, unit_normals(f_u, f_v)], axis=-1)
    return deformation_gradients(triangle_frames(template.vertices, operator), after)
