r"""Interpolation of deformation gradients, joined to surfaces by a Poisson equation.

From f₀ to f₁, every triangle rotates by R and stretches. Interpolating both,

.. math:: J(t) = R^t \left((1-t) J_0 + t R^T J_1\right),

with J = (f_u, f_v), bends limbs where a straight path would shrink them. The surface whose
derivatives are closest to J(t) in the least squares sense solves a Poisson equation on the template
(Xu, Zhang, Wang and Bao, "Poisson shape interpolation", SPM 2005).
"""

from __future__ import annotations

from copy import copy

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order, connected_components, minimum_spanning_tree
from scipy.sparse.linalg import SuperLU, splu

from riemhuman.arrays import Array, Booleans, Integers, Points, TangentVectors, Triangles
from riemhuman.kernels.rotations import log, nearest_rotations
from riemhuman.kernels.surface import deformation_gradients, dot, triangle_frames, unit_vectors
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.surfaces.measures import adjacent_triangles, vertex_components


class PoissonInterpolator:
    """Interpolates surfaces over one mesh, whose matrix is factorised once."""

    def __init__(
        self,
        faces: Triangles,
        differential_operator: sparse.csr_array,
        face_areas: Array,
        first_copies: Integers | None = None,
    ) -> None:
        n_vertices = differential_operator.shape[1]
        numbers = np.arange(n_vertices)
        # Of vertices that a seam doubles, the first copy alone is sought, and the others follow.
        self._copies = first_copies
        if first_copies is not None:
            copying = sparse.csr_array(
                (np.ones(n_vertices), (numbers, first_copies)), shape=(n_vertices, n_vertices)
            )
            differential_operator = (differential_operator @ copying).tocsr()
        self._areas, self._operator = face_areas, differential_operator
        # Derivatives do not determine translations: one vertex of each component is fixed.
        component = vertex_components(faces, n_vertices)
        _, anchors, sizes = np.unique(component, return_index=True, return_counts=True)
        self._free = np.setdiff1d(numbers, anchors)
        self._component = component
        self._average = sparse.csr_array((1.0 / sizes[component], (component, numbers)))
        self._neighbours, _ = adjacent_triangles(faces)
        self._divergence, self._factor = self._equation(face_areas)

    def _equation(self, weights: Array) -> tuple[sparse.csr_array, SuperLU]:
        """Return the divergence and the factorised Laplacian, with these weights of triangles."""
        divergence = self._operator.T @ sparse.diags_array(np.tile(weights, 2))
        laplacian = (divergence @ self._operator).tocsc()
        return divergence, splu(laplacian[self._free][:, self._free])

    def with_weights(self, weights: Array) -> PoissonInterpolator:
        """Return an interpolator in which the areas of triangles are multiplied by weights."""
        interpolator = copy(self)
        interpolator._divergence, interpolator._factor = self._equation(self._areas * weights)
        return interpolator

    def rotations(self, start: Points, end: Points) -> Array:
        """Return the shortest rotations of the triangles between two surfaces, shape (F, 3)."""
        before = triangle_frames(start, self._operator)
        after = triangle_frames(end, self._operator)
        return log(np.eye(3), nearest_rotations(deformation_gradients(before, after)))

    def unwrap(self, rotations: Array) -> Array:
        """Return the same rotations plus multiples of 2π, so that neighbours rotate alike."""
        triangle_a, triangle_b = self._neighbours.T
        gaps = rotations[triangle_a] - rotations[triangle_b]
        if not np.any(np.sum(gaps * gaps, axis=1) > np.pi**2):
            return rotations
        # From the triangle that rotates least across the edges where rotations differ least.
        tree = self._tree_of_least_gaps(rotations)
        angles = np.linalg.norm(rotations, axis=1)
        component = connected_components(tree, directed=False)[1]
        order = np.argsort(angles, kind="stable")
        _, places = np.unique(component[order], return_index=True)
        # Plain numbers: the loop goes from triangle to triangle.
        factors = [1.0] * len(rotations)
        for root in order[places]:
            triangles, predecessors = breadth_first_order(tree, root, directed=False)
            triangles = triangles[1:]
            triangles = triangles[angles[triangles] > 0.0]
            parents = predecessors[triangles]
            # Parts of the parents' rotation vectors along the axes of their children.
            along = dot(rotations[triangles], rotations[parents]) / angles[triangles]
            for triangle, parent, share, angle in zip(
                triangles.tolist(),
                parents.tolist(),
                along.tolist(),
                angles[triangles].tolist(),
                strict=True,
            ):
                turns = round((factors[parent] * share - angle) / (2.0 * np.pi))
                factors[triangle] = 1.0 + 2.0 * np.pi * turns / angle
        return np.array(factors)[:, None] * rotations

    def _tree_of_least_gaps(self, rotations: Array) -> sparse.csr_array:
        """Return the spanning tree of neighbours whose rotations differ least."""
        angles = np.linalg.norm(rotations, axis=1)
        # sin(angle / 2) / angle, also where the angle is 0.
        shares = 0.5 * np.sinc(angles / (2.0 * np.pi))
        quaternions = np.column_stack([np.cos(0.5 * angles), shares[:, None] * rotations])
        quaternion_a, quaternion_b = quaternions[self._neighbours.T]
        gaps = np.minimum(
            np.sum((quaternion_a - quaternion_b) ** 2, axis=1),
            np.sum((quaternion_a + quaternion_b) ** 2, axis=1),
        )
        links = sparse.csr_array(
            # An entry of zero would be no link; SciPy's trees want 32-bit indices.
            (gaps + np.finfo(float).tiny, self._neighbours.T.astype(np.int32)),
            shape=(len(rotations), len(rotations)),
        )
        return minimum_spanning_tree(links)

    def parts(self, chosen: Booleans) -> list[Integers]:
        """Return the connected parts of a set of triangles, the largest first."""
        both_chosen = chosen[self._neighbours].all(axis=1)
        triangle_a, triangle_b = self._neighbours[both_chosen].T
        shape = (len(chosen), len(chosen))
        links = sparse.coo_array((np.ones(len(triangle_a)), (triangle_a, triangle_b)), shape=shape)
        _, labels = connected_components(links, directed=False)
        triangles = np.flatnonzero(chosen)
        numbers, part = np.unique(labels[triangles], return_inverse=True)
        areas = np.bincount(part, self._areas[triangles], minlength=len(numbers))
        return [triangles[part == k] for k in np.argsort(-areas, kind="stable")]

    def interpolate(
        self, start: Points, end: Points, times: Array, rotations: Array | None = None
    ) -> Array:
        """Return the surfaces (n, V, 3) between two surfaces at some times (n,) in [0, 1]."""
        if len(times) == 0:
            return np.empty((0, *start.shape))
        if rotations is None:
            rotations = self.rotations(start, end)
        source = self.rotated_sources(start, end, times, rotations)
        centroids_before = (self._average @ start)[:, None]
        centroids_after = (self._average @ end)[:, None]
        weights = times[:, None]
        return self._solve(source, (1.0 - weights) * centroids_before + weights * centroids_after)

    def rotated_sources(self, start: Points, end: Points, times: Array, rotations: Array) -> Array:
        """Return the divergences of J(t), shape (V, n, 3)."""
        derivatives_before = (self._operator @ start).reshape(2, -1, 3)
        derivatives_after = (self._operator @ end).reshape(2, -1, 3)
        angles, axes = np.linalg.norm(rotations, axis=1), unit_vectors(rotations)
        # Rᵀ J₁, the derivatives at the end turned back by the whole angle.
        turned_back = np.matmul(_shares(-angles)[:, None], _parts(derivatives_after, axes))[
            ..., 0, :
        ]
        # The sum of both ends, rotated, is one product with six parts a triangle.
        shares = _shares(angles[:, None] * times)
        shares_of_both = np.concatenate(
            [(1.0 - times)[:, None] * shares, times[:, None] * shares], axis=-1
        )
        parts_of_both = np.concatenate(
            [_parts(derivatives_before, axes), _parts(turned_back, axes)], axis=-2
        )
        derivatives = np.matmul(shares_of_both, parts_of_both)
        n_rows = derivatives.shape[0] * derivatives.shape[1]
        source: Array = self._divergence @ derivatives.reshape(n_rows, -1)
        return source.reshape(-1, len(times), 3)

    def surface_of(self, derivatives: Array, placed_as: Array) -> Array:
        """Return the surface whose first derivatives are closest to given ones."""
        source = self._divergence @ derivatives
        surface: Array = self._solve(source[:, None], (self._average @ placed_as)[:, None])[0]
        return surface

    def _solve(self, source: Points, centroids: Array) -> Array:
        """Return the surfaces, shape (n, V, 3), with divergences (V, n, 3) and given centroids."""
        points = np.zeros((len(source), source[0].size))
        with single_threaded_libraries():
            points[self._free] = self._factor.solve(source.reshape(points.shape)[self._free])
        averages = self._average @ points
        points += (centroids.reshape(averages.shape) - averages)[self._component]
        if self._copies is not None:
            points = points[self._copies]
        return np.ascontiguousarray(np.swapaxes(points.reshape(source.shape), 0, 1))


def _parts(vectors: TangentVectors, axes: Array) -> Array:
    """Return the parts of vectors across axes, their cross products, and the parts along."""
    along = dot(vectors, axes)[..., None] * axes
    return np.stack([vectors - along, np.cross(axes, vectors), along], axis=-2)


def _shares(angles: Array) -> Array:
    """Return the shares of these parts in vectors rotated about the axes."""
    return np.stack([np.cos(angles), np.sin(angles), np.ones_like(angles)], axis=-1)
