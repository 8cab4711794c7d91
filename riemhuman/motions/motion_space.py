"""The space of motions, curves of surfaces given by frames, and its L² metric."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from riemhuman.arrays import Array, ArrayLike, Booleans
from riemhuman.checks import Rng, checked, flag, generator, instance, real_array, whole
from riemhuman.errors import ArgumentError
from riemhuman.geometry import Manifold, RiemannianMetric
from riemhuman.geometry.manifold import SurfaceSpace, metric_of, sample_count, stack_samples
from riemhuman.geometry.metric import check_metric
from riemhuman.geometry.pairwise import Bulk, Factor, SumOfFactors
from riemhuman.geometry.strategies import GeodesicSolver
from riemhuman.motions._frames import (
    Motion,
    frame_count,
    read_motion,
    surfaces_between,
)

if TYPE_CHECKING:
    from riemhuman.geometry import AlignedSurfaces


class MotionSpace(Manifold):
    """Curves of surfaces, each a point of shape (n_times, V, 3).

    Distances such as `DynamicTimeWarping` also accept other numbers of frames; `resample` gives all
    motions the same number.

    Parameters
    ----------
    frames : AlignedSurfaces
        Space of the frames, with the metric that compares frames.
    n_times : int
        Number of equally spaced times of a point.
    equip : bool
        Whether to equip the space with `RateDependentMetric`.

    Examples
    --------
    >>> motion = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(motion.template), n_times=5)
    >>> motions.resample(motion[:40]).shape
    (5, 1202, 3)
    """

    @checked(
        frames=instance(SurfaceSpace, "a space of surfaces, such as AlignedSurfaces(template)"),
        n_times=whole(minimum=2),
        equip=flag,
    )
    def __init__(self, frames: AlignedSurfaces, n_times: int = 50, equip: bool = True) -> None:
        self.frames = frames
        self.n_times = n_times
        super().__init__(n_times * frames.dim, (n_times, *frames.shape), equip)

    def default_metric(self) -> type[RiemannianMetric]:
        return RateDependentMetric

    def belongs(self, point: Array, atol: float = 1e-9) -> Booleans:
        point, _ = self._candidates(point, "point")
        belong: Booleans = np.all(self.frames.belongs(point, atol), axis=-1)
        return belong

    def to_tangent(self, vector: Array, base_point: Array | None = None) -> Array:
        return real_array(vector, "vector", self.shape)

    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        n_samples, rng = sample_count(n_samples), generator(rng)
        ends = self.frames.random_point(2 * n_samples, bound, rng)
        start, end = ends[:n_samples, None], ends[n_samples:, None]
        times = np.linspace(0.0, 1.0, self.n_times)[:, None, None]
        return stack_samples((1.0 - times) * start + times * end, n_samples)

    def check_point(self, point: object, name: str = "point") -> Array:
        return self.frames.check_point(real_array(point, name, self.shape), name)

    @checked(n_times=whole(minimum=2))
    def resample(
        self,
        motion: Motion,
        n_times: int | None = None,
        *,
        at: Array | None = None,
        name: str = "motion",
    ) -> Array:
        """Return a motion at other times, shape (n_times, V, 3).

        Between two frames, every triangle rotates and stretches evenly (see
        `riemhuman.solvers.PoissonPath`), so limbs keep their length.

        Parameters
        ----------
        motion : array or sequence, shape (n_frames, V, 3)
            Motion of at least two frames.
        n_times : int, optional
            Number of equally spaced times from the first frame to the last; by default that of the
            space.
        at : array, shape (n,), optional
            Times to return, in frames, not decreasing, instead of equally spaced ones.
        name : str
            Name of the motion, for messages.
        """
        n_frames = frame_count(motion, name, 2)
        if at is None:
            count = self.n_times if n_times is None else n_times
            places = np.linspace(0.0, n_frames - 1.0, count)
        else:
            places = _times_within(at, n_frames - 1)
        segments = np.minimum(places.astype(int), n_frames - 2)
        result = np.empty((len(places), *self.frames.shape))
        for k in np.unique(segments):
            is_inside = segments == k
            start, end = read_motion(self.frames, motion[k : k + 2], f"{name}[{k}:{k + 2}]")
            result[is_inside] = surfaces_between(self.frames, start, end, places[is_inside] - k)
        return result


def _times_within(at: ArrayLike, last: int) -> Array:
    times = np.asarray(real_array(at, "at", ("n_times",), batched=False))
    if (np.diff(times) < 0).any():
        raise ArgumentError("at must not decrease; found a later time before an earlier one")
    if len(times) and (times[0] < 0.0 or times[-1] > last):
        raise ArgumentError(
            f"at must lie within the motion, 0 to {last}; found {times[0]:g} to {times[-1]:g}"
        )
    return times


def frame_metric(space: MotionSpace, metric: RiemannianMetric | None) -> RiemannianMetric:
    """Return the metric that compares frames: the one given, or that of their space."""
    if metric is None:
        return metric_of(space.frames)
    check_metric(metric)
    return metric


class RateDependentMetric(RiemannianMetric):
    r"""The integral over time of a metric on frames.

    .. math:: d(m_1, m_2)^2 = \int_0^1 d(m_1(t), m_2(t))^2\, dt

    by the trapezoidal rule over equally spaced times. A motion and the same motion at another speed
    are far apart; see `DynamicTimeWarping` and `RateInvariantMetric`.

    Parameters
    ----------
    space : MotionSpace
        Space of motions.
    metric : RiemannianMetric, optional
        Metric on frames; by default that of their space.
    geodesic_solver : GeodesicSolver, optional
        Solver for geodesics between motions.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> motions = rh.motions.MotionSpace(rh.AlignedSurfaces(knees.template), n_times=4)
    >>> m1, m2 = motions.resample(knees[:30]), motions.resample(knees[:60])
    >>> bool(motions.metric.dist(m1, m2) > 0)
    True
    """

    space: SurfaceSpace

    @checked(space=instance(MotionSpace, "a MotionSpace(...)"))
    def __init__(
        self,
        space: MotionSpace,
        metric: RiemannianMetric | None = None,
        geodesic_solver: GeodesicSolver | None = None,
    ) -> None:
        super().__init__(space, geodesic_solver)
        self.metric = frame_metric(space, metric)
        weights = np.full(space.n_times, 1.0 / (space.n_times - 1))
        weights[[0, -1]] *= 0.5
        self.time_weights = weights

    @property
    def has_closed_form_dist(self) -> bool:
        return self.metric.has_closed_form_dist

    def inner_product(
        self, tangent_vec_a: Array, tangent_vec_b: Array, base_point: Array | None = None
    ) -> Array:
        products = self.metric.inner_product(tangent_vec_a, tangent_vec_b, base_point)
        total: Array = np.sum(self.time_weights * products, axis=-1)
        return total

    def squared_dist(self, point_a: Array, point_b: Array) -> Array:
        point_a = self.space.check_point(point_a, "point_a")
        point_b = self.space.check_point(point_b, "point_b")
        squares = self.metric.squared_dist(point_a, point_b)
        total: Array = np.sum(self.time_weights * squares, axis=-1)
        return total

    @property
    def bulk(self) -> Bulk:
        return SumOfFactors(
            [
                Factor(partial(np.take, indices=t, axis=1), weight, self.metric.bulk)
                for t, weight in enumerate(self.time_weights)
            ]
        )
