r"""Interpolation of deformation gradients, joined to surfaces by a Poisson equation.

From f₀ to f₁, every triangle rotates by R and stretches. Interpolating both,

.. math:: J(t) = R^t \left((1-t) J_0 + t R^T J_1\right),

with J = (f_u, f_v), bends limbs where a straight path would shrink them. The surface whose
derivatives are closest to J(t) in the least squares sense solves a Poisson equation on the template
(Xu, Zhang, Wang and Bao, "Poisson shape interpolation", SPM 2005).
"""

from __future__ import annotations

import heapq
import math
from copy import copy

import numpy as np
from numpy import ndarray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.rotations import log, nearest_rotations
from riemhuman.kernels.surface import deformation_gradients, triangle_frames
from riemhuman.kernels.threads import in_chunks, of_one_kind, single_threaded_libraries
from riemhuman.kernels.triangles import derivatives
from riemhuman.surfaces.measures import adjacent_triangles, vertex_components

# Below this many triangles, threads cost more than they bring.
_WORTH_THREADS = 5_000


class PoissonInterpolator:
    """Interpolates surfaces over one mesh, whose matrix is factorised once."""

    def __init__(
        self,
        faces: ndarray,
        frame_coefficients: ndarray,
        differential_operator: sparse.csr_array,
        face_areas: ndarray,
    ) -> None:
        n_vertices = differential_operator.shape[1]
        self._faces, self._frames, self._areas = faces, frame_coefficients, face_areas
        self._operator = differential_operator
        # Derivatives do not determine translations: one vertex of each component is fixed.
        component = vertex_components(faces, n_vertices)
        _, anchors, sizes = np.unique(component, return_index=True, return_counts=True)
        self._neighbours = adjacent_triangles(faces)[0]
        both_ways = np.concatenate([self._neighbours, self._neighbours[:, ::-1]])
        both_ways = both_ways[np.lexsort(both_ways.T[::-1])]
        self._neighbours_of = np.ascontiguousarray(both_ways[:, 1])
        counts = np.bincount(both_ways[:, 0], minlength=len(faces))
        self._neighbour_ends = np.concatenate([[0], np.cumsum(counts)])
        self._free = np.setdiff1d(np.arange(n_vertices), anchors)
        self._weigh(face_areas)
        self._component = component
        self._average = sparse.csr_array(
            (1.0 / sizes[component], (component, np.arange(n_vertices)))
        )

    def _weigh(self, weights: ndarray) -> None:
        self._divergence = self._operator.T @ sparse.diags_array(np.tile(weights, 2))
        laplacian = (self._divergence @ self._operator).tocsc()
        self._factor = splu(laplacian[self._free][:, self._free])

    def with_weights(self, weights: ndarray) -> PoissonInterpolator:
        """Return an interpolator with other weights of the triangles."""
        interpolator = copy(self)
        interpolator._weigh(self._areas * weights)
        return interpolator

    def rotations(self, start: ndarray, end: ndarray) -> ndarray:
        """Return the shortest rotations of the triangles between two surfaces, shape (F, 3)."""
        frames = (triangle_frames(f, self._operator) for f in (start, end))
        return log(np.eye(3), nearest_rotations(deformation_gradients(*frames)))

    def has_jumps(self, rotations: ndarray) -> bool:
        """Return whether rotation vectors of some neighbouring triangles differ by more than π."""
        first, second = self._neighbours.T
        gaps = rotations[first] - rotations[second]
        return bool(np.any(np.sum(gaps * gaps, axis=1) > np.pi**2))

    def unwrap(self, rotations: ndarray) -> ndarray:
        """Return the same rotations plus multiples of 2π, so that neighbours rotate alike.

        From the triangle that rotates least across the edges where rotations differ least.
        """
        angles = np.linalg.norm(rotations, axis=1)
        # sin(angle / 2) / angle, also where the angle is 0.
        shares = 0.5 * np.sinc(angles / (2.0 * np.pi))
        quaternions = np.column_stack([np.cos(0.5 * angles), shares[:, None] * rotations])
        unwrapped = rotations.copy()
        roots = np.argsort(angles, kind="stable")
        unwrap_turns(unwrapped, quaternions, roots, self._neighbour_ends, self._neighbours_of)
        return unwrapped

    def parts(self, chosen: ndarray) -> list[ndarray]:
        """Return the connected parts of a set of triangles, the largest first."""
        first, second = self._neighbours[chosen[self._neighbours].all(axis=1)].T
        shape = (len(chosen), len(chosen))
        links = sparse.coo_array((np.ones(len(first)), (first, second)), shape=shape)
        _, labels = connected_components(links, directed=False)
        triangles = np.flatnonzero(chosen)
        _, part, sizes = np.unique(labels[triangles], return_inverse=True, return_counts=True)
        areas = np.bincount(part, self._areas[triangles], minlength=len(sizes))
        return [triangles[part == k] for k in np.argsort(-areas, kind="stable")]

    def interpolate(
        self, start: ndarray, end: ndarray, times: ndarray, rotations: ndarray | None = None
    ) -> ndarray:
        """Return the surfaces (n, V, 3) between two surfaces at some times (n,) in [0, 1]."""
        if len(times) == 0:
            return np.empty((0, *start.shape))
        if rotations is None:
            rotations = self.rotations(start, end)
        source = turned_sources(
            start, end, rotations, times, self._faces, self._frames, self._areas
        )
        first, last = (self._average @ f for f in (start, end))
        weights = times[:, None]
        return self._solve(source, (1.0 - weights) * first[:, None] + weights * last[:, None])

    def surface_of(self, derivatives: ndarray, placed_as: ndarray) -> ndarray:
        """Return the surface whose first derivatives are closest to given ones."""
        source = self._divergence @ derivatives
        return self._solve(source[:, None], (self._average @ placed_as)[:, None])[0]

    def _solve(self, source: ndarray, centroids: ndarray) -> ndarray:
        """Return the surfaces, shape (n, V, 3), with divergences (V, n, 3) and given centroids."""
        points = np.zeros((len(source), source[0].size))
        with single_threaded_libraries():
            points[self._free] = self._factor.solve(source.reshape(points.shape)[self._free])
        averages = self._average @ points
        points += (centroids.reshape(averages.shape) - averages)[self._component]
        return np.ascontiguousarray(np.swapaxes(points.reshape(source.shape), 0, 1))


