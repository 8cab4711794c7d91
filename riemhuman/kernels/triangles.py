"""Triangles in compiled loops: degenerate ones, their frames, and quadratic forms of corners.

Definitions are in `riemhuman.kernels.surface`.

Orthonormal frames: at corners q₁, q₂, q₃ of a triangle, e₁ runs along q₂ − q₁, e₂ across it within
the plane and e₃ is the normal; q₂ − q₁ = p e₁ and q₃ − q₁ = q e₁ + r e₂.
"""

from __future__ import annotations

import math

import numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import DEGENERATE, NEARLY_DEGENERATE, dot
from riemhuman.kernels.threads import in_chunks

# Below this many triangles of all surfaces, threads cost more than they bring.
_WORTH_THREADS = 50_000


@compiled(forceinline=True)
def derivatives(f: ndarray, i: int, face: ndarray, frame: ndarray, both: ndarray) -> None:
    """Fill f_u, then f_v, of one triangle."""
    one, two, three = face[0], face[1], face[2]
    for k in range(3):
        edge = f[two, i, k] - f[one, i, k]
        both[k] = edge * frame[0]
        both[3 + k] = (f[three, i, k] - f[one, i, k]) * frame[1] - edge * frame[2]


@compiled(forceinline=True)
def first_forms(
    u0: float, u1: float, u2: float, v0: float, v1: float, v2: float
) -> tuple[float, float, float, float, float, float]:
    """Return e = f_u·f_u, m = f_u·f_v, f_u × f_v and its length A, 0 for triangles without area."""
    n0, n1, n2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    e = u0 * u0 + u1 * u1 + u2 * u2
    g = v0 * v0 + v1 * v1 + v2 * v2
    area = math.sqrt(squared) if squared > DEGENERATE * e * g else 0.0
    return e, u0 * v0 + u1 * v1 + u2 * v2, n0, n1, n2, area


def nearly_degenerate_triangles(surfaces: ndarray, faces: ndarray, frames: ndarray) -> ndarray:
    """Tell the triangles of many surfaces that have no area, or hardly more than none.

    The definition is `riemhuman.kernels.surface.is_degenerate` with the bound `NEARLY_DEGENERATE`.
    """
    degenerate = np.empty((len(surfaces), len(faces)), dtype=bool)

    def run(first: int, last: int) -> None:
        for f, marked in zip(surfaces[first:last], degenerate[first:last], strict=True):
            _mark_nearly_degenerate(f[:, None], faces, frames, marked)

    in_chunks(run, len(surfaces), threaded=degenerate.size > _WORTH_THREADS)
    return degenerate


@compiled
def _mark_nearly_degenerate(f: ndarray, faces: ndarray, frames: ndarray, marked: ndarray) -> None:
    both = np.empty(6)
    for t in range(len(faces)):
        derivatives(f, 0, faces[t], frames[t], both)
        _, m, _, _, _, area = first_forms(both[0], both[1], both[2], both[3], both[4], both[5])
        # A² + m² = e g.
        marked[t] = area * area <= NEARLY_DEGENERATE * (area * area + m * m)


def add_blocks(blocks: ndarray, f: ndarray, faces: ndarray, forms: ndarray) -> None:
    """Add quadratic forms of `surface.frame_components` as forms of the nine corner numbers."""
    one, two, three = (f[corners] for corners in faces.T)
    x, y = two - one, three - one
    normals = np.cross(x, y)
    squares, xx = dot(normals, normals), dot(x, x)
    degenerate = squares <= DEGENERATE * xx * dot(y, y)
    p = np.sqrt(np.where(degenerate, 1.0, xx))
    over_r = np.where(degenerate, 0.0, p / np.sqrt(np.where(degenerate, 1.0, squares)))
    e1, e3 = x / p[:, None], normals * (over_r / p)[:, None]
    axes = np.stack([e1, np.cross(e3, e1), e3], axis=1)
    # How ∂₁h and ∂₂h depend on the second and third corners, and so on the first.
    along = np.zeros((len(faces), 2, 3))
    along[:, 0, 1], along[:, 1, 1], along[:, 1, 2] = 1.0 / p, -dot(y, e1) * over_r / p, over_r
    along[:, :, 0] = -along[:, :, 1] - along[:, :, 2]
    maps = (axes[:, :, None, None, :] * along[:, None, :, :, None]).reshape(-1, 6, 9)
    blocks += np.matmul(np.swapaxes(maps, 1, 2), np.matmul(forms, maps))


