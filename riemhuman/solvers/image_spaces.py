"""The space of the statistics: that of the points, or that of the fields of surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy import ndarray

from riemhuman.checks import one_of
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry import RiemannianMetric
from riemhuman.solvers.inverted_triangles import inverted_triangles
from riemhuman.solvers.means import GradientDescentMean
from riemhuman.solvers.nearest_surface import NearestSurface

KINDS = ("auto", "fields", "points")

if TYPE_CHECKING:
    from riemhuman.geometry import AlignedSurfaces

# Points that are enough to find where the search for a mean starts.
_SAMPLE = 64


class ImageSpace(Protocol):
    """A space with exponential and logarithm, where images stand for the points."""

    metric: RiemannianMetric

    def embed(self, points: ndarray) -> ndarray:
        r"""Return the images of points.

        Parameters
        ----------
        points : array, shape (n, \*shape)
            Points.

        Returns
        -------
        array, shape (n, \*image_shape)
        """

    def restore(self, images: ndarray, start: ndarray) -> ndarray:
        r"""Return the points with the nearest images.

        Parameters
        ----------
        images : array, shape (n, \*image_shape)
            Points of the image space.
        start : array, shape (\*shape,)
            Point to search from.

        Returns
        -------
        array, shape (n, \*shape)
        """

    def is_sound(self, point: ndarray, reference: ndarray) -> bool:
        r"""Return whether a point is sound, compared with one that is.

        Parameters
        ----------
        point, reference : array, shape (\*shape,)
            Points.

        Returns
        -------
        bool
        """

    def mean(self, points: ndarray) -> ndarray:
        r"""Return the Karcher mean of points.

        Parameters
        ----------
        points : array, shape (n, \*shape)
            Points.

        Returns
        -------
        array, shape (\*shape,)
        """


class Points(InheritsDocstrings, ImageSpace):
    """The space itself, whose metric has exp and log.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    """

    def __init__(self, metric: RiemannianMetric) -> None:
        self.metric = metric

    def embed(self, points: ndarray) -> ndarray:
        r"""Return the points themselves."""
        return points

    def restore(self, images: ndarray, start: ndarray) -> ndarray:
        r"""Return the images, projected to the manifold to remove rounding errors.

        Parameters
        ----------
        start : array, shape (\*shape,)
            Not used.
        """
        return self.metric.space.projection(images)

    def is_sound(self, point: ndarray, reference: ndarray) -> bool:
        r"""Return True: every point of a manifold is sound.

        Parameters
        ----------
        point, reference : array, shape (\*shape,)
            Not used.
        """
        return True

    def mean(self, points: ndarray) -> ndarray:
        r"""Return the Karcher mean by `GradientDescentMean`."""
        return GradientDescentMean().solve(self.metric, points).point


class Fields(InheritsDocstrings, ImageSpace):
    r"""The fields Φ(f) of surfaces, in the space where the metric measures their distances.

    There geodesics have a closed form, and ‖log Φ(f)‖ = d(f, mean). A point of that space need not
    come from a surface; it is then replaced by the nearest surface.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces.
    nearest : NearestSurface
        Solver for the nearest surface.
    """

    def __init__(self, metric: Any, nearest: NearestSurface) -> None:
        self.metric = metric.target_metric
        self._pullback = metric
        self._nearest = nearest

    def embed(self, points: ndarray) -> ndarray:
        r"""Return the fields of surfaces."""
        return self._pullback.map(points)

    def restore(self, images: ndarray, start: ndarray) -> ndarray:
        r"""Return the nearest surfaces.

        Parameters
        ----------
        start : array, shape (V, 3)
            Surface to search from.
        """
        surfaces = [
            self._nearest.solve(self._pullback, image[None], start).point for image in images
        ]
        return np.array(surfaces).reshape(-1, *self._pullback.space.shape)

    def is_sound(self, point: ndarray, reference: ndarray) -> bool:
        r"""Return whether a surface has no inverted triangle."""
        space: AlignedSurfaces = self._pullback.space
        return not inverted_triangles(point, reference, space.template.faces).any()

    def mean(self, points: ndarray) -> ndarray:
        r"""Return the Karcher mean over all vertices, searched from near a mean of the fields."""
        spaced = np.linspace(0, len(points) - 1, min(_SAMPLE, len(points)))
        sample = points[spaced.astype(int)]
        distances = self._pullback.dist_pairwise(sample, n_jobs=-1, precision="double")
        medoid = sample[np.argmin(np.sum(distances**2, axis=0))]
        start = self._near_mean(self.embed(sample), medoid)
        images = self.embed(points)
        return self._nearest.solve(self._pullback, images, start).point

    def _near_mean(self, images: ndarray, medoid: ndarray) -> ndarray:
        """Return the surface of a mean of fields, by one target in place of all, or the medoid."""
        base = self.embed(medoid[np.newaxis])[0]
        try:
            middle = self.metric.exp(self.metric.log(images, base).mean(axis=0), base)
        except OutsideManifoldError:
            return medoid
        return self.restore(middle[np.newaxis], medoid)[0]


def image_space(metric: Any, kind: str, nearest: NearestSurface | None) -> ImageSpace:
    """Return the space for the statistics of a metric.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric of the points.
    kind : {"auto", "fields", "points"}
        "fields" for metrics on surfaces that are pulled back from one with exp and log; "points"
        for metrics that have them; "auto" is "fields" for pull-backs, else "points".
    nearest : NearestSurface, optional
        How surfaces are found from fields.

    Returns
    -------
    ImageSpace

    Raises
    ------
    ArgumentError
        If the kind is unknown, or "fields" is requested for a metric that is no pull-back.
    """
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