@compiled(inline="always")
def _unwrap(turn: ndarray, before: ndarray) -> None:
    """Add full turns to a rotation vector so that it is close to another."""
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle == 0.0:
        return
    along = 0.0
    for k in range(3):
        along += turn[k] / angle * before[k]
    factor = 1.0 + 2.0 * math.pi / angle * round((along - angle) / (2.0 * math.pi))
    for k in range(3):
        turn[k] *= factor


@compiled
def unwrap_turns(
    turns: ndarray, quaternions: ndarray, roots: ndarray, ends: ndarray, neighbours: ndarray
) -> None:
    """Add full turns to rotation vectors so that each is close to a neighbour's.

    Neighbours in the tree of least differences between rotations (Prim's algorithm).
    """
    done = np.zeros(len(turns), dtype=np.bool_)
    for root in roots:
        queue = [(0.0, root, root)]
        while len(queue) > 0:
            _, t, before = heapq.heappop(queue)
            if done[t]:
                continue
            done[t] = True
            if t != before:
                _unwrap(turns[t], turns[before])
            for other in neighbours[ends[t] : ends[t + 1]]:
                if not done[other]:
                    near, far = 0.0, 0.0
                    for k in range(4):
                        near += (quaternions[t, k] - quaternions[other, k]) ** 2
                        far += (quaternions[t, k] + quaternions[other, k]) ** 2
                    heapq.heappush(queue, (min(near, far), other, t))


@compiled(inline="always")
def _turn(vectors: ndarray, axis: ndarray, angle: float, turned: ndarray) -> None:
    """Turn two vectors about a unit axis, by Rodrigues' formula."""
    cosine, sine = math.cos(angle), math.sin(angle)
    for d in range(2):
        x, y, z = vectors[d, 0], vectors[d, 1], vectors[d, 2]
        along = (1.0 - cosine) * (axis[0] * x + axis[1] * y + axis[2] * z)
        turned[d, 0] = cosine * x + sine * (axis[1] * z - axis[2] * y) + along * axis[0]
        turned[d, 1] = cosine * y + sine * (axis[2] * x - axis[0] * z) + along * axis[1]
        turned[d, 2] = cosine * z + sine * (axis[0] * y - axis[1] * x) + along * axis[2]


@compiled
def _turned_sources(
    start: ndarray,
    end: ndarray,
    turns: ndarray,
    times: ndarray,
    faces: ndarray,
    frames: ndarray,
    areas: ndarray,
    first: int,
    last: int,
    source: ndarray,
) -> None:
    before = np.empty((2, 3))
    after, back = np.empty_like(before), np.empty_like(before)
    blend, wanted = np.empty_like(before), np.empty_like(before)
    axis = np.empty(3)
    for t in range(first, last):
        one, two, three = faces[t, 0], faces[t, 1], faces[t, 2]
        scale_u, scale_v, skew = frames[t, 0], frames[t, 1], frames[t, 2]
        derivatives(start, 0, faces[t], frames[t], before.reshape(6))
        derivatives(end, 0, faces[t], frames[t], after.reshape(6))
        angle = math.sqrt(turns[t, 0] ** 2 + turns[t, 1] ** 2 + turns[t, 2] ** 2)
        for k in range(3):
            axis[k] = turns[t, k] / angle if angle > 0.0 else 0.0
        _turn(after, axis, -angle, back)
        for i in range(len(times)):
            for d in range(2):
                for k in range(3):
                    blend[d, k] = (1.0 - times[i]) * before[d, k] + times[i] * back[d, k]
            _turn(blend, axis, times[i] * angle, wanted)
            for k in range(3):
                at_two = areas[t] * (scale_u * wanted[0, k] - skew * wanted[1, k])
                at_three = areas[t] * scale_v * wanted[1, k]
                source[two, i, k] += at_two
                source[three, i, k] += at_three
                source[one, i, k] -= at_two + at_three


def turned_sources(
    start: ndarray,
    end: ndarray,
    turns: ndarray,
    times: ndarray,
    faces: ndarray,
    frames: ndarray,
    areas: ndarray,
) -> ndarray:
    """Return the divergences of the first derivatives J(t) between two surfaces."""
    shape = (len(start), len(times), 3)
    ends = of_one_kind(start)[:, None], of_one_kind(end)[:, None]

    def run(first: int, last: int) -> ndarray:
        source = np.zeros(shape)
        _turned_sources(*ends, turns, times, faces, frames, areas, first, last, source)
        return source

    return np.add.reduce(in_chunks(run, len(faces), threaded=len(faces) > _WORTH_THREADS))