# Below this many triangles times surfaces, threads cost more than they bring.
_WORTH_THREADS_WITH_FRAMES = 20_000


@compiled(inline="always")
def frame_of(surfaces: ndarray, face: ndarray, i: int) -> tuple[float, ...]:
    """Return the frame of a triangle at time i."""
    one, two, three = face[0], face[1], face[2]
    x0 = surfaces[two, i, 0] - surfaces[one, i, 0]
    x1 = surfaces[two, i, 1] - surfaces[one, i, 1]
    x2 = surfaces[two, i, 2] - surfaces[one, i, 2]
    y0 = surfaces[three, i, 0] - surfaces[one, i, 0]
    y1 = surfaces[three, i, 1] - surfaces[one, i, 1]
    y2 = surfaces[three, i, 2] - surfaces[one, i, 2]
    n0, n1, n2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    squared = n0 * n0 + n1 * n1 + n2 * n2
    xx = x0 * x0 + x1 * x1 + x2 * x2
    if squared <= DEGENERATE * xx * (y0 * y0 + y1 * y1 + y2 * y2):
        squared, xx = 0.0, 1.0
    double_area, p = math.sqrt(squared), math.sqrt(xx)
    over_p = 1.0 / p
    over_r = p / double_area if squared > 0.0 else 0.0
    flat = over_p * over_r
    x0, x1, x2 = x0 * over_p, x1 * over_p, x2 * over_p
    n0, n1, n2 = n0 * flat, n1 * flat, n2 * flat
    skew = (y0 * x0 + y1 * x1 + y2 * x2) * flat
    z0, z1, z2 = n1 * x2 - n2 * x1, n2 * x0 - n0 * x2, n0 * x1 - n1 * x0
    area = 0.5 * double_area
    return area, over_p, over_r, skew, x0, x1, x2, z0, z1, z2, n0, n1, n2


@compiled(inline="always")
def derivatives_in_frame(
    vectors: ndarray, face: ndarray, i: int, frame: tuple[float, ...]
) -> tuple[float, ...]:
    """Return M_kj = e_k·∂_j h, the derivatives of a deformation h along e₁ and e₂."""
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    one, two, three = face[0], face[1], face[2]
    x0 = vectors[two, i, 0] - vectors[one, i, 0]
    x1 = vectors[two, i, 1] - vectors[one, i, 1]
    x2 = vectors[two, i, 2] - vectors[one, i, 2]
    y0 = over_r * (vectors[three, i, 0] - vectors[one, i, 0]) - skew * x0
    y1 = over_r * (vectors[three, i, 1] - vectors[one, i, 1]) - skew * x1
    y2 = over_r * (vectors[three, i, 2] - vectors[one, i, 2]) - skew * x2
    x0, x1, x2 = over_p * x0, over_p * x1, over_p * x2
    return (
        a0 * x0 + a1 * x1 + a2 * x2,
        a0 * y0 + a1 * y1 + a2 * y2,
        b0 * x0 + b1 * x1 + b2 * x2,
        b0 * y0 + b1 * y1 + b2 * y2,
        c0 * x0 + c1 * x1 + c2 * x2,
        c0 * y0 + c1 * y1 + c2 * y2,
    )


