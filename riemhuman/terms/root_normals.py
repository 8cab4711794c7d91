"""The term of square root normal fields, which the paper compares with (section 5.2)."""

from __future__ import annotations

import math

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import Derivatives
from riemhuman.kernels.threads import of_one_kind
from riemhuman.kernels.triangles import triangle
from riemhuman.terms.flat import FlatTerm, pack_vector


class RootNormalTerm(FlatTerm):
    r"""w ∫ ‖q₁ − q₂‖² of the square root normal fields :math:`q = \sqrt{A}\, n`.

    Parameters
    ----------
    weight : float
        w > 0.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.SurfaceMetric(space, [rh.terms.RootNormalTerm(1.0)])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    area_power = 1.0

    def field(self, first: Derivatives) -> ndarray:
        """Return q; q and its gradient are 0 on a degenerate triangle (section 5.2 of the paper).

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces.

        Returns
        -------
        array, shape (..., F, 3)
        """
        roots = first.area_vectors / np.sqrt(first.areas)[..., None]
        return np.where(first.degenerate[..., None], 0.0, roots)

    def form(self, first: Derivatives) -> ndarray:
        """Return ‖δq‖²/A of δq = √A (½ (ε₁₁ + ε₂₂) n + δn).

        Parameters
        ----------
        first : Derivatives
            Not used: the form is constant.
        """
        swelling = np.array([0.5, 0.0, 0.0, 0.5, 0.0, 0.0])
        return np.outer(swelling, swelling) + np.diag([0.0, 0.0, 0.0, 0.0, 1.0, 1.0])

    def pack_surface(
        self, f: ndarray, faces: ndarray, frames: ndarray, areas: ndarray, kept: ndarray
    ) -> float:
        scaled = np.empty(3 * len(faces))
        _fill(f, faces, frames, areas, scaled)
        return pack_vector(of_one_kind(scaled), kept)

    def add_segments(self, records: ndarray, slopes: ndarray, areas: ndarray) -> float:
        return _segments(records, slopes, areas, self.weight)


@compiled
def _segments(records: ndarray, slopes: ndarray, areas: ndarray, weight: float) -> float:
    total = 0.0
    for i in range(len(records) - 1):
        total += _segment(records[i], records[i + 1], slopes[i], slopes[i + 1], areas, weight)
    return total


# Without fused products: the difference of equal roots must be 0.
@compiled(forceinline=True, fastmath={"nsz", "reassoc"})
def _segment(
    one: ndarray,
    other: ndarray,
    by_one: ndarray,
    by_other: ndarray,
    areas: ndarray,
    weight: float,
) -> float:
    """Return the sum of w ‖q₁ − q₂‖², and add its slopes by normals and area ratios."""
    total = 0.0
    for t in range(len(areas)):
        s1, s2 = math.sqrt(one[9, t]), math.sqrt(other[9, t])
        factor = weight * areas[t]
        along1 = along2 = 0.0
        for k in range(6, 9):
            step = s1 * one[k, t] - s2 * other[k, t]
            total += factor * step * step
            step *= 2.0 * factor
            by_one[k, t] += step * s1
            by_other[k, t] -= step * s2
            along1 += step * one[k, t]
            along2 += step * other[k, t]
        by_one[9, t] += 0.5 * along1 / s1 if s1 > 0.0 else 0.0
        by_other[9, t] -= 0.5 * along2 / s2 if s2 > 0.0 else 0.0
    return total


@compiled
def _fill(f: ndarray, faces: ndarray, frames: ndarray, areas: ndarray, scaled: ndarray) -> None:
    """Fill q times √w of one surface."""
    for t in range(len(faces)):
        _, _, n0, n1, n2, area = triangle(f, faces, frames, t)
        # q = N/√A of N = f_u × f_v.
        scale = math.sqrt(areas[t] / area) if area > 0.0 else 0.0
        scaled[3 * t], scaled[3 * t + 1], scaled[3 * t + 2] = n0 * scale, n1 * scale, n2 * scale
