"""Karcher means of more points than memory holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import was_interrupted
from riemhuman.solvers.basis_mean import BasisMean
from riemhuman.solvers.dispersion import StreamedDispersion, check_weights
from riemhuman.solvers.results import MeanResult
from riemhuman.solvers.sound_means import seeing_lengths

# The mean of the sample is only a start.
_SAMPLE_TOLERANCE = 1e-4


@dataclass(frozen=True)
class StreamingMean(BasisMean):
    r"""`BasisMean` of points that are read batch by batch, such as those of an array in a file.

    The mean of a sample, evenly spaced among the points, is the start; from there all points are
    read once an evaluation of the variance. The result is the mean over the basis, and over the
    differences of the sample from its mean; its variance exceeds the least by a few times
    `tolerance`, as a share, so that it is about √tolerance standard deviations off.

    Parameters
    ----------
    basis : DeformationBasis, optional
        Deformations D_j; without them, the differences of the sample alone.
    start : str
        Where the mean of the sample is sought from, as in `BasisMean`.
    with_differences : bool
        Whether the differences of the sample from its mean join the basis.
    companion_weight : float
        Weight of lengths beside an elastic metric of normals alone, as in `BasisMean`.
    tolerance : float
        Stop when a Newton step would gain at most this share of the variance, as far as the
        preconditioned gradient tells.
    max_iter : int
        Most iterations.
    callback : callable, optional
        Called with (iteration, variance, point) after each iteration.
    progress : bool
        Whether to show a progress bar.
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
        metric : RiemannianMetric
            The metric.
        points : sequence, shape (n, \*shape)
            An array, which may be mapped from a file, or any object with a length whose slices are
            points.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.
        initial_point : array, shape (\*shape,), optional
            Where the mean of the sample is sought from, instead of what `start` says.

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
        if not len(points):
            raise ArgumentError("points must hold at least one point; found none")
        weights = check_weights(weights, len(points))
        used = np.flatnonzero(weights)
        spaced = np.linspace(0, len(used) - 1, min(self.sample_size, len(used)))
        chosen = used[spaced.astype(int)]
        sample = np.concatenate([np.asarray(points[i : i + 1]) for i in chosen])
        first = BasisMean(
            self.basis,
            start=self.start,
            with_differences=self.with_differences,
            companion_weight=0.0,
            tolerance=max(self.tolerance, _SAMPLE_TOLERANCE),
            max_iter=self.max_iter,
        ).solve(searched, sample, weights[chosen], initial_point)
        if was_interrupted(first):
            return first

        def dispersion(of: RiemannianMetric) -> StreamedDispersion:
            return StreamedDispersion(of, points, weights, self.batch_size, sample)

        streamed = dispersion(searched)
        alone = streamed if searched is metric else dispersion(metric)
        return self._result(streamed, alone, first.point)
