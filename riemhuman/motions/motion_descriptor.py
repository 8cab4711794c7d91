"""A row of numbers for each motion, without alignment: poses, their spread and speed, travel."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Self, TypeAlias

import numpy as np

from riemhuman.arrays import Array, ArrayLike
from riemhuman.checks import real_number, whole_number
from riemhuman.estimator import Estimator
from riemhuman.geometry import RiemannianMetric, VectorSpace
from riemhuman.kernels.projections import Projection
from riemhuman.motions._frames import (
    Motion,
    check_motions,
    face_forward,
    frame_count,
    frame_runs,
    sampled_rows,
)
from riemhuman.motions._travel import frame_rate, ground_places, surface_space, travel_speeds

# Smaller differences of speed, in units of √(g · leg length), are swaying on the spot (about 0.1
# metres per second).
_SWAYING = 0.03

Blocks: TypeAlias = tuple[Array, ...]
"""Averages over a motion, in arrays."""


class MotionDescriptor(Estimator):
    r"""Vectors that distinguish motions, for any person and any duration.

    With coordinates c of a frame, the principal components of `metric.lower_bound_coordinates`, a
    row holds the mean of c over time, its standard deviation, its mean speed :math:`|\dot c|`, and
    the mean and the deviation of the speed over the ground, in units of :math:`\sqrt{g\,l}` with
    the length l of the leg. Each of these four blocks is divided by its spread among the motions of
    `fit`, so that all have the same weight (the spread of travel is taken to be at least 0.03).
    Nothing is aligned in time, so the order of movements does not matter, and a walk of three steps
    is near a walk of seven.

    Rows are points of a Euclidean space with the metric `metric_`, from which `rh.LearnedMetric`
    can learn.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames with `lower_bound_coordinates`, such as `rh.RotationMetric`.
    n_components : int
        Largest number of coordinates of a frame.
    heading : bool
        Whether to include the direction in which bodies face, as for `DynamicTimeWarping`.
    travel_weight : float
        Weight of the block of travel relative to the others.
    frames_per_second : float, optional
        Frame rate of motions that are arrays; others have their own.

    Attributes
    ----------
    metric_ : RiemannianMetric
        Euclidean metric on rows, from `fit`.
    n_features_out_ : int

    Examples
    --------
    >>> motions = rh.datasets.load_open_motions("coarse", sequences="knees")[:3]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(motions[0].template), a=0.0, lam=0.0, c=1.0)
    >>> descriptor = rh.motions.MotionDescriptor(pose, n_components=5, frames_per_second=15.0)
    >>> descriptor.fit_transform([motion[:40:4] for motion in motions]).shape
    (3, 20)
    """

    metric_: RiemannianMetric
    n_features_out_: int

    def __init__(
        self,
        metric: RiemannianMetric,
        *,
        n_components: int = 100,
        heading: bool = False,
        travel_weight: float = 1.0,
        frames_per_second: float | None = None,
    ) -> None:
        self.metric = metric
        self.n_components = n_components
        self.heading = heading
        self.travel_weight = travel_weight
        self.frames_per_second = frames_per_second

    def fit(self, motions: Sequence[Motion], y: ArrayLike | None = None) -> Self:
        """Find the coordinates of frames, and the spread of each block.

        Parameters
        ----------
        motions : sequence of motions
            Arrays (n_frames, V, 3), or motions of `riemhuman.datasets`, of at least two frames.
        y : ignored
            As scikit-learn asks.
        """
        self._fit(motions)
        return self

    def fit_transform(self, motions: Sequence[Motion], y: ArrayLike | None = None) -> Array:
        """Fit, and return the rows of the same motions, shape (n, p).

        Parameters
        ----------
        motions, y
            As for `fit`.
        """
        return self._rows(self._fit(motions))

    def transform(self, motions: Sequence[Motion]) -> Array:
        """Return a row for each motion, shape (n, p).

        Parameters
        ----------
        motions : sequence of motions
        """
        self._require_fit("metric_")
        check_motions(motions)
        return self._rows(self._summaries(motions))

    def _fit(self, motions: Sequence[Motion]) -> list[Blocks]:
        check_motions(motions)
        n_components = whole_number(self.n_components, "n_components", minimum=1)
        weight = real_number(self.travel_weight, "travel_weight", minimum=0.0)
        self._projection = Projection.fit(
            sampled_rows(motions, lambda motion, name: self._coordinates(motion, name)[0]),
            n_components,
        )
        summaries = self._summaries(motions)
        self._scales: list[float] = []
        for blocks in zip(*summaries, strict=True):
            spread = float(np.sqrt(np.sum(np.var(np.stack(blocks), axis=0))))
            self._scales.append(1.0 / spread if spread > 0.0 else 0.0)
        # The last block is that of travel.
        self._scales[-1] = weight * min(self._scales[-1], 1.0 / _SWAYING)
        self.n_features_out_ = sum(len(block) for block in summaries[0])
        self.metric_ = VectorSpace((self.n_features_out_,)).metric
        return summaries

    def _rows(self, summaries: list[Blocks]) -> Array:
        rows = []
        for blocks in summaries:
            scaled = zip(blocks, self._scales, strict=True)
            rows.append(np.concatenate([scale * block for block, scale in scaled]))
        return np.stack(rows)

    def _summaries(self, motions: Sequence[Motion]) -> list[Blocks]:
        return [self._summary(motion, f"motions[{k}]") for k, motion in enumerate(motions)]

    def _coordinates(self, motion: Motion, name: str) -> tuple[Array, Array]:
        """Return lower-bound coordinates of all frames, and places on the ground."""
        space = surface_space(self.metric.space)
        rows, places = [], []
        for run in frame_runs(space, motion, name):
            places.append(ground_places(space, run))
            turned = run if self.heading else face_forward(space, run)
            rows.append(self.metric.lower_bound_coordinates(turned))
        return np.concatenate(rows), np.concatenate(places)

    def _summary(self, motion: Motion, name: str) -> Blocks:
        """Return means, deviations and speeds of the coordinates, and of travel."""
        frame_count(motion, name, 2)
        rate = frame_rate(motion, self.frames_per_second, name)
        coordinates, places = self._coordinates(motion, name)
        points = self._projection(coordinates)
        speeds = travel_speeds(surface_space(self.metric.space), places, rate)
        steps = rate * np.abs(np.diff(points, axis=0)).mean(axis=0)
        travel = np.array([speeds.mean(), speeds.std()])
        return points.mean(axis=0), points.std(axis=0), steps, travel
