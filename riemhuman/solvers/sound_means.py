"""Safeguards of means of bodies: lengths must be seen, triangles must keep their area."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import DegenerateSurfaceError, UnseenLengthsWarning, warn
from riemhuman.protocols import MetricOfSurfaces, MetricWithCompanion, SurfaceSpace
from riemhuman.surfaces.distortion import triangle_areas

# Share of a triangle's area on the points, in the median, below which it has shrunk away.
_SHRUNK = 1e-2


def seeing_lengths(metric: Any, weight: float) -> Any:
    """Return the metric for the search of a mean, with a companion where it does not see lengths.

    Parameters
    ----------
    metric : RiemannianMetric
        Any metric.
    weight : float
        Weight of the companion, 0 for none.

    Returns
    -------
    RiemannianMetric
        The metric itself if it sees lengths, or has no companion.

    Warns
    -----
    UnseenLengthsWarning
        If the returned metric does not see lengths.
    """
    if isinstance(metric, MetricWithCompanion) and weight > 0:
        metric = metric.seeing_lengths(weight)
    if isinstance(metric, MetricOfSurfaces) and not metric.sees_lengths:
        warn(
            f"{metric!r} does not see the lengths of edges: limbs of the mean may stretch or "
            "shrink like rubber. Use a metric that sees lengths, such as ElasticMetric with a > 0, "
            "a companion (companion_weight > 0 of BasisMean), or a medoid "
            "(riemhuman.statistics.KMedoids)",
            UnseenLengthsWarning,
        )
    return metric


class AreaCheck:
    """Refuses surfaces whose triangles have collapsed.

    Pointwise, metric fields are points of a cone. If most of them are more than a right angle
    apart, θ > π/2, as for dissimilar bodies and small λ, the mean squared distance decreases
    towards the tip of the cone, a triangle without area.

    Parameters
    ----------
    space : Manifold
        The space; only surfaces are checked.
    points : array, shape (n, V, 3)
        Points whose mean is searched.
    """

    def __init__(self, space: Any, points: ndarray) -> None:
        self._faces = None
        if isinstance(space, SurfaceSpace):
            self._faces = space.template.faces
            # One by one: the corners of all triangles at once would take much memory.
            self._areas = np.median([triangle_areas(f, self._faces) for f in points], axis=0)

    def refuse_collapse(self, point: ndarray) -> None:
        """Refuse a surface whose triangles have collapsed.

        Parameters
        ----------
        point : array, shape (V, 3)
            Current point of the search.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle has less than a hundredth of its median area on the points.
        """
        if self._faces is None:
            return
        shrunk = triangle_areas(point, self._faces) < _SHRUNK * self._areas
        if np.any(shrunk):
            raise DegenerateSurfaceError(
                f"the mean has collapsed: {int(shrunk.sum())} of {len(self._faces)} triangles have "
                "shrunk to less than a hundredth of their area, and the variance decreases as they "
                "shrink. The points are too dissimilar for so small a lam, or for a metric that "
                "does not see areas: use lam = 1, or a medoid (riemhuman.statistics.KMedoids)"
            )
