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
from riemhuman.kernels.triangles import derivatives

# Below this many triangles, threads cost more than they bring.
_WORTH_THREADS = 5_000


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
