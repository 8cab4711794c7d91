"""A distance of motions that is invariant to re-timing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import metric_weight, real_array, real_number, whole_number
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.pairwise import MEMORY, Bulk, Points
from riemhuman.kernels.projections import Projection
from riemhuman.kernels.threads import for_each
from riemhuman.motions.even_segments import even_segments
from riemhuman.motions.frames import Motion, n_frames_of, several_motions, whole_motion
from riemhuman.motions.motion_space import MotionSpace
from riemhuman.motions.time_warping import all_pairs
from riemhuman.motions.transported_velocities import TransportedVelocities
from riemhuman.motions.velocity_kernels import best_gain, trace_gain
from riemhuman.motions.warp import Warp
from riemhuman.terms.sum import Features

# Velocities whose principal components stand for those of all.
_MOST_SAMPLED = 600


@dataclass(frozen=True)
class Curve:
    """A motion, prepared for the rate-invariant distance.

    Attributes
    ----------
    start : array, shape (V, 3)
        The first frame.
    directions : array, shape (n_segments, p)
        Transported velocities, each divided by the square root of its length; 0 where that is 0.
    length : float
        Sum of the lengths.
    places : array, shape (n_segments + 1,)
        Positions where the velocities begin and end, in frames.
    """

    start: ndarray
    directions: ndarray
    length: float
    places: ndarray


class RateInvariantMetric(RiemannianMetric):
    r"""The distance of transported square root velocities after the best re-timing.

    .. math:: d(m_1, m_2)^2 = w\, d(m_1(0), m_2(0))^2
              + \min_\gamma \int_0^1 |q_1 - (q_2 \circ \gamma)\sqrt{\dot\gamma}|^2\, dt,
              \qquad q = v / \sqrt{|v|}

    where v is the velocity of Φ(m(t)), transported along geodesics to the fields of one reference
    surface; see `riemhuman.motions.transported_velocities`. As the reference is the same for all,
    all q lie in one Euclidean space, where re-timing acts by isometries: d is a metric on motions
    modulo re-timing. The transported velocities of a motion add up to a curve, a cubic spline of
    the frames; it is averaged along its length, as `smoothing` says, and chords of equal arcs are
    compared; the re-timing of these polygons is found to `n_steps`. All of this is done to each
    motion by itself, so that the triangle inequality holds. No spline knows what happens between
    frames that are far apart: motions of few frames are better compared by `VelocityTimeWarping`,
    which is not a metric. The pose in which a motion begins counts by the weight w alone; without
    it, two motions that change alike in different poses would be one.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    metric : RiemannianMetric, optional
        Metric on frames, such as `ElasticMetric`, `RotationMetric` or `SRNFMetric`; by default that
        of their space.
    reference : array, shape (V, 3), optional
        The reference surface, by default the template.
    start_weight : float
        w, at least 0.
    n_segments : int
        Number of chords that stand for a motion. More chords tell finer movements apart, and need
        more frames.
    smoothing : float
        Standard deviation of the Gaussian mean along the curve, as a share of its length. It takes
        off shorter movements, such as noise and triangles that flip in the crease of a joint. At 0
        nothing is taken off.
    n_steps : int
        Grid steps of the re-timing within each pair of segments.
    n_components : int, optional
        Number of principal components of velocities that `dist_pairwise` compares; by default
        velocities are compared in full. The part outside the components counts by its norm, so that
        no distance grows.

    Raises
    ------
    NotDefinedError
        If the metric on frames has no log and transport in closed form.
    ArgumentError
        If a parameter is out of its range.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> metric = rh.motions.RateInvariantMetric(rh.motions.MotionSpace(space))
    >>> slow, fast = knees[:40], knees[:40:2]
    >>> bool(metric.dist(slow, fast) < metric.dist(slow, other[:40:2]))
    True
    """

    space: MotionSpace

    def __init__(
        self,
        space: MotionSpace,
        metric: Any = None,
        reference: ndarray | None = None,
        *,
        start_weight: float = 1.0,
        n_segments: int = 60,
        smoothing: float = 0.03,
        n_steps: int = 8,
        n_components: int | None = None,
    ) -> None:
        super().__init__(space)
        self.metric: Any = space.frames.metric if metric is None else metric
        template = space.frames.template
        self.reference = template.vertices
        if reference is not None:
            surface = real_array(reference, "reference", space.frames.shape, batched=False)
            self.reference = space.frames.check_immersed(surface, "reference")
        self.start_weight = metric_weight(start_weight, "start_weight")
        self.n_segments = whole_number(n_segments, "n_segments", minimum=1)
        self.smoothing = real_number(smoothing, "smoothing", minimum=0.0)
        self.n_steps = whole_number(n_steps, "n_steps", minimum=1)
        self.n_components = n_components
        if n_components is not None:
            whole_number(n_components, "n_components", minimum=1)
        self._velocities = TransportedVelocities(self.metric, self.reference)

    def dist(self, point_a: Motion, point_b: Motion) -> ndarray:
        """Return the distance of motions.

        Parameters
        ----------
        point_a, point_b : array or sequence, shape (..., n_times, V, 3)
            Motions: one each, of any numbers of frames, or several that broadcast.

        Raises
        ------
        ArgumentError
            If a frame is wrong.
        OutsideManifoldError
            If the fields of a frame have no unique geodesic to those of the next or of the
            reference.
        """
        return np.sqrt(self.squared_dist(point_a, point_b))

    def squared_dist(self, point_a: Motion, point_b: Motion) -> ndarray:
        """Return the squared distance of motions.

        Parameters
        ----------
        point_a, point_b : array or sequence, shape (..., n_times, V, 3)
            Motions: one each, of any numbers of frames, or several that broadcast.
        """
        if np.ndim(point_a[:1]) == np.ndim(point_b[:1]) == 3:
            one, other = (
                self._curve(point_a, "point_a"),
                self._curve(point_b, "point_b"),
            )
            return np.asarray(self._squared(one, other))
        return self._one_by_one(
            self.squared_dist,
            self.space.check_point(point_a, "point_a"),
            self.space.check_point(point_b, "point_b"),
        )

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        """Return the best re-timing: which time of one motion corresponds to which of the other.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.

        Returns
        -------
        Warp
        """
        one, other = self._curve(m1, "m1"), self._curve(m2, "m2")
        products = one.directions @ other.directions.T
        lower, left = _gains(products.shape, self.n_steps)
        best_gain(products, self.n_steps, lower, left)
        path = np.empty((sum(products.shape) + 2, 2))
        length = trace_gain(products, self.n_steps, lower, left, path)
        matched = path[:length][::-1].T
        corners = np.arange(self.n_segments + 1)
        first, second = (
            np.interp(each, corners, curve.places)
            for each, curve in zip(matched, (one, other), strict=True)
        )
        return Warp(math.sqrt(self._squared(one, other)), first, second)

    def dist_pairwise(
        self,
        points: Points,
        n_jobs: int | None = None,
        *,
        precision: str = "double",
        memory: int = MEMORY,
        progress: bool = False,
    ) -> ndarray:
        """Return all distances within a set of motions, whose numbers of frames may differ.

        Parameters
        ----------
        points : sequence of motions
            Motions of at least two frames each.
        precision : {"double"}
            Not used: velocities are kept and compared in double precision.
        memory : int
            Not used: the velocities of all motions are kept.

        Raises
        ------
        ArgumentError
            If a motion is wrong.
        """
        motions = several_motions(points, "points")
        projection = self._projection(motions)
        curves = [
            self._curve(motion, f"points[{k}]", projection) for k, motion in enumerate(motions)
        ]

        def dist(one: Curve, other: Curve) -> float:
            return math.sqrt(self._turned(one, other))

        retimed = all_pairs(dist, curves, n_jobs, progress)
        starts = self.metric.dist_pairwise(
            np.stack([curve.start for curve in curves]), n_jobs, precision="double"
        )
        return np.sqrt(retimed**2 + self.start_weight * starts**2)

    @property
    def bulk(self) -> Bulk:
        """Features are first frames, directions, lengths and places of curves."""
        return _OfCurves(self)

    def _curve(self, motion: Motion, name: str, projection: Projection | None = None) -> Curve:
        n_frames_of(motion, name, 2)
        sides = self._velocities.segments(motion, name)
        segments, places = even_segments(sides, self.n_segments, self.smoothing)
        lengths = np.sqrt(np.einsum("ij,ij->i", segments, segments))
        directions = segments / np.sqrt(np.where(lengths > 0.0, lengths, 1.0))[:, None]
        if projection is not None:
            directions = projection(directions)
        start = whole_motion(self.space.frames, motion[:1], name)[0]
        return Curve(start, directions, float(lengths.sum()), places)

    def _projection(self, motions: Sequence[Motion]) -> Projection | None:
        """Return the projection to principal components of velocities, of one frame in so many."""
        if self.n_components is None:
            return None
        step = -(-sum(len(motion) for motion in motions) // _MOST_SAMPLED)
        sample = np.concatenate(
            [
                self._velocities.segments(motion[k : k + 2], f"points[{i}][{k}:{k + 2}]")
                for i, motion in enumerate(motions)
                for k in range(0, len(motion) - 1, step)
            ]
        )
        # With its mirror image the sample has mean 0: the projection is linear.
        return Projection.fit(np.concatenate([sample, -sample]), self.n_components)

    def _squared(self, one: Curve, other: Curve) -> float:
        start = self.metric.squared_dist(one.start, other.start) if self.start_weight else 0.0
        return self._turned(one, other) + self.start_weight * float(start)

    def _turned(self, one: Curve, other: Curve) -> float:
        """Return the squared distance of the velocities after the best re-timing."""
        products = one.directions @ other.directions.T
        gain = best_gain(products, self.n_steps, *_gains(products.shape, self.n_steps))
        return max(one.length + other.length - 2.0 * gain, 0.0)


class _OfCurves(Bulk):
    """First frames, directions, lengths and places, compared pair by pair."""

    n_arrays = 4

    def __init__(self, metric: RateInvariantMetric) -> None:
        self._metric = metric

    def features(self, points: ndarray, precision: str) -> Features:
        curves = [self._metric._curve(motion, f"points[{k}]") for k, motion in enumerate(points)]
        names = ("start", "directions", "length", "places")
        return tuple(np.array([getattr(curve, name) for curve in curves]) for name in names)

    def rounding(self, features: Features) -> ndarray:
        return np.zeros(len(features[0]))

    def squared_distances(self, a: Features, b: Features, n_threads: int = 1) -> ndarray:
        rows, columns = ([Curve(*arrays) for arrays in zip(*each, strict=True)] for each in (a, b))
        squared = np.zeros((len(rows), len(columns)))

        def fill_row(i: int) -> None:
            for j in range(i + 1 if a is b else 0, len(columns)):
                squared[i, j] = self._metric._squared(rows[i], columns[j])
                if a is b:
                    squared[j, i] = squared[i, j]

        for_each(fill_row, range(len(squared)), n_threads)
        return squared


def _gains(shape: tuple[int, ...], n_steps: int) -> tuple[ndarray, ndarray]:
    n, m = shape
    return np.empty((n + 1, m, n_steps + 1)), np.empty((n, m + 1, n_steps + 1))
