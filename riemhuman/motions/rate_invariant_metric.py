"""A metric of motions that re-timing does not change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from riemhuman.arrays import Array
from riemhuman.checks import checked, instance
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.projections import Projection
from riemhuman.motions._frames import Motion, frame_count, frame_runs, sampled_rows
from riemhuman.motions._velocity_curves import TransportedVelocities, best_matching, even_segments
from riemhuman.motions.motion_space import MotionSpace, frame_metric
from riemhuman.motions.time_warping import MotionDistance, Warp

# Number of chords that represent a motion.
_N_CHORDS = 60
# Number of steps of the re-timing within a pair of chords.
_N_STEPS = 8
# Standard deviation of the Gaussian mean along a curve, as a share of its length.
_SMOOTHING = 0.03


@dataclass(frozen=True)
class _Curve:
    """A polygon of n velocities."""

    directions: Array  # (n, p), each divided by the square root of its length
    length: float  # of the polygon
    places: Array  # (n + 1,) where velocities begin and end, in frames


class RateInvariantMetric(MotionDistance):
    r"""The distance of transported square root velocities after the best re-timing.

    .. math:: \begin{split} d(m_1, m_2)^2 = &\ d(m_1(0), m_2(0))^2 \\
              & + \min_\gamma \int_0^1 |q_1 - (q_2 \circ \gamma)\sqrt{\dot\gamma}|^2\, dt, \\
              q = &\ v / \sqrt{|v|} \end{split}

    where v is the velocity of Φ(m(t)), transported along geodesics to the fields of the template
    (Su, Kurtek, Klassen and Srivastava, Annals of Applied Statistics 8, 2014). All q lie in one
    Euclidean space, where re-timing acts by isometries: d is a metric on motions modulo re-timing.
    The transported velocities add up to a curve, a cubic spline of the frames, of which 60 chords
    of equal arcs are compared, after a Gaussian mean along it that removes movements shorter than a
    thirtieth of its length, such as noise and triangles that flip in the crease of a joint. Between
    frames that are far apart, a spline is far from the motion, so compare motions with few frames
    by `VelocityTimeWarping`.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    metric : RiemannianMetric, optional
        Metric on frames, such as `ElasticMetric`, `RotationMetric` or `SRNFMetric`; by default that
        of their space.
    heading : bool
        As for `DynamicTimeWarping`.
    n_components : int, optional
        Number of principal components of velocities that `dist_pairwise` compares; by default
        velocities are compared in full. The part outside the components counts by its norm, so
        distances never increase.
    n_jobs : int, optional
        As for `DynamicTimeWarping`.

    Examples
    --------
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> metric = rh.motions.RateInvariantMetric(rh.motions.MotionSpace(space))
    >>> bool(metric.dist(knees[:40], knees[:40:2]) < metric.dist(knees[:40], other[:40:2]))
    True
    """

    @checked(space=instance(MotionSpace, "a MotionSpace(...), whose frames have the metric"))
    def __init__(
        self,
        space: MotionSpace,
        metric: RiemannianMetric | None = None,
        *,
        heading: bool = False,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        metric = frame_metric(space, metric)
        super().__init__(metric, heading=heading, n_components=n_components, n_jobs=n_jobs)
        self.space = space
        self._velocities = TransportedVelocities(
            self.metric, space.frames.template.vertices, heading=heading
        )

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        retimed = super().warp(m1, m2)
        apart = self.metric.dist(self._start(m1, "m1"), self._start(m2, "m2"))
        return replace(retimed, dist=math.hypot(retimed.dist, apart))

    def dist_pairwise(self, motions: Sequence[Motion], *, progress: bool = False) -> Array:
        retimed = super().dist_pairwise(motions, progress=progress)
        starts = np.stack([self._start(m, f"motions[{k}]") for k, m in enumerate(motions)])
        apart = self.metric.dist_pairwise(starts, self.n_jobs, precision="double")
        return np.hypot(retimed, apart)

    def _start(self, motion: Motion, name: str) -> Array:
        start: Array = next(frame_runs(self.space.frames, motion[:1], name, self.heading))[0]
        return start

    def _basis(self, motions: Sequence[Motion] = ()) -> Projection | None:
        """Return the projection to principal components of a sample of velocities."""
        if self.n_components is None or not len(motions):
            return None
        sample = sampled_rows(motions, self._velocities.segments, 2)
        # With its mirror image the sample has mean 0: the projection is linear.
        return Projection.fit(np.concatenate([sample, -sample]), self.n_components)

    def _prepare(self, basis: Projection | None, motion: Motion, name: str) -> _Curve:
        frame_count(motion, name, 2)
        sides = self._velocities.segments(motion, name)
        segments, places = even_segments(sides, _N_CHORDS, _SMOOTHING)
        lengths = np.sqrt(np.einsum("ij,ij->i", segments, segments))
        directions = segments / np.sqrt(np.where(lengths > 0.0, lengths, 1.0))[:, None]
        if basis is not None:
            directions = basis(directions)
        return _Curve(directions, float(lengths.sum()), places)

    def _match(self, basis: Projection | None, a: _Curve, b: _Curve) -> Warp:
        """Return the best re-timing, and the distance of the velocities after it."""
        products = a.directions @ b.directions.T
        gain, matches = best_matching(products, _N_STEPS)
        corners = np.arange(_N_CHORDS + 1)
        first = np.interp(matches[:, 0], corners, a.places)
        second = np.interp(matches[:, 1], corners, b.places)
        return Warp(math.sqrt(max(a.length + b.length - 2.0 * gain, 0.0)), first, second)
