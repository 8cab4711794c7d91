"""Motions aligned in time: their Karcher mean, its principal components, and geodesics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from tqdm import tqdm

from riemhuman.arrays import Array
from riemhuman.checks import checked, flag, instance, real_array, whole, whole_number
from riemhuman.checks.labels import texts_of
from riemhuman.errors import ArgumentError, shown
from riemhuman.estimator import Estimator
from riemhuman.geometry import ElasticMetric, ProductManifold, ProductMetric, RiemannianMetric
from riemhuman.geometry.manifold import manifold_of
from riemhuman.motions._frames import (
    Motion,
    angles_to,
    check_motions,
    frame_count,
    rotate_upright,
    surfaces_between,
)
from riemhuman.motions.motion_space import MotionSpace, RateDependentMetric, frame_metric
from riemhuman.motions.time_warping import DynamicTimeWarping, MotionDistance, Warp
from riemhuman.solvers.nearest_surface import NearestSurface
from riemhuman.solvers.tangent_pca import TangentPCA

# Share of uniform time in a re-timing, so that it never stands still.
_EVEN = 1e-3


def _even_times(warp: Warp, n_times: int) -> Array:
    """Return the times of the second motion, increasing from 0 to 1, at even times of the first."""
    even = np.linspace(0.0, 1.0, n_times)
    times = warp(even * warp.first[-1]) / warp.second[-1]
    times[0], times[-1] = 0.0, 1.0
    increasing: Array = (1.0 - _EVEN) * times + _EVEN * even
    return increasing


an_alignment = instance(MotionDistance, "an alignment such as DynamicTimeWarping(metric)")
"""The check of what can align motions."""


@checked(space=instance(MotionSpace, "a MotionSpace(...)"), alignment=an_alignment)
def align_motions(
    space: MotionSpace,
    m1: Motion,
    m2: Motion,
    alignment: MotionDistance | None = None,
    names: tuple[str, str] = ("m1", "m2"),
) -> tuple[Array, Array, Warp]:
    """Return a motion at equally spaced times, and another at the corresponding times.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
        Motions of at least two frames.
    alignment : DynamicTimeWarping, VelocityTimeWarping or RateInvariantMetric, optional
        How the second motion is aligned with the first; by default by `DynamicTimeWarping` of
        changes, with the metric of the frames.
    names : pair of str
        Names of the motions, for messages.

    Returns
    -------
    first, second : array, shape (n_times, V, 3)
    warp : Warp
        The corresponding times.

    Examples
    --------
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(knees.template), n_times=4)
    >>> first, second, warp = rh.motions.align_motions(motions, knees[:30:6], other[:30:6])
    >>> first.shape == second.shape == (4, 1202, 3)
    True
    """
    texts = texts_of(names, "names")
    if len(texts) != 2:
        raise ArgumentError(f"names must be those of two motions; found {shown(names)}")
    warp = (alignment or _default_alignment(space)).warp(m1, m2)
    first = space.resample(m1, name=texts[0])
    return first, _at_shares(space, m2, _even_times(warp, space.n_times), texts[1]), warp


def _default_alignment(space: MotionSpace) -> MotionDistance:
    return DynamicTimeWarping(frame_metric(space, None), centered=True, between_frames=True)


def _at_shares(space: MotionSpace, motion: Motion, times: Array, name: str) -> Array:
    """Return a motion at times given as shares of its duration."""
    last = frame_count(motion, name) - 1
    return space.resample(motion, at=np.clip(times, 0.0, 1.0) * last, name=name)


@dataclass(frozen=True)
class MotionPath:
    """A path of motions, shape (n_nodes, n_times, V, 3), and times of the second, as shares."""

    path: Array
    times: Array


@checked(n_nodes=whole(minimum=2), alignment=an_alignment)
@dataclass(frozen=True)
class MotionGeodesic:
    """The geodesic of the L² metric between a motion and the best re-timing of another.

    At each time it is a geodesic between the two surfaces, found by the solver of the space of
    motions.

    Parameters
    ----------
    n_nodes : int
        Number of motions of the path, both ends included.
    alignment : DynamicTimeWarping, VelocityTimeWarping or RateInvariantMetric, optional
        How the second motion is aligned with the first, see `align_motions`.

    Examples
    --------
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(knees.template), n_times=4)
    >>> result = rh.motions.MotionGeodesic(n_nodes=3).solve(motions, knees[:30:6], other[:30:6])
    >>> result.path.shape
    (3, 4, 1202, 3)
    """

    n_nodes: int = 5
    alignment: MotionDistance | None = None

    def solve(self, space: MotionSpace, m1: Motion, m2: Motion) -> MotionPath:
        """Return the path.

        Parameters
        ----------
        space : MotionSpace
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.
        """
        first, second, warp = align_motions(space, m1, m2, self.alignment)
        shares = np.linspace(0.0, 1.0, self.n_nodes)
        pairs = zip(first, second, strict=True)
        columns = [surfaces_between(space.frames, a, b, shares) for a, b in pairs]
        return MotionPath(np.stack(columns, axis=1), _even_times(warp, space.n_times))


class MotionMean(Estimator):
    r"""The Karcher mean of motions modulo re-timing, in the L² metric.

    .. math:: \min_m \sum_k \min_{\gamma_k} \int_0^1 d(m(t), m_k(\gamma_k(t)))^2\, dt

    Motions are aligned first with the one that is nearest to all others, then with their mean,
    which is the Karcher mean of the surfaces at every time, over all vertices. The times of the
    mean are the means of the times of the motions. The direction in which bodies face has no
    effect: at every time, all bodies are rotated in place about the vertical axis, y, to the mean
    of their directions.

    Parameters
    ----------
    space : MotionSpace
        Space of motions, which gives the number of times of the mean.
    metric : RiemannianMetric, optional
        Metric of the means of surfaces, pulled back from fields. By default
        ``ElasticMetric(a=1, lam=1, c=1)``, which depends on shape and pose.
    alignment : DynamicTimeWarping, VelocityTimeWarping or RateInvariantMetric, optional
        How motions are aligned, see `align_motions`.
    n_iterations : int
        Number of means computed; after the first, motions are aligned with the previous mean.
    progress : bool
        Whether to show a progress bar over times.

    Attributes
    ----------
    estimate_ : array, shape (n_times, V, 3)
        The mean. Its centroids are the means of the motions' centroids.
    times_ : array, shape (n, n_times)
        Times of every motion that correspond to those of the mean, as shares of its duration.
    aligned_ : array, shape (n, n_times, V, 3)
        The motions at these times, rotated to face as the mean does.
    variance_ : float
        Mean over motions and time of the squared distance to the mean.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(knees[0].template), n_times=4)
    >>> mean = rh.motions.MotionMean(motions).fit([motion[:40:8] for motion in knees])
    >>> mean.estimate_.shape
    (4, 1202, 3)
    """

    estimate_: Array
    times_: Array
    aligned_: Array
    variance_: float

    @checked(alignment=an_alignment)
    def __init__(
        self,
        space: MotionSpace,
        metric: RiemannianMetric | None = None,
        *,
        alignment: MotionDistance | None = None,
        n_iterations: int = 2,
        progress: bool = False,
    ) -> None:
        self.space = space
        self.metric = metric
        self.alignment = alignment
        self.n_iterations = n_iterations
        self.progress = progress

    def fit(self, X: Sequence[Motion], y: object = None) -> Self:
        """Compute the mean of motions.

        Parameters
        ----------
        X : sequence of motions
            Motions of any numbers of frames, of at least two each.
        y : object
            Ignored; scikit-learn passes it.
        """
        check_motions(X, "X")
        n_iterations = whole_number(self.n_iterations, "n_iterations", minimum=1)
        flag(self.progress, "progress")
        space = self.space
        alignment = self.alignment or _default_alignment(space)
        distances = np.asarray(alignment.dist_pairwise(X))
        reference: Motion = X[int(np.argmin(np.sum(distances**2, axis=0)))]
        even = np.linspace(0.0, 1.0, space.n_times)
        for _ in range(n_iterations):
            warps = [alignment.warp(reference, motion) for motion in X]
            times = np.stack([_even_times(warp, space.n_times) for warp in warps])
            # The times of the reference are replaced by the means of all.
            common = np.interp(even, times.mean(axis=0), even)
            times = np.stack([np.interp(common, even, row) for row in times])
            motions = [_at_shares(space, m, times[k], f"X[{k}]") for k, m in enumerate(X)]
            aligned = _facing_together(space, np.stack(motions))
            mean = self._means(aligned)
            reference = mean
        self.estimate_ = mean
        self.times_ = times
        self.aligned_ = aligned
        over_time = RateDependentMetric(space, self._metric)
        self.variance_ = float(np.mean([over_time.squared_dist(m, mean) for m in aligned]))
        return self

    @property
    def _metric(self) -> RiemannianMetric:
        return self.metric or ElasticMetric(self.space.frames, a=1.0, lam=1.0, c=1.0)

    def _means(self, aligned: Array) -> Array:
        """Return the Karcher mean of surfaces at every time."""
        solver, metric = NearestSurface(), self._metric
        areas = self.space.frames.template.vertex_areas
        means: list[Array] = []
        bar = tqdm(range(aligned.shape[1]), desc="Means", disable=not self.progress, unit="time")
        for t in bar:
            surfaces = aligned[:, t]
            # From a body that faces away, the search would end at the mean's reflection.
            mean = solver.solve(metric, metric.map(surfaces), surfaces[0]).point
            shift = np.average(surfaces.mean(axis=0) - mean, axis=0, weights=areas)
            means.append(mean + shift)
        return np.stack(means)


def _facing_together(space: MotionSpace, motions: Array) -> Array:
    """Rotate bodies in place, at every time, to the mean of the directions that they face."""
    areas = space.frames.template.vertex_areas
    angles = np.unwrap(angles_to(space.frames, motions, motions[0]), axis=1)
    places = np.average(motions, axis=2, weights=areas, keepdims=True)
    return rotate_upright(motions - places, angles - angles.mean(axis=0)) + places


class MotionComponents(Estimator):
    """Tangent principal component analysis of motions at their mean, after re-timing.

    The fields of the aligned motions are points of a product with one factor for every time, where
    exponential and logarithm have closed forms. Differences of timing are not in the components,
    but in ``mean.times_``.

    Parameters
    ----------
    mean : MotionMean
        Estimator of the mean, which also aligns motions with it.
    n_components : int, optional
        Number of components; by default as many as the motions span.

    Attributes
    ----------
    mean_ : array, shape (n_times, V, 3)
        The mean motion.
    scores_ : array, shape (n, n_components)
        Coordinates of the motions.
    explained_variance_, explained_variance_ratio_ : array, shape (n_components,)
        Variance along each component, and its share of the total.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[:3]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(knees[0].template), n_times=3)
    >>> mean = rh.motions.MotionMean(motions, n_iterations=1)
    >>> components = rh.motions.MotionComponents(mean, 1).fit([m[:30:6] for m in knees])
    >>> components.inverse_transform(components.scores_[:1]).shape
    (1, 3, 1202, 3)
    """

    mean_: Array
    scores_: Array
    explained_variance_: Array
    explained_variance_ratio_: Array

    def __init__(self, mean: MotionMean, n_components: int | None = None) -> None:
        self.mean = mean
        self.n_components = n_components

    def fit(self, X: Sequence[Motion], y: object = None) -> Self:
        """Compute the mean and the components.

        Parameters
        ----------
        X : sequence of motions
            Motions, at least two.
        y : object
            Ignored; scikit-learn passes it.
        """
        self.mean.fit(X)
        self.mean_ = self.mean.estimate_
        space = self.mean.space
        self._metric = self.mean._metric
        fields = ProductManifold([manifold_of(self._metric.target_metric)] * space.n_times)
        weights = RateDependentMetric(space, self._metric).time_weights
        fields.equip_with_metric(ProductMetric, weights=weights)
        images = np.stack([self._image(motion) for motion in self.mean.aligned_])
        self._pca = TangentPCA(fields, self.n_components, mean=self._image(self.mean_))
        self.scores_ = self._pca.fit_transform(images)
        self.explained_variance_ = self._pca.explained_variance_
        self.explained_variance_ratio_ = self._pca.explained_variance_ratio_
        return self

    def inverse_transform(self, X: Array) -> Array:
        """Return the motions with these coordinates: at every time, the nearest surface.

        Parameters
        ----------
        X : array, shape (n, m)
            Coordinates along the first m components; the others are 0.
        """
        scores = real_array(X, "X", ("n", "n_components"), batched=False)
        product = self._pca.space
        assert isinstance(product, ProductManifold)
        solver = NearestSurface()
        motions = np.empty((len(scores), *self.mean_.shape))
        for motion, images in zip(motions, self._pca.inverse_transform(scores), strict=True):
            for t, image in enumerate(product.project_from_product(images)):
                nearest = solver.solve(self._metric, image[np.newaxis], self.mean_[t])
                motion[t] = nearest.point
        return motions

    def _image(self, motion: Array) -> Array:
        return np.asarray(self._metric.map(motion)).reshape(-1)
