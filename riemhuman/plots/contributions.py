"""What every triangle of two surfaces adds to their distance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.geometry import ElasticMetric
from riemhuman.kernels import surface
from riemhuman.representation import Record
from riemhuman.terms import EbinTerm, NormalTerm


@dataclass(frozen=True, repr=False)
class Contributions(Record):
    r"""Parts of the squared distance of two surfaces, triangle by triangle.

    The integrands of equation 5 over each triangle t of the template, of area w_t:

    .. math:: \begin{split} m_t &= a\, w_t\, d^\lambda(g_1, g_2)_t^2 \\
              n_t &= c\, w_t\, d_{S^2}(n_1, n_2)_t^2 \end{split}

    Attributes
    ----------
    metric : array, shape (..., F)
        m_t, by the change of the first fundamental form.
    normal : array, shape (..., F)
        n_t, by the change of the normals.

    Examples
    --------
    >>> float(rh.plots.Contributions([1.0], [0.5]).total[0])
    1.5
    """

    metric: ndarray
    normal: ndarray

    @property
    def total(self) -> ndarray:
        """Their sum m_t + n_t, shape (..., F); summed over triangles, the squared distance."""
        return np.add(self.metric, self.normal)


def contributions(metric: ElasticMetric, point_a: ndarray, point_b: ndarray) -> Contributions:
    """Return what every triangle adds to the squared distance of two surfaces.

    Parameters
    ----------
    metric : ElasticMetric
    point_a, point_b : array, shape (..., V, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), 1.0, 1.0, 1.0)
    >>> rh.plots.contributions(metric, bodies[0], bodies[1]).normal.shape
    (2400,)
    """
    space = metric.space
    first_a, first_b = (
        surface.derivatives(space.check_point(f, "surface"), space.template.differential_operator)
        for f in (point_a, point_b)
    )
    zeros = np.zeros(np.broadcast_shapes(first_a.areas.shape, first_b.areas.shape))
    parts: dict[type, ndarray] = {EbinTerm: zeros, NormalTerm: zeros}
    for term in metric.terms:
        if term.needs_area:
            surface.refuse_degenerate(first_a.degenerate | first_b.degenerate)
        values = term.squared_dist(term.fields(first_a), term.fields(first_b))
        parts[type(term)] = term.weight * space.template.face_areas * values
    return Contributions(parts[EbinTerm], parts[NormalTerm])
