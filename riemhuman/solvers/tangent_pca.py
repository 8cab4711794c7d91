"""Principal component analysis in the tangent space at the Karcher mean."""

from __future__ import annotations

from typing import Self

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Points
from riemhuman.checks import (
    Rng,
    a_solver,
    generator,
    one_of,
    real_array,
    whole_number,
)
from riemhuman.errors import ArgumentError
from riemhuman.estimator import Estimator
from riemhuman.geometry import Manifold, RiemannianMetric
from riemhuman.geometry.manifold import metric_of, sample_count, stack_samples, surface_space
from riemhuman.geometry.strategies import MeanSolver
from riemhuman.kernels.projections import with_positive_peaks
from riemhuman.kernels.surface import joined_axes
from riemhuman.solvers._mixed_poses import warn_of_mixed_poses
from riemhuman.solvers.means import BasisMean, GradientDescentMean
from riemhuman.solvers.nearest_surface import NearestSurface, inverted_triangles

# Squared singular values below this share of the first are rounding errors.
_ROUNDING = 1e-13

# Draws per requested sample before too many are rejected.
_MOST_DRAWN = 100

IMAGES = ("auto", "fields", "points")


class ImageEstimator(Estimator):
    r"""An estimator that takes logarithms of the fields Φ(f) of surfaces, or of points themselves.

    In the space of fields geodesics have a closed form, and ‖log Φ(f)‖ = d(f, mean). A point of
    that space need not come from a surface; it is then replaced by the nearest surface.
    """

    space: Manifold | RiemannianMetric
    image: str
    nearest: NearestSurface | None

    @property
    def _metric(self) -> RiemannianMetric:
        return metric_of(self.space)

    @property
    def _takes_fields(self) -> bool:
        is_pulled_back = self._metric.has_target_metric
        if one_of(self.image, "image", IMAGES) == "fields" and not is_pulled_back:
            raise ArgumentError(
                f'image="fields" needs a metric pulled back by a map of surfaces; '
                f"found {type(self._metric).__name__}"
            )
        return is_pulled_back and self.image != "points"

    @property
    def _image_metric(self) -> RiemannianMetric:
        return self._metric.target_metric if self._takes_fields else self._metric

    @property
    def _nearest(self) -> NearestSurface:
        return NearestSurface() if self.nearest is None else self.nearest

    def _embed(self, points: Points) -> Array:
        return self._metric.map(points) if self._takes_fields else points

    def _restore(self, images: Array, start: Points) -> Array:
        """Return the surfaces with the nearest fields, or points without rounding errors."""
        metric = self._metric
        if not self._takes_fields:
            return metric.space.projection(images)
        surfaces = [self._nearest.solve(metric, image[None], start).point for image in images]
        return np.array(surfaces).reshape(-1, *metric.space.shape)

    def _mean_point(self, mean: MeanSolver | ArrayLike | None, points: Points) -> Array:
        """Return the point of tangency: a point, what a solver finds, or the Karcher mean."""
        metric, nearest = self._metric, self._nearest
        if mean is None and self._takes_fields:
            mean = BasisMean(companion_weight=nearest.companion_weight, progress=nearest.progress)
        elif mean is None:
            mean = GradientDescentMean()
        if isinstance(mean, type) or hasattr(mean, "solve"):
            a_solver(mean, "mean")
            return mean.solve(metric, points).point
        point = real_array(mean, "mean", metric.space.shape, batched=False)
        return metric.space.check_point(point, "mean")


