"""Distances of a surface from points of the image space, with their gradients."""

from __future__ import annotations

from typing import Any, Protocol

import autograd.numpy as np
from autograd import value_and_grad
from numpy import ndarray

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.geometry import ElasticMetric, RiemannianMetric
from riemhuman.kernels.surface import stacked_derivatives, triangle_frames
from riemhuman.surfaces.template import Template
from riemhuman.terms._sum import SumOfTerms

# How often triangles are turned within their planes as on the last surface, at least and at most.
# Between, rounds go on while each takes a fifth of the value: steps of the search cost more.
_ROUNDS, _MOST_ROUNDS = 5, 12
_WORTH_A_ROUND = 0.8

# Share of the mean of their squares below which sizes of triangles count as this.
_SMALLEST = 1e-6


class ImageDistances(Protocol):
    """The weighted mean of squared distances from points of the image space."""

    def value_and_gradient(self, surface: ndarray) -> tuple[float, ndarray]:
        """Return the mean and its gradient in the vertices.

        Parameters
        ----------
        surface : array, shape (V, 3)
            Surface.

        Returns
        -------
        value : float
            Infinite where the metric needs a normal of a triangle without area.
        gradient : array, shape (V, 3)
        """

    def nearby(self, surface: ndarray) -> ndarray:
        """Return a surface that may be nearer to the points, or the same surface.

        Parameters
        ----------
        surface : array, shape (V, 3)
            Surface.

        Returns
        -------
        array, shape (V, 3)
        """


class _ByDefinition:
    """The mean for any pull-back, by autograd."""

    def __init__(self, metric: RiemannianMetric, images: ndarray, weights: ndarray) -> None:
        def mean(surface: ndarray) -> Any:
            return np.dot(weights, metric.target_metric.squared_dist(metric.map(surface), images))

        self._slope = value_and_grad(mean)

    def value_and_gradient(self, surface: ndarray) -> tuple[float, ndarray]:
        try:
            value, gradient = self._slope(surface)
        except DegenerateSurfaceError:
            return np.inf, np.zeros_like(surface)
        return float(value), gradient

    def nearby(self, surface: ndarray) -> ndarray:
        return surface


class _OfElasticMetric:
    """The mean for elastic metrics, in compiled loops.

    Fields (g, n) that come from no surface come from a surface of separate triangles all the same:
    the metric does not see how these lie. So distances from fields are those between surfaces over
    a template whose triangles are separate.
    """

    def __init__(self, metric: ElasticMetric, images: ndarray, weights: ndarray) -> None:
        self._template = template = metric.space.template
        self._separate = separate = Template(
            template.vertices[template.faces].reshape(-1, 3),
            np.arange(3 * template.n_faces).reshape(-1, 3),
        )
        self._sum, used = SumOfTerms(metric.terms, template), weights > 0
        self._weights = weights[used]
        self._targets = np.stack(
            [_separate_triangles(metric, separate, image) for image in images[used]]
        )
        self._sees_all = metric.a > 0 and metric.c > 0

    def value_and_gradient(self, surface: ndarray) -> tuple[float, ndarray]:
        targets, faces = self._targets, self._separate.faces
        squared, gradient = self._sum.squared_dists(surface, targets, self._weights, faces)
        return float(self._weights @ squared), gradient

    def nearby(self, surface: ndarray) -> ndarray:
        """Return the surface whose derivatives are nearest to those of one target's triangles.

        The metric does not see rotations of a triangle within its plane. They are chosen as near as
        possible to the previous surface, in a few rounds with the extrapolation of Anderson from
        two rounds (Peng et al., "Anderson acceleration for geometry optimization", ACM TOG 37,
        2018). Errors are relative to the triangles' sizes, as those of normals are.
        """
        if len(self._targets) > 1 or not self._sees_all:
            return surface
        operator = self._template.differential_operator
        frames = triangle_frames(self._targets[0], self._separate.differential_operator)
        tangents, normals = frames[..., :2], frames[..., 2:]
        across = np.cross(normals, tangents, axis=1)
        sizes = np.sum(tangents**2, axis=(1, 2))
        weights = sizes.mean() / np.maximum(sizes, _SMALLEST * sizes.mean())
        assemble = self._template.interpolator.with_weights(weights)

        def assembled(surface: ndarray) -> ndarray:
            there = triangle_frames(surface, operator)[..., :2]
            # Σ (there · here) and Σ (there · n × here) over both columns: cos and sin of the turn.
            cosine = np.sum(there * tangents, axis=(1, 2))
            sine = np.sum(there * across, axis=(1, 2))
            size = np.hypot(cosine, sine)
            size = np.where(size > 0.0, size, 1.0)
            cosine, sine = (part[:, None, None] / size[:, None, None] for part in (cosine, sine))
            return assemble.surface_of(
                stacked_derivatives(cosine * tangents + sine * across), surface
            )

        best, value = surface, np.inf
        before = assembled(surface)
        change, surface = before - surface, before
        for k in range(1, _MOST_ROUNDS):
            after = assembled(surface)
            new_change = after - surface
            bend = new_change - change
            share = np.vdot(bend, new_change) / (np.vdot(bend, bend) or 1.0)
            surface = after - share * (after - before)
            before, change = after, new_change
            if k + 1 < _ROUNDS:
                continue
            last, (new_value, _) = value, self.value_and_gradient(surface)
            if new_value < value:
                best, value = surface, new_value
            if not new_value < _WORTH_A_ROUND * last:
                break
        return best


def image_distances(metric: RiemannianMetric, images: ndarray, weights: ndarray) -> ImageDistances:
    r"""Return the weighted mean of squared distances from points of the image space.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces.
    images : array, shape (n, \*target_shape)
        Points of the space of its target.
    weights : array, shape (n,)
        Weights that sum to one.

    Returns
    -------
    ImageDistances
    """
    if isinstance(metric, ElasticMetric):
        return _OfElasticMetric(metric, images, weights)
    return _ByDefinition(metric, images, weights)


def _separate_triangles(metric: ElasticMetric, template: Template, image: ndarray) -> ndarray:
    """Return corners of triangles with given fields, shape (3F, 3)."""
    product: Any = metric.target_metric.space
    parts = list(product.project_from_product(image))
    n_faces = template.n_faces
    g = parts.pop(0) if metric.a > 0 else np.tile(np.eye(2), (n_faces, 1, 1))
    normals = parts.pop(0) if metric.c > 0 else np.tile([0.0, 0.0, 1.0], (n_faces, 1))
    # Any direction across the normal: the axis that is farthest from it leads to one.
    axes = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    first = np.cross(normals, axes)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normals, first)
    lower = np.linalg.cholesky(g)
    f_u = lower[:, :1, 0] * first
    f_v = lower[:, 1:, 0] * first + lower[:, 1:, 1] * second
    inverse_u2, inverse_v3, shear = template.frame_coefficients.T[..., None]
    corner_2 = f_u / inverse_u2
    corner_3 = (f_v + shear * corner_2) / inverse_v3
    return np.stack([np.zeros_like(f_u), corner_2, corner_3], axis=1).reshape(-1, 3)
