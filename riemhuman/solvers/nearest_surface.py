"""The surface whose fields Φ(f) = (g, n) are nearest to given fields."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import autograd.numpy as anp
import numpy as np
from autograd import value_and_grad
from scipy.sparse import csr_array

from riemhuman.arrays import Array, Booleans, Points, Triangles
from riemhuman.checks import checked, flag, positive, real, real_array, weight_shares, whole
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import ElasticMetric, ProductManifold, RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.io.mesh_arrays import check_triangles
from riemhuman.kernels.surface import (
    apply_operator,
    stacked_derivatives,
    triangle_corners,
    triangle_frames,
    unit_vectors,
)
from riemhuman.solvers._lbfgs import Minimum, minimize_from
from riemhuman.solvers._preconditioners import CholeskyFactor, SparseCholeskyFactor, metric_factor
from riemhuman.solvers.paths import rounding_energy
from riemhuman.solvers.results import MeanResult, finish
from riemhuman.surfaces import Template
from riemhuman.terms._sums import SumOfTerms

# Iterations after which the matrix is factored anew.
_REFRESH = 30

# Default share of the first value below which nothing is left to gain.
_ROUNDING = 1e-8

# Share of the start's value below which a guess is one: where it is not, limbs may lie across.
_NEARBY = 0.25

# How often triangles are turned within their planes as on the last surface, at least and at most.
# In between, rounds continue while each removes a fifth of the value: search steps cost more.
_LEAST_ROUNDS, _MOST_ROUNDS = 5, 12
_WORTH_A_ROUND = 0.8

# Share of the mean of their squares below which sizes of triangles count as this.
_SMALLEST = 1e-6


@checked(
    companion_weight=real(minimum=0.0), tolerance=positive, max_iter=whole(minimum=1), progress=flag
)
@dataclass(frozen=True)
class NearestSurface:
    """The surface f that minimises the mean of d(Φ(f), y_i)² over all its vertices.

    With a single target y, a point of the image space that need not come from a surface, it is the
    projection of y to surfaces. With the images of several surfaces, it is their Karcher mean.

    A metric of metric fields alone (c = 0) hardly measures how a surface bends, and one of normals
    alone (a = 0) does not measure the size of triangles. For such an `ElasticMetric`, the missing
    part, ε d_companion(f, start)², is added, which keeps the surface near the start.

    The surfaces f and -f have the same g and n. The start decides which of them is found, and
    should face the same way as the desired surface.

    Parameters
    ----------
    companion_weight : float
        ε, of at least 0.
    tolerance : float
        Stop when a Newton step would gain at most this share of the functional, estimated from the
        preconditioned gradient.
    max_iter : int
    progress : bool

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.AlignedSurfaces(bodies.template).metric
    >>> images = metric.map(bodies.points[:2])
    >>> rh.solvers.NearestSurface().solve(metric, images, bodies[0]).point.shape
    (1202, 3)
    """

    companion_weight: float = 1e-2
    tolerance: float = 1e-5
    max_iter: int = 500
    progress: bool = False

    def solve(
        self,
        metric: RiemannianMetric,
        images: Array,
        start: Points,
    ) -> MeanResult:
        r"""Find the surface.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on surfaces, pulled back by Φ = ``metric.map``.
        images : array, shape (n, \*target_shape)
            Targets y_i, points of the space of ``metric.target_metric``.
        start : array, shape (V, 3)

        Returns
        -------
        MeanResult
            `variances` include the companion's part, `variance` does not.
        """
        check_metric(metric)
        images = metric.target_metric.check_points(images, "images")
        if not len(images):
            raise ArgumentError("images must hold at least one target; found none")
        start = real_array(start, "start", metric.space.shape, batched=False)
        distances = image_distances(metric, images)
        minimum = self._minimum(metric, distances, start)
        variance, _ = distances.value_and_gradient(minimum.x)
        return finish(self, MeanResult(minimum.x, variance, minimum.values, **minimum.outcome))

    def _minimum(
        self,
        metric: RiemannianMetric,
        distances: _ByDefinition | _OfElasticMetric,
        start: Points,
    ) -> Minimum:
        """Return the surface found, with the companion's part."""
        companion = metric.complementary_metric if self.companion_weight else None

        def function(f: Points) -> tuple[float, Array]:
            value, gradient = distances.value_and_gradient(f)
            if companion is not None:
                squared, slopes = companion.energy_and_gradient(np.stack([start, f]))
                value += self.companion_weight * squared
                gradient = gradient + self.companion_weight * slopes[1]
            return value, gradient

        def half_inverse_hessian_at(f: Points) -> CholeskyFactor:
            if companion is None:
                return metric_factor(metric, f[None], 0.5)
            unseen = self.companion_weight * companion.metric_matrix(f)
            return SparseCholeskyFactor(2.0 * (metric.metric_matrix(f) + unseen))

        first_value, _ = function(start)
        if not np.isfinite(first_value):
            raise DegenerateSurfaceError("every triangle of start must have an area")
        guess = distances.nearby(start)
        is_near = function(guess)[0] < _NEARBY * first_value
        rounding = max(min(_ROUNDING, self.tolerance) * first_value, rounding_energy(metric, start))
        return minimize_from(
            guess if is_near else start,
            metric.space,
            None,
            function,
            half_inverse_hessian_at,
            tolerance=self.tolerance,
            max_iter=self.max_iter,
            refresh=_REFRESH,
            floor=rounding,
            progress="surface" if self.progress else "",
        )


