"""The space of the statistics: that of the points, or that of the fields of surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of, real_array
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import metric_of
from riemhuman.solvers.means import BasisMean, GradientDescentMean
from riemhuman.solvers.nearest_surface import NearestSurface, inverted_triangles

KINDS = ("auto", "fields", "points")

if TYPE_CHECKING:
    from riemhuman.geometry import AlignedSurfaces


class Points:
    """The space itself, whose metric has exp and log."""

    def __init__(self, metric: RiemannianMetric) -> None:
        self.metric = metric

    def embed(self, points: ndarray) -> ndarray:
        r"""Return the points themselves."""
        return points

    def restore(self, images: ndarray, start: ndarray) -> ndarray:
        r"""Return the images, projected to the manifold to remove rounding errors."""
        return self.metric.space.projection(images)

    def is_sound(self, point: ndarray, reference: ndarray) -> bool:
        r"""Return True: every point of a manifold is sound."""
        return True

    def mean(self, points: ndarray) -> ndarray:
        r"""Return the Karcher mean by `GradientDescentMean`."""
        return GradientDescentMean().solve(self.metric, points).point


class Fields:
    r"""The fields Φ(f) of surfaces, in the space where the metric measures their distances.

    There geodesics have a closed form, and ‖log Φ(f)‖ = d(f, mean). A point of that space need not
    come from a surface; it is then replaced by the nearest surface.
    """

    def __init__(self, metric: Any, nearest: NearestSurface) -> None:
        self.metric = metric.target_metric
        self._pullback = metric
        self._nearest = nearest

    def embed(self, points: ndarray) -> ndarray:
        r"""Return the fields of surfaces."""
        return self._pullback.map(points)

    def restore(self, images: ndarray, start: ndarray) -> ndarray:
        r"""Return the nearest surfaces."""
        surfaces = [
            self._nearest.solve(self._pullback, image[None], start).point for image in images
        ]
        return np.array(surfaces).reshape(-1, *self._pullback.space.shape)

    def is_sound(self, point: ndarray, reference: ndarray) -> bool:
        r"""Return whether a surface has no inverted triangle."""
        space: AlignedSurfaces = self._pullback.space
        return not inverted_triangles(point, reference, space.template.faces).any()

    def mean(self, points: ndarray) -> ndarray:
        r"""Return the Karcher mean over all vertices by `BasisMean`."""
        nearest = self._nearest
        solver = BasisMean(companion_weight=nearest.companion_weight, progress=nearest.progress)
        return solver.solve(self._pullback, points).point


def image_space(metric: Any, kind: str, nearest: NearestSurface | None) -> Points | Fields:
    """Return the space for the statistics of a metric."""
    pulled_back = metric.has_target_metric
    if one_of(kind, "image", KINDS) == "auto":
        kind = "fields" if pulled_back else "points"
    if kind == "points":
        return Points(metric)
    if not pulled_back:
        raise ArgumentError(
            f'image="fields" needs a metric pulled back by a map of surfaces; '
            f"found {type(metric).__name__}"
        )
    return Fields(metric, nearest or NearestSurface())


class ImageEstimator(Estimator):
    """An estimator with the parameters `space`, `image` and `nearest`."""

    space: Any
    image: str
    nearest: NearestSurface | None

    @property
    def _metric(self) -> RiemannianMetric:
        return metric_of(self.space)

    def _image_space(self) -> Points | Fields:
        return image_space(self._metric, self.image, self.nearest)

    def _mean_point(self, mean: Any, points: ndarray) -> ndarray:
        """Return the point of tangency: a point, what a solver finds, or the Karcher mean."""
        metric = self._metric
        if mean is None:
            return self._image_space().mean(points)
        if hasattr(mean, "solve"):
            return mean.solve(metric, points).point
        mean = real_array(mean, "mean", metric.space.shape, batched=False)
        return metric.space.check_point(mean, "mean")
