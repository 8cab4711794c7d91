"""Rotations of the triangles between two surfaces, in compiled loops.

Results do not depend on the number of threads.
"""

from __future__ import annotations

import heapq
import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import in_chunks, of_one_kind
from riemhuman.kernels.triangles import derivatives, fill_axes

# Below this many triangles, threads cost more than they bring.
_WORTH_THREADS = 5_000


@compiled(inline="always")
def _rotation_vector(matrix: ndarray, vector: ndarray) -> float:
    """Fill the unit axis of a rotation matrix; return its angle in [0, π]."""
    # Shepperd's method: the quaternion through its largest entry.
    trace = matrix[0, 0] + matrix[1, 1] + matrix[2, 2]
    largest, k = trace, -1
    for i in range(3):
        if matrix[i, i] > largest:
            largest, k = matrix[i, i], i
    if k < 0:
        vector[0] = matrix[2, 1] - matrix[1, 2]
        vector[1] = matrix[0, 2] - matrix[2, 0]
        vector[2] = matrix[1, 0] - matrix[0, 1]
        real = 1.0 + trace
    else:
        i, j = (k + 1) % 3, (k + 2) % 3
        vector[k] = 1.0 + matrix[k, k] - matrix[i, i] - matrix[j, j]
        vector[i] = matrix[i, k] + matrix[k, i]
        vector[j] = matrix[j, k] + matrix[k, j]
        real = matrix[j, i] - matrix[i, j]
    if real < 0.0:
        real = -real
        for i in range(3):
            vector[i] = -vector[i]
    size = math.sqrt(vector[0] ** 2 + vector[1] ** 2 + vector[2] ** 2)
    if size == 0.0:
        vector[0] = 1.0
        return 0.0
    for i in range(3):
        vector[i] /= size
    return 2.0 * math.atan2(size, real)


@compiled
def _turns(
    start: ndarray,
    end: ndarray,
    faces: ndarray,
    first: int,
    last: int,
    turns: ndarray,
) -> None:
    from_axes = np.empty((3, 3))
    to_axes, rotation = np.empty_like(from_axes), np.empty_like(from_axes)
    for t in range(first, last):
        _, over_p, over_r, skew = fill_axes(start, faces[t], 0, from_axes)
        _, over_u, over_w, end_skew = fill_axes(end, faces[t], 0, to_axes)
        # The polar decomposition of the map between the frames, [[u r, v p − u q], [0, w p]], with
        # edges (p, 0), (q, r) at the start and (u, 0), (v, w) at the end, by positive factors.
        angle = math.atan2(skew * over_w - end_skew * over_r, over_p * over_w + over_u * over_r)
        cosine, sine = math.cos(angle), math.sin(angle)
        for k in range(3):
            turned = cosine * to_axes[0, k] + sine * to_axes[1, k]
            to_axes[1, k] = cosine * to_axes[1, k] - sine * to_axes[0, k]
            to_axes[0, k] = turned
        for i in range(3):
            for j in range(3):
                rotation[i, j] = (
                    to_axes[0, i] * from_axes[0, j]
                    + to_axes[1, i] * from_axes[1, j]
                    + to_axes[2, i] * from_axes[2, j]
                )
        angle = _rotation_vector(rotation, turns[t])
        for k in range(3):
            turns[t, k] *= angle


def triangle_turns(start: ndarray, end: ndarray, faces: ndarray) -> ndarray:
    """Return the rotations of triangles, of the maps from f_u, f_v and n to those at the end."""
    turns = np.empty((len(faces), 3))
    ends = of_one_kind(start)[:, None], of_one_kind(end)[:, None]

    def run(first: int, last: int) -> None:
        _turns(*ends, faces, first, last, turns)

    in_chunks(run, len(faces), threaded=len(faces) > _WORTH_THREADS)
    return turns


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
    """Return the divergences of the first derivatives J(t) between two surfaces, see `_poisson`."""
    shape = (len(start), len(times), 3)
    ends = of_one_kind(start)[:, None], of_one_kind(end)[:, None]

    def run(first: int, last: int) -> ndarray:
        source = np.zeros(shape)
        _turned_sources(*ends, turns, times, faces, frames, areas, first, last, source)
        return source

    return np.add.reduce(in_chunks(run, len(faces), threaded=len(faces) > _WORTH_THREADS))