def inverted_triangles(points: Points, reference: Array, faces: Triangles) -> Booleans:
    r"""Return which triangles of a surface are inverted with respect to a reference.

    Let A be the mean of the deformation gradients of all triangles that share a corner with a given
    one, weighted by their areas on the reference and by how many corners they share. A should take
    the normal n of the triangle to the direction of :math:`\det(A)\, A^{-\top} n`; the triangle is
    inverted if its normal points the other way.

    Parameters
    ----------
    points : array, shape (..., V, 3)
    reference : array, shape (V, 3)
        A surface without inverted triangles, such as a mean.
    faces : array of int, shape (F, 3)

    Returns
    -------
    array of bool, shape (..., F)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.solvers.inverted_triangles(bodies[0], bodies[1], bodies.template.faces).shape
    (2400,)
    """
    shape = ("n_vertices", 3)
    reference = _near_one(real_array(reference, "reference", shape, batched=False))
    points = _near_one(real_array(points, "points", reference.shape))
    faces = check_triangles(faces, len(reference))
    frames, unit = _frames(points, faces), _frames(reference, faces)
    areas = np.linalg.det(unit)
    if not np.all(areas > 0):
        triangle = int(np.argmin(areas > 0))
        raise DegenerateSurfaceError(
            f"every triangle of reference must have an area; found otherwise at triangle {triangle}"
        )
    gradients = areas[:, None, None] * (frames @ np.linalg.inv(unit))
    # The mean's length does not matter, only the direction it gives to the normal.
    ends = np.arange(0, faces.size + 1, 3)
    corners = csr_array((np.ones(faces.size), faces.ravel(), ends), (len(faces), len(reference)))
    flat = gradients.reshape(*gradients.shape[:-2], 9)
    means = apply_operator(corners, apply_operator(corners.T, flat)).reshape(gradients.shape)
    # det(A) A⁻ᵀ n as the cross product of images, which singular A have, too.
    edges, normals = unit[..., 0], unit[..., 2]
    across = np.cross(normals, edges)
    images_of_edges = np.einsum("...ij,...j->...i", means, edges)
    images_across = np.einsum("...ij,...j->...i", means, across)
    expected = np.cross(images_of_edges, images_across)
    inverted: Booleans = np.sum(expected * frames[..., 2], axis=-1) <= 0
    return inverted


def _near_one(points: Points) -> Points:
    """Return points of about size one, divided by a power of two: normals count as edges do."""
    exponent = np.frexp(np.abs(points).max(initial=0.0))[1]
    scaled: Points = np.ldexp(points, -exponent)
    return scaled


def _frames(points: Points, faces: Triangles) -> Array:
    """Return two edges and the unit normal of every triangle as columns, shape (..., F, 3, 3)."""
    corner_1, corner_2, corner_3 = triangle_corners(points, faces)
    edge_2, edge_3 = corner_2 - corner_1, corner_3 - corner_1
    normals = unit_vectors(np.cross(edge_2, edge_3))
    return np.stack([edge_2, edge_3, normals], axis=-1)


class _ByDefinition:
    """The mean for any pull-back, by autograd."""

    def __init__(self, metric: RiemannianMetric, images: Array) -> None:
        def mean(surface: Points) -> Array:
            return anp.mean(metric.target_metric.squared_dist(metric.map(surface), images))

        self._slope = value_and_grad(mean)

    def value_and_gradient(self, surface: Points) -> tuple[float, Array]:
        try:
            value, gradient = self._slope(surface)
        except DegenerateSurfaceError:
            return np.inf, np.zeros_like(surface)
        return float(value), gradient

    def nearby(self, surface: Points) -> Array:
        return surface


