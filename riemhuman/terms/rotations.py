"""The term of rotations: angles by which triangles turn, in space and within their planes."""

from __future__ import annotations

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import FUSED, SUM, compiled
from riemhuman.kernels.rotations import quaternions
from riemhuman.kernels.surface import Derivatives, dot, polar_frames
from riemhuman.kernels.threads import CHUNK, UNDERFLOW, of_one_kind
from riemhuman.terms._polynomial_fits import PRECISION, squared_short_arc
from riemhuman.terms.normals import squared_arc
from riemhuman.terms.term import Fields, Term


class RotationTerm(Term):
    r"""w ∫ θ² dx, with θ ∈ [0, π] the angle of the rotation from R₁ to R₂, where df = R √g.

    Rotations are kept as unit quaternions, of either sign: θ is twice the angle between two of
    them, or one and minus the other.

    Parameters
    ----------
    weight : float above 0

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> bool(rh.RotationMetric(space, time=0.0).dist(bodies[0], bodies[1]) > 0)
    True
    """

    needs_area = True
    is_stretch_invariant = True
    single = True
    n_features = 4

    def fields(self, first: Derivatives) -> Fields:
        return (quaternions(polar_frames(first.f_u, first.f_v)),)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> ndarray:
        difference, total = fields_a[0] - fields_b[0], fields_a[0] + fields_b[0]
        p, q = dot(difference, difference), dot(total, total)
        return 4.0 * squared_arc(np.minimum(p, q), np.maximum(p, q))

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> ndarray:
        return 4.0 * dot(changes_a[0], changes_b[0])

    def pack(self, fields: Fields, areas: ndarray, kept: ndarray) -> float:
        return _pack(of_one_kind(fields[0]), areas, kept)

    def squared_distances(self, a: ndarray, b: ndarray, areas: ndarray) -> ndarray:
        # By polynomials in the shorter chord.
        largest, squared = areas.max(), np.zeros((len(a), len(b)))
        relative = np.zeros(a.shape[2], dtype=a.dtype)
        relative[: len(areas)] = areas / largest
        _tile(a, b, relative, PRECISION[a.dtype], a is b, squared)
        return 4.0 * largest * squared


@compiled
def _pack(q: ndarray, areas: ndarray, kept: ndarray) -> float:
    gap = 4.0 * UNDERFLOW * areas.max() * len(areas)
    for t in range(len(q)):
        chord = 0.0
        for k in range(4):
            kept[k, t] = q[t, k]
            chord += (q[t, k] - kept[k, t]) ** 2
        # The angle is twice that of the quaternions, which is at most √2 times their chord.
        gap += 8.0 * areas[t] * chord
    return gap


@compiled(forceinline=True, fastmath=FUSED)
def _squared_half_angle(
    w1: float,
    x1: float,
    y1: float,
    z1: float,
    w2: float,
    x2: float,
    y2: float,
    z2: float,
    single: bool | None,
) -> float:
    real = type(x1)
    near = w1 * w2 + x1 * x2 + y1 * y2 + z1 * z2 >= real(0.0)
    sign = real(1.0) if near else real(-1.0)
    w, x, y, z = w1 - sign * w2, x1 - sign * x2, y1 - sign * y2, z1 - sign * z2
    return squared_short_arc(w * w + x * x + y * y + z * z, single)


@compiled(forceinline=True, fastmath=SUM)
def _chunk(
    a: ndarray, b: ndarray, weights: ndarray, single: bool | None, first: int, last: int
) -> float:
    w1, x1, y1, z1 = a[0, first:last], a[1, first:last], a[2, first:last], a[3, first:last]
    w2, x2, y2, z2 = b[0, first:last], b[1, first:last], b[2, first:last], b[3, first:last]
    weight = weights[first:last]
    total = weights.dtype.type(0.0)
    for t in range(last - first):
        total += weight[t] * _squared_half_angle(
            w1[t], x1[t], y1[t], z1[t], w2[t], x2[t], y2[t], z2[t], single
        )
    return total


@compiled
def _tile(
    a: ndarray, b: ndarray, weights: ndarray, single: bool | None, within: bool, squared: ndarray
) -> None:
    n_values = a.shape[2]
    for first in range(0, n_values, CHUNK):
        last = min(first + CHUNK, n_values)
        for i in range(len(a)):
            for j in range(i + 1 if within else 0, len(b)):
                squared[i, j] += _chunk(a[i], b[j], weights, single, first, last)
