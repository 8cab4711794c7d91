"""The term of square root normal fields, which the paper compares with (section 5.2)."""

from __future__ import annotations

import math

import autograd.numpy as np
import numpy as onp
from numpy import ndarray

from riemhuman.kernels.compiled import compiled
from riemhuman.kernels.surface import Derivatives
from riemhuman.kernels.tiles import of_one_kind
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
    n_times, total = records.shape[1], 0.0
    roots = onp.empty(n_times)
    for t in range(len(records)):
        factor = weight * areas[t]
        for i in range(n_times):
            roots[i] = math.sqrt(records[t, i, 9])
        for i in range(n_times - 1):
            before, after = records[t, i], records[t, i + 1]
            s1, s2 = roots[i], roots[i + 1]
            along1 = along2 = 0.0
            for k in range(6, 9):
                step = s1 * before[k] - s2 * after[k]
                total += factor * step * step
                step *= 2.0 * factor
                slopes[t, i, k] += step * s1
                slopes[t, i + 1, k] -= step * s2
                along1 += step * before[k]
                along2 += step * after[k]
            if s1 > 0.0:
                slopes[t, i, 9] += 0.5 * along1 / s1
            if s2 > 0.0:
                slopes[t, i + 1, 9] -= 0.5 * along2 / s2
    return total


@compiled
def _fill(f: ndarray, faces: ndarray, frames: ndarray, areas: ndarray, scaled: ndarray) -> None:
    """Fill q times √w of one surface."""
    for t in range(len(faces)):
        _, _, n0, n1, n2, area = triangle(f, faces, frames, t)
        # q = N/√A of N = f_u × f_v.
        scale = math.sqrt(areas[t] / area) if area > 0.0 else 0.0
        scaled[3 * t], scaled[3 * t + 1], scaled[3 * t + 2] = n0 * scale, n1 * scale, n2 * scale