class _OfElasticMetric:
    """The mean for elastic metrics, in compiled loops."""

    # Fields (g, n) that come from no surface come from one of separate triangles all the same: the
    # metric does not see how these lie.

    def __init__(self, metric: ElasticMetric, images: Array) -> None:
        self._template = template = metric.space.template
        self._separate = separate = Template(
            template.vertices[template.faces].reshape(-1, 3),
            np.arange(3 * template.n_faces).reshape(-1, 3),
        )
        self._sum = SumOfTerms(metric.terms, template)
        self._weights = weight_shares(None, len(images))
        self._targets = np.stack([_separate_triangles(metric, separate, y) for y in images])
        self._has_both_terms = metric.a > 0 and metric.c > 0

    def value_and_gradient(self, surface: Points) -> tuple[float, Array]:
        targets, faces = self._targets, self._separate.faces
        squared, gradient = self._sum.squared_dists(surface, targets, self._weights, faces)
        return float(self._weights @ squared), gradient

    def nearby(self, surface: Points) -> Array:
        """Return the surface whose derivatives are nearest to those of one target's triangles."""
        # The metric ignores rotations of a triangle within its plane. They are chosen as on
        # the last surface, with Anderson acceleration (Peng et al., ACM TOG 37, 2018).
        if len(self._targets) > 1 or not self._has_both_terms:
            return surface
        operator = self._template.differential_operator
        frames = triangle_frames(self._targets[0], self._separate.differential_operator)
        tangents, normals = frames[..., :2], frames[..., 2:]
        across = np.cross(normals, tangents, axis=1)
        sizes = np.sum(tangents**2, axis=(1, 2))
        weights = sizes.mean() / np.maximum(sizes, _SMALLEST * sizes.mean())
        assemble = self._template.interpolator.with_weights(weights)

        def assembled(surface: Points) -> Array:
            goal = triangle_frames(surface, operator)[..., :2]
            # Sums over both columns, proportional to the cosine and the sine of the turn.
            cosine = np.sum(goal * tangents, axis=(1, 2))
            sine = np.sum(goal * across, axis=(1, 2))
            size = np.hypot(cosine, sine)
            size = np.where(size > 0.0, size, 1.0)
            cosine, sine = cosine / size, sine / size
            turned = cosine[:, None, None] * tangents + sine[:, None, None] * across
            return assemble.surface_of(stacked_derivatives(turned), surface)

        best, best_value = surface, np.inf
        # Of the last round: the surface that was assembled, and how far it was from its start.
        assembled_before = assembled(surface)
        change_before = assembled_before - surface
        surface = assembled_before
        for n_rounds in range(2, _MOST_ROUNDS + 1):
            assembled_now = assembled(surface)
            change = assembled_now - surface
            difference = change - change_before
            share = np.vdot(difference, change) / (np.vdot(difference, difference) or 1.0)
            surface = assembled_now - share * (assembled_now - assembled_before)
            assembled_before, change_before = assembled_now, change
            if n_rounds < _LEAST_ROUNDS:
                continue
            value, _ = self.value_and_gradient(surface)
            is_worth_another = value < _WORTH_A_ROUND * best_value
            if value < best_value:
                best, best_value = surface, value
            if not is_worth_another:
                break
        return best


def image_distances(metric: RiemannianMetric, images: Array) -> _ByDefinition | _OfElasticMetric:
    """Return the mean of squared distances from points of the image space."""
    if isinstance(metric, ElasticMetric):
        return _OfElasticMetric(metric, images)
    return _ByDefinition(metric, images)


def _separate_triangles(metric: ElasticMetric, template: Template, image: Array) -> Array:
    """Return corners of triangles with given fields, shape (3F, 3)."""
    product = cast("ProductManifold", metric.target_metric.space)
    # The metric field comes first, then the normals, each only if the metric measures it.
    parts = product.project_from_product(image)
    g, normals = parts[0], parts[-1]
    if not metric.a > 0:
        g = np.tile(np.eye(2), (template.n_faces, 1, 1))
    if not metric.c > 0:
        normals = np.tile([0.0, 0.0, 1.0], (template.n_faces, 1))
    # Some direction across the normal: the axis that is farthest from it leads to one.
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
