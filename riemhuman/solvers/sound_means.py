"""What a mean needs beside its metric to be a body: lengths that are seen, triangles with area."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.protocols import SurfaceSpace
from riemhuman.surfaces.distortion import triangle_areas

# Share of a triangle's area on the points, in the median, below which it has shrunk away.
_SHRUNK = 1e-2


def seeing_lengths(metric: Any, weight: float) -> Any:
    """Return a metric that sees lengths as well, where one of the elastic family sees none.

    Parameters
    ----------
    metric : RiemannianMetric
        Any metric.
    weight : float
        Weight of (a, λ, c) = (1, 1, 0) beside an elastic metric (0, 0, 1).

    Returns
    -------
    RiemannianMetric
        The sum of both, or the metric itself if it is no elastic metric with a = 0.
    """
    if not isinstance(metric, ElasticMetric) or metric.a > 0 or weight == 0:
        return metric
    return ElasticMetric(metric.space, a=weight * metric.c, lam=1.0, c=metric.c)


def refuse_collapse(space: Any, points: ndarray, point: ndarray) -> None:
    """Refuse a surface whose triangles have shrunk away.

    Pointwise, metric fields are points of a cone. Where most of them are farther than a right
    angle apart, θ > π/2, as those of unlike bodies are for small λ, the nearer to the tip of the
    cone, a triangle without area, the less is the mean squared distance.

    Parameters
    ----------
    space : Manifold
        The space; only surfaces are looked at.
    points : array, shape (n, V, 3)
        Points whose mean is sought.
    point : array, shape (V, 3)
        Where the search is.

    Raises
    ------
    DegenerateSurfaceError
        If a triangle has less than a hundredth of the area it has on the points, in the median.
    """
    if not isinstance(space, SurfaceSpace):
        return
    faces = space.template.faces
    areas = np.median(triangle_areas(points, faces), axis=0)
    shrunk = triangle_areas(point, faces) < _SHRUNK * areas
    if np.any(shrunk):
        raise DegenerateSurfaceError(
            f"the mean is no surface: {int(shrunk.sum())} of {len(faces)} triangles have shrunk to "
            "less than a hundredth of their area, and the variance falls as they do. The points "
            "are too unlike for so small a lam, or for a metric that sees no areas: take lam = 1, "
            "or a medoid (riemhuman.statistics.KMedoids) in place of the mean"
        )