@compiled(inline="always")
def add_to_corners(
    slopes: ndarray, face: ndarray, i: int, frame: tuple[float, ...], entries: tuple[float, ...]
) -> None:
    """Add the slopes at the corners of a function with slopes Γ_kj in e_k·∂_j h.

    The transpose of `derivatives_in_frame`.
    """
    _, over_p, over_r, skew, a0, a1, a2, b0, b1, b2, c0, c1, c2 = frame
    k11, k12, k21, k22, k31, k32 = entries
    k11, k21, k31 = (
        over_p * k11 - skew * k12,
        over_p * k21 - skew * k22,
        over_p * k31 - skew * k32,
    )
    k12, k22, k32 = over_r * k12, over_r * k22, over_r * k32
    one, two, three = face[0], face[1], face[2]
    x0, y0 = k11 * a0 + k21 * b0 + k31 * c0, k12 * a0 + k22 * b0 + k32 * c0
    x1, y1 = k11 * a1 + k21 * b1 + k31 * c1, k12 * a1 + k22 * b1 + k32 * c1
    x2, y2 = k11 * a2 + k21 * b2 + k31 * c2, k12 * a2 + k22 * b2 + k32 * c2
    slopes[one, i, 0] -= x0 + y0
    slopes[one, i, 1] -= x1 + y1
    slopes[one, i, 2] -= x2 + y2
    slopes[two, i, 0] += x0
    slopes[two, i, 1] += x1
    slopes[two, i, 2] += x2
    slopes[three, i, 0] += y0
    slopes[three, i, 1] += y1
    slopes[three, i, 2] += y2


@compiled(inline="always")
def fill_edges(surfaces: ndarray, face: ndarray, i: int, edges: ndarray) -> float:
    """Fill the edges q₂ − q₁ and q₃ − q₁ of a triangle at time i; return its area."""
    one, two, three = face[0], face[1], face[2]
    xx = yy = 0.0
    for d in range(3):
        edges[0, d] = surfaces[two, i, d] - surfaces[one, i, d]
        edges[1, d] = surfaces[three, i, d] - surfaces[one, i, d]
        xx += edges[0, d] * edges[0, d]
        yy += edges[1, d] * edges[1, d]
    n0 = edges[0, 1] * edges[1, 2] - edges[0, 2] * edges[1, 1]
    n1 = edges[0, 2] * edges[1, 0] - edges[0, 0] * edges[1, 2]
    n2 = edges[0, 0] * edges[1, 1] - edges[0, 1] * edges[1, 0]
    squared = n0 * n0 + n1 * n1 + n2 * n2
    return 0.5 * math.sqrt(squared) if squared > DEGENERATE * xx * yy else 0.0


@compiled(inline="always")
def add_area_slope(
    slopes: ndarray, face: ndarray, i: int, edges: ndarray, area: float, factor: float
) -> None:
    """Add the slope of a triangle's area at its corners, times a factor."""
    xx = edges[0, 0] ** 2 + edges[0, 1] ** 2 + edges[0, 2] ** 2
    xy = edges[0, 0] * edges[1, 0] + edges[0, 1] * edges[1, 1] + edges[0, 2] * edges[1, 2]
    yy = edges[1, 0] ** 2 + edges[1, 1] ** 2 + edges[1, 2] ** 2
    factor /= 4.0 * area
    for d in range(3):
        at_two = factor * (yy * edges[0, d] - xy * edges[1, d])
        at_three = factor * (xx * edges[1, d] - xy * edges[0, d])
        slopes[face[1], i, d] += at_two
        slopes[face[2], i, d] += at_three
        slopes[face[0], i, d] -= at_two + at_three


def by_vertex(surfaces: ndarray) -> ndarray:
    """Return surfaces vertex by vertex, or back."""
    return np.ascontiguousarray(np.swapaxes(surfaces, 0, 1))


def is_worth_threads(surfaces: ndarray, faces: ndarray) -> bool:
    """Return whether loops over the triangles of surfaces gain from threads."""
    return len(faces) * surfaces.shape[1] > _WORTH_THREADS_WITH_FRAMES
