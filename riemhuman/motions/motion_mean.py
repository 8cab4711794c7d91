"""The Karcher mean of motions modulo re-timing."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Self

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.estimator import Estimator
from riemhuman.geometry import ElasticMetric
from riemhuman.motions.alignment import Alignment, at_times, default_alignment, even_times
from riemhuman.motions.frames import Motion, several_motions
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.rate_dependent_metric import RateDependentMetric
from riemhuman.progress import ProgressBar
from riemhuman.protocols import uninterrupted
from riemhuman.solvers.nearest_surface import NearestSurface


class MotionMean(Estimator):
    r"""The Karcher mean of motions modulo re-timing, in the L² metric.

    .. math:: \min_m \sum_k \min_{\gamma_k} \int_0^1 d(m(t), m_k(\gamma_k(t)))^2\, dt

    Motions are aligned with the one that is nearest to all others. The mean is then the Karcher
    mean of the surfaces at every time, over all vertices; motions are aligned with it, and it is
    taken again. Its clock is the mean of theirs.

    Parameters
    ----------
    space : MotionSpace
        Space of motions; the mean has its number of times.
    metric : RiemannianMetric, optional
        Metric of the means of surfaces. By default ``ElasticMetric(a=1, lam=1, c=1)``, which sees
        shape and pose.
    alignment : Alignment, optional
        Alignment of motions, such as `RateInvariantMetric`; by default `DynamicTimeWarping` of
        changes, under the metric of the frames.
    nearest : NearestSurface, optional
        Solver for the mean of surfaces.
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
        The motions at these times.
    variance_ : float
        Mean over motions and time of the squared distance to the mean.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees[0].template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> motions = rh.motions.MotionSpace(space, n_times=4)
    >>> mean = rh.motions.MotionMean(motions).fit([motion[:40:8] for motion in knees])
    >>> mean.estimate_.shape
    (4, 1202, 3)
    """

    estimate_: ndarray
    times_: ndarray
    aligned_: ndarray
    variance_: float

    def __init__(
        self,
        space: MotionSpace,
        metric: Any = None,
        *,
        alignment: Alignment | None = None,
        nearest: NearestSurface | None = None,
        n_iterations: int = 2,
        progress: bool = False,
    ) -> None:
        self.space = space
        self.metric = metric
        self.alignment = alignment
        self.nearest = nearest
        self.n_iterations = n_iterations
        self.progress = progress

    def fit(self, X: Sequence[Motion], y: object = None) -> Self:
        """Find the mean of motions.

        Parameters
        ----------
        X : sequence of motions
            Motions of any numbers of frames, of at least two each.
        y : object
            Not used.

        Returns
        -------
        MotionMean
            The estimator itself.

        Raises
        ------
        ArgumentError
            If a motion or a parameter is wrong.
        """
        motions = several_motions(X, "X")
        n_iterations = whole_number(self.n_iterations, "n_iterations", minimum=1)
        space, n_times = self.space, self.space.n_times
        metric: Any = self.metric or elastic_metric(space)
        alignment = self.alignment or default_alignment(space)
        distances = np.asarray(alignment.dist_pairwise(motions))
        reference: Motion = motions[int(np.argmin(np.sum(distances**2, axis=0)))]
        for _ in range(n_iterations):
            times = np.stack(
                [even_times(alignment.warp(reference, motion), n_times) for motion in motions]
            )
            # The clock of the reference gives way to the mean of all.
            even = np.linspace(0.0, 1.0, n_times)
            clock = np.interp(even, times.mean(axis=0), even)
            times = np.stack([np.interp(clock, even, row) for row in times])
            aligned = np.stack(
                [
                    at_times(space, motion, row, f"X[{k}]")
                    for k, (motion, row) in enumerate(zip(motions, times, strict=True))
                ]
            )
            reference = mean = self._means(metric, aligned)
        self.estimate_, self.times_, self.aligned_ = mean, times, aligned
        over_time = RateDependentMetric(space, metric)
        self.variance_ = float(np.mean([over_time.squared_dist(m, mean) for m in aligned]))
        return self

    def _means(self, metric: Any, aligned: ndarray) -> ndarray:
        """Return the Karcher mean of surfaces at every time, each found from the one before."""
        solver = self.nearest or NearestSurface()
        means: list[ndarray] = []
        bar = ProgressBar(
            range(aligned.shape[1]), desc="Means", disable=not self.progress, unit="time"
        )
        for t in bar:
            surfaces = aligned[:, t]
            start = means[-1] if means else surfaces[0]
            found = uninterrupted(solver.solve(metric, metric.map(surfaces), start)).point
            areas = self.space.frames.template.vertex_areas
            shift = np.average(surfaces.mean(axis=0) - found, axis=0, weights=areas)
            means.append(found + shift)
        return np.stack(means)


def elastic_metric(space: MotionSpace) -> ElasticMetric:
    """Return the default metric for means, which sees shape and pose.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.

    Returns
    -------
    ElasticMetric
    """
    return ElasticMetric(space.frames, a=1.0, lam=1.0, c=1.0)
