"""Karcher means and geometric medians of more points than memory holds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import was_interrupted
from riemhuman.solvers.basis_mean import BasisMean
from riemhuman.solvers.dispersion import (
    Dispersion,
    MeanDistance,
    StreamedDispersion,
    check_weights,
)
from riemhuman.solvers.results import MeanResult
from riemhuman.solvers.sound_means import seeing_lengths

# The mean of the sample is only a start.
_SAMPLE_TOLERANCE = 1e-4

# Standard deviations by which distances are smoothed near 0.
_SMOOTHING = 1e-6


@dataclass(frozen=True)
class StreamingMean(BasisMean):
    r"""`BasisMean` for points that are read batch by batch, such as an array in a file.

    The search starts from the mean of a sample, evenly spaced among the points; then every
    evaluation of the variance reads all points once. The result is the mean over the basis and the
    differences of the sample from its mean. Its variance exceeds the minimum by a few times
    `tolerance`, as a share, so that the mean is about √tolerance standard deviations off.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations D_j; without them, the differences of the sample alone.
    start : str
        Start of the search for the mean of the sample, as in `BasisMean`.
    with_differences : bool
        Whether to add the differences of the sample from its mean to the basis.
    tolerance : float
        Stop when a Newton step would gain at most this share of what is minimised, the variance or
        the mean distance, as far as the preconditioned gradient tells.
    callback : callable, optional
        Called with (iteration, what is minimised, point) after each iteration.
    sample_size : int
        Number of points in the sample.
    batch_size : int
        Points that are read together.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> solver = rh.solvers.StreamingMean(sample_size=4, batch_size=5)
    >>> result = solver.solve(metric, bodies.points[:12])
    >>> result.point.shape, result.converged
    ((1202, 3), True)
    """

    tolerance: float = 1e-7
    sample_size: int = 64
    batch_size: int = 256

    def __post_init__(self) -> None:
        super().__post_init__()
        whole_number(self.sample_size, "sample_size", minimum=1)
        whole_number(self.batch_size, "batch_size", minimum=1)

    def solve(
        self,
        metric: RiemannianMetric,
        points: Any,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the mean.

        Parameters
        ----------
        points : sequence, shape (n, \*shape)
            An array, which may be mapped from a file, or any object with a length whose slices are
            points.
        initial_point : array, shape (\*shape,), optional
            Start of the search for the mean of the sample, instead of `start`.

        Returns
        -------
        MeanResult
            `variance` is by the metric alone; `variances` are with the companion's share.

        Raises
        ------
        ArgumentError
            If the points, weights or basis do not fit the metric's space.
        DegenerateSurfaceError
            If triangles of the mean shrink away, as between unlike bodies for a small λ.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        UnseenLengthsWarning
            If neither the metric nor a companion sees how long edges are.
        """
        searched = seeing_lengths(metric, self.companion_weight)
        sample = _Sample(points, weights, self.sample_size)
        first = self._of_sample(searched, sample, initial_point)
        if was_interrupted(first):
            return first
        streamed = self._streamed(searched, sample, Dispersion)
        alone = streamed if searched is metric else self._streamed(metric, sample, Dispersion)
        return self._result(streamed, alone, first.point)

    def _of_sample(
        self, metric: RiemannianMetric, sample: _Sample, initial_point: ndarray | None
    ) -> MeanResult:
        """Return the mean of the sample alone, roughly."""
        mean = BasisMean(
            self.basis,
            start=self.start,
            with_differences=self.with_differences,
            companion_weight=0.0,
            tolerance=max(self.tolerance, _SAMPLE_TOLERANCE),
            max_iter=self.max_iter,
        )
        return mean.solve(metric, sample.points, sample.weights, initial_point)

    def _streamed(
        self, metric: RiemannianMetric, sample: _Sample, of_batch: Callable[..., Dispersion]
    ) -> StreamedDispersion:
        return StreamedDispersion(
            metric, sample.all, sample.all_weights, self.batch_size, sample.points, of_batch
        )


@dataclass(frozen=True)
class StreamingMedian(StreamingMean):
    r"""The point x̄ = x₀ + Σ_j β_j D_j of least weighted mean distance Σ_i w_i d(x_i, x̄).

    As in `StreamingMean`, points are read batch by batch. The search goes from the mean of a sample
    to the median of the sample; then every evaluation reads all points once. The result is the
    median over the basis and the differences of the sample from its mean. Its mean distance exceeds
    the minimum by a few times `tolerance`, as a share, and by at most another millionth, since
    distances are smoothed where they have no gradient.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=1.0, lam=1.0, c=0.1)
    >>> solver = rh.solvers.StreamingMedian(sample_size=4, batch_size=5)
    >>> median = rh.statistics.GeometricMedian(space, solver=solver).fit(bodies.points[:12])
    >>> median.estimate_.shape
    (1202, 3)
    """

    def solve(
        self,
        metric: RiemannianMetric,
        points: Any,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> MeanResult:
        r"""Find the median.

        Returns
        -------
        MeanResult
            `variance` is the weighted mean of squared distances, by the metric alone; `variances`
            are weighted mean distances and include the companion metric.

        Raises
        ------
        ArgumentError
            If the points, weights or basis do not fit the metric's space.
        DegenerateSurfaceError
            If triangles of the median vanish, as between dissimilar bodies for a small λ.

        Warns
        -----
        ConvergenceWarning
            If the stopping test was not met.
        UnseenLengthsWarning
            If neither the metric nor a companion sees how long edges are.
        """
        searched = seeing_lengths(metric, self.companion_weight)
        sample = _Sample(points, weights, self.sample_size)
        first = self._of_sample(searched, sample, initial_point)
        if was_interrupted(first) or first.variance == 0.0:
            return first
        mean_distance = partial(MeanDistance, smoothing=_SMOOTHING * np.sqrt(first.variance))
        nearer = replace(self, tolerance=_SAMPLE_TOLERANCE, callback=None)._result(
            mean_distance(searched, sample.points, sample.weights),
            Dispersion(searched, sample.points, sample.weights),
            first.point,
        )
        if was_interrupted(nearer):
            return nearer
        streamed = self._streamed(searched, sample, mean_distance)
        alone = self._streamed(metric, sample, Dispersion)
        return self._result(streamed, alone, nearer.point)


class _Sample:
    """Points, and some of them, evenly spaced among those that have a weight."""

    def __init__(self, points: Any, weights: ndarray | None, size: int) -> None:
        if not len(points):
            raise ArgumentError("points must hold at least one point; found none")
        self.all, self.all_weights = points, check_weights(weights, len(points))
        used = np.flatnonzero(self.all_weights)
        spaced = np.linspace(0, len(used) - 1, min(size, len(used)))
        chosen = used[spaced.astype(int)]
        self.points = np.concatenate([np.asarray(points[i : i + 1]) for i in chosen])
        self.weights = self.all_weights[chosen]