class TangentPCA(ImageEstimator):
    r"""Principal directions of logarithms at the Karcher mean, orthonormal in the metric there.

    With :math:`v_i = \log_{\bar x} x_i` minus their average, the directions :math:`u_k` maximise
    :math:`\sum_i \langle v_i, u_k\rangle_{\bar x}^2` [1]_. They are computed from the n × n matrix
    of inner products of the :math:`v_i`.

    Surfaces are mapped to their fields Φ(f) = (g, n), where geodesics have a closed form.
    Logarithms are taken there, and a combination of directions is mapped back to the surface with
    the nearest fields, see `NearestSurface`. The weights of the metric thus decide what is
    analysed: (1, 1, 0) body shape in any pose, (0, 0, 1) pose, (1, 1, 1) both. If λ is so small
    that triangles have no logarithm (θ ≥ π, as with the λ = 1e-4 of retrieval), `fit` raises an
    OutsideManifoldError.

    If the bodies are in several poses, combinations of their components tear them, above all at the
    shoulders. Unless the metric uses normals alone, `fit` issues a MixedPosesWarning if more than 2
    % of the area of a body is turned by more than 30° from the average of all bodies, with
    rotations smoothed over the body. For ten people in one pose (the natural open bodies), it is at
    most 0.6 %. `riemhuman.measurements.in_standard_pose` brings bodies into one pose.

    The directions are optimal in the metric rather than in millimetres. Of ten people of FAUST, a
    person left out is described to within 37.7 mm, and by principal components of vertices to
    within 21.4 mm; in the metric, to within 0.487 and 0.629 (tests/benchmarks/test_statistics.py).

    Parameters
    ----------
    space : Manifold or RiemannianMetric
        A manifold equipped with a metric, or the metric.
    n_components : int, optional
        Number of directions; by default the dimension that the logarithms span.
    mean : array, shape (\*shape,), or object, optional
        The point of tangency, or a solver for it, such as `BasisMean`. By default the Karcher mean,
        found by `GradientDescentMean` or, for surfaces, by `BasisMean`.
    image : {"auto", "fields", "points"}
        Where logarithms are taken: "fields" as above, by default for metrics that are pulled back,
        or "points" with the metric's own `exp` and `log`.
    nearest : NearestSurface, optional
        How surfaces are found from fields.

    Attributes
    ----------
    mean_ : array, shape (\*shape,)
        The point of tangency x̄.
    components_ : array, shape (n_components, \*image_shape)
        Directions :math:`u_k`, tangent at the image of the mean.
    explained_variance_ : array, shape (n_components,)
        Sample variance of the coordinate along each.
    explained_variance_ratio_ : array, shape (n_components,)
        The same, as a share of the total variance.
    offset_ : array, shape (\*image_shape,)
        Average of the logarithms; it is not 0 for surfaces, because their mean is the best surface
        rather than the best field.
    n_components_ : int

    References
    ----------
    .. [1] Fletcher, Lu, Pizer, Joshi, "Principal geodesic analysis for the study of nonlinear
       statistics of shape", IEEE Transactions on Medical Imaging 23, 2004.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template, equip=False)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=1.0)
    >>> rh.TangentPCA(space, n_components=2).fit_transform(bodies.points[:50:10]).shape
    (5, 2)
    """

    mean_: Array
    components_: Array
    explained_variance_: Array
    explained_variance_ratio_: Array
    offset_: Array
    n_components_: int

    def __init__(
        self,
        space: Manifold | RiemannianMetric,
        n_components: int | None = None,
        *,
        mean: MeanSolver | ArrayLike | None = None,
        image: str = "auto",
        nearest: NearestSurface | None = None,
    ) -> None:
        self.space = space
        self.n_components = n_components
        self.mean = mean
        self.image = image
        self.nearest = nearest

    def fit(self, X: Array, y: object = None, base_point: Points | None = None) -> Self:
        r"""Find the mean and the directions.

        Parameters
        ----------
        X : array, shape (n, \*shape)
            Points, at least two.
        y : object
            Not used.
        base_point : array, shape (\*shape,), optional
            Point to use instead of the mean.
        """
        points = self._metric.check_points(X, "X")
        if len(points) < 2:
            raise ArgumentError(f"X must hold at least two points; found {len(points)}")
        if self.n_components is not None:
            whole_number(self.n_components, "n_components", minimum=1)
        self.mean_ = self._mean_point(self.mean if base_point is None else base_point, points)
        metric = self._image_metric
        self._base = self._embed(self.mean_[None])[0]
        logs = metric.log(self._embed(points), self._base)
        warn_of_mixed_poses(self._metric, points, self.mean_)
        self.offset_ = logs.mean(axis=0)
        logs = logs - self.offset_
        rows = logs.reshape(len(logs), -1)
        values, vectors = np.linalg.eigh(metric.gram_matrix(logs, self._base))
        values, vectors = values[::-1], vectors[:, ::-1]
        rank = int(np.sum(values > _ROUNDING * max(values[0], 0.0)))
        if values[0] <= (_ROUNDING * np.abs(self._base).max()) ** 2:
            raise ArgumentError("all points of X coincide, so there is no direction to find")
        n_components = rank if self.n_components is None else self.n_components
        if n_components > rank:
            raise ArgumentError(
                f"n_components={n_components} exceeds the {rank} directions that the logarithms "
                "of X span"
            )
        self.n_components_ = n_components
        components = (vectors[:, :n_components] / np.sqrt(values[:n_components])).T @ rows
        self.components_ = with_positive_peaks(components).reshape(n_components, *logs.shape[1:])
        self.explained_variance_ = values[:n_components] / (len(logs) - 1)
        self.explained_variance_ratio_ = values[:n_components] / values[values > 0].sum()
        return self

    def transform(self, X: Array, y: object = None) -> Array:
        r"""Return the coordinates of points, ⟨log x − offset, u_k⟩, shape (n, n_components).

        Parameters
        ----------
        X : array, shape (n, \*shape)
        y : object
            Not used.
        """
        self._require_fit("components_")
        metric, points = self._image_metric, self._metric.check_points(X, "X")
        logs = metric.log(self._embed(points), self._base) - self.offset_
        covectors = metric.covector(self.components_, self._base)
        rows, columns = joined_axes(logs, logs.ndim - 1), joined_axes(covectors, logs.ndim - 1).T
        scores: Array = rows @ columns
        return scores

    def fit_transform(self, X: Array, y: object = None, base_point: Points | None = None) -> Array:
        r"""Fit, and return the coordinates of the same points.

        Parameters
        ----------
        X, y, base_point
            See `fit`.
        """
        return self.fit(X, base_point=base_point).transform(X)

    def inverse_transform(self, X: Array) -> Array:
        r"""Return the points exp(offset + Σ_k z_k u_k), for surfaces those with the nearest fields.

        Parameters
        ----------
        X : array, shape (n, m)
            Coordinates z along the first m ≤ n_components directions; the others are 0.
        """
        self._require_fit("components_")
        scores = real_array(X, "X", ("n", "n_components"), batched=False)
        directions = self.components_[: scores.shape[1]]
        vectors = self.offset_ + np.tensordot(scores, directions, axes=1)
        return self._restore(self._image_metric.exp(vectors, self._base), self.mean_)

    def sample(self, n_samples: int = 1, rng: Rng = 0) -> Array:
        r"""Draw points from the normal distribution of the coordinates.

        Surfaces with `inverted_triangles` are redrawn, at most a hundred times.

        Parameters
        ----------
        n_samples : int
        rng : int or numpy.random.Generator
            Seed, or the generator to draw from.

        Returns
        -------
        array, shape (n_samples, \*shape), or (\*shape,) for one sample
        """
        self._require_fit("components_")
        n_samples = sample_count(n_samples)
        rng = generator(rng)
        deviations = np.sqrt(self.explained_variance_)
        accepted: list[Array] = []
        n_drawn = 0
        while len(accepted) < n_samples:
            if n_drawn >= _MOST_DRAWN * n_samples:
                raise ArgumentError(
                    "X must hold surfaces alike enough for samples without inverted triangles; "
                    f"{len(accepted)} of {n_drawn} drawn have none"
                )
            noise = rng.standard_normal((n_samples - len(accepted), self.n_components_))
            points = self.inverse_transform(noise * deviations)
            n_drawn += len(points)
            accepted += [point for point in points if self._is_sound(point)]
        return stack_samples(np.stack(accepted), n_samples)

    def _is_sound(self, point: Points) -> bool:
        if not self._takes_fields:
            return True
        faces = surface_space(self._metric.space).template.faces
        return not inverted_triangles(point, self.mean_, faces).any()
