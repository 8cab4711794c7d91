"""Distances of motions by their best re-timing: dynamic time warping of frames or velocities."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from tqdm import tqdm

from riemhuman.arrays import Array
from riemhuman.checks import checked, checked_rate, flag, real, real_array, whole
from riemhuman.geometry import AlignedSurfaces, RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.kernels.threads import mapped, single_threaded_libraries, thread_count
from riemhuman.motions._frames import (
    FrameDistances,
    Frames,
    Motion,
    check_motions,
    frame_count,
)
from riemhuman.motions._travel import frame_rate, travel_speeds, travelled_lengths
from riemhuman.motions._warping_kernels import (
    costs_between_frames,
    least_sums,
    match_chords,
    trace_path,
)
from riemhuman.representation import constructor_text

# Largest number of steps whose velocities are matched; frames of longer motions are skipped. More
# steps distinguish finer movements; in fewer, longer ones noise counts less.
_MOST_STEPS = 20


@dataclass(frozen=True)
class Warp:
    """Corresponding times of two motions, counted in frames from 0.

    Attributes
    ----------
    dist : float
        Distance of the two motions with these times matched.
    first, second : array, shape (n_matches,)
        Matched times; neither decreases.

    Examples
    --------
    >>> warp = rh.motions.Warp(0.0, np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]))
    >>> warp(np.array([0.5, 1.5])).tolist()
    [0.5, 2.5]
    """

    dist: float
    first: Array
    second: Array

    def __call__(self, times: Array | float) -> Array:
        """Return the times of the second motion that correspond to times of the first.

        Where several times were matched with one, this is their mean; in between it is linear.
        """
        times = real_array(times, "times")
        moments, places = np.unique(self.first, return_inverse=True)
        means = np.bincount(places, weights=self.second) / np.bincount(places)
        return np.asarray(np.interp(times, moments, means))


Prepared: TypeAlias = Any  # type: ignore[explicit-any]  # each distance has classes of its own


class MotionDistance(ABC):
    """Base of distances of motions by their best re-timing."""

    @checked(heading=flag, n_components=whole(minimum=1))
    def __init__(
        self,
        metric: RiemannianMetric,
        *,
        heading: bool = False,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        check_metric(metric)
        self.metric = metric
        self.heading = heading
        self.n_components = n_components
        self.n_jobs = n_jobs
        thread_count(n_jobs)

    def __repr__(self) -> str:
        return constructor_text(self)

    def dist(self, m1: Motion, m2: Motion) -> float:
        """Return the distance of two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.
        """
        return self.warp(m1, m2).dist

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        """Return the best re-timing: the corresponding times of the two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
        """
        basis = self._basis()
        return self._match(basis, self._prepare(basis, m1, "m1"), self._prepare(basis, m2, "m2"))

    @checked(progress=flag)
    def dist_pairwise(self, motions: Sequence[Motion], *, progress: bool = False) -> Array:
        """Return all distances within a set of motions, shape (n, n).

        Parameters
        ----------
        motions : sequence of motions
            Motions of at least two frames each; their numbers of frames may differ.
        progress : bool
            Whether to show a progress bar.
        """
        check_motions(motions)
        basis = self._basis(motions)
        prepared = [self._prepare(basis, m, f"motions[{k}]") for k, m in enumerate(motions)]
        n = len(prepared)
        distances = np.zeros((n, n))

        def fill_row(i: int) -> int:
            """Fill a row up to the diagonal, and the same column; return the number of pairs."""
            for j in range(i):
                distances[i, j] = self._match(basis, prepared[i], prepared[j]).dist
                distances[j, i] = distances[i, j]
            return i

        bar = tqdm(
            total=n * (n - 1) // 2,
            desc="Distances",
            disable=not progress,
            unit=" pairs",
        )
        with bar, single_threaded_libraries():
            # The longest rows come first, so that no thread is left with a long row at the end.
            for n_pairs in mapped(fill_row, range(n - 1, -1, -1), thread_count(self.n_jobs)):
                bar.update(n_pairs)
        return distances

    @abstractmethod
    def _basis(self, motions: Sequence[Motion] = ()) -> Prepared:
        """Return what `_prepare` and `_match` share, such as components of some motions."""

    @abstractmethod
    def _prepare(self, basis: Prepared, motion: Motion, name: str) -> Prepared:
        """Return what `_match` needs of a motion."""

    @abstractmethod
    def _match(self, basis: Prepared, a: Prepared, b: Prepared) -> Warp:
        """Return the best re-timing of two prepared motions."""


class FrameWarping(MotionDistance):
    """Base of distances by frames, of which the travel of the body may be a part."""

    # Whether frames are points of the space of `lower_bound_coordinates`, where there is one.
    _flat = False

    @property
    @abstractmethod
    def _precision(self) -> str:
        """The precision that differences of squared distances need."""

    @checked(travel_weight=real(minimum=0.0), frames_per_second=checked_rate)
    def __init__(
        self,
        metric: RiemannianMetric,
        *,
        heading: bool = False,
        travel_weight: float = 0.0,
        frames_per_second: float | None = None,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(metric, heading=heading, n_components=n_components, n_jobs=n_jobs)
        self.travel_weight = travel_weight
        self.frames_per_second = frames_per_second

    def _basis(self, motions: Sequence[Motion] = ()) -> FrameDistances:
        return FrameDistances(
            self.metric,
            self.n_components if len(motions) else None,
            motions,
            heading=self.heading,
            flat=self._flat,
            travel=self._travel if self.travel_weight else None,
            precision=self._precision,
        )

    @abstractmethod
    def _travel(self, space: AlignedSurfaces, motion: Motion, places: Array, name: str) -> Array:
        """Return how the body travels, per frame, times the weight; see `FrameDistances`."""


@dataclass(frozen=True)
class _Sampled:
    """A motion's frames, squared steps between them, and weights in and distances to its mean."""

    frames: Frames
    steps: Array | None = None
    mean: tuple[Array, Array] | None = None


class DynamicTimeWarping(FrameWarping):
    r"""The smallest root mean square distance between frames after re-timing.

    .. math:: d(m_1, m_2)^2 = \min_{path} \frac{1}{n + m} \sum_{(i, j)} w_{ij}\, d(f_i, h_j)^2

    over monotone paths from the first frames to the last, with the symmetric weights of Sakoe and
    Chiba. The triangle inequality does not hold, unlike for `RateInvariantMetric`. If the frames of
    one motion omit parts of the other, `VelocityTimeWarping` gives smaller distances.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames, with a closed form.
    centered : bool
        Whether to subtract the mean of each motion along its length. The changes remain; constant
        habits of a person, such as how the arms are held, are removed.
    between_frames : bool
        Whether to match frames also with positions between frames. A motion is then nearer to its
        re-timings.
    heading : bool
        Whether to include the direction in which bodies face. By default each frame is rotated
        about the vertical axis, y, to fit the template best.
    travel_weight : float
        Weight of how fast the body travels, in addition to its pose. Differences in the speed over
        the ground, in units of the square root of g times the leg length, are multiplied by this
        weight and count like distances of the metric. Frames must be in metres.
    frames_per_second : float, optional
        Frame rate of motions that are arrays, needed if speed counts; other motions have their own.
    n_components : int, optional
        Number of principal components of `metric.lower_bound_coordinates` that `dist_pairwise`
        compares in place of frames; no distance exceeds the exact one. By default distances are
        exact.
    n_jobs : int, optional
        Number of threads, -1 for one per core; by default one.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(knees.template), a=0.0, lam=0.0, c=1.0)
    >>> warping = rh.motions.DynamicTimeWarping(pose)
    >>> float(warping.warp(knees[:40], knees[:40:2])(20))
    10.0
    """

    @checked(centered=flag, between_frames=flag)
    def __init__(
        self,
        metric: RiemannianMetric,
        *,
        centered: bool = False,
        between_frames: bool = False,
        heading: bool = False,
        travel_weight: float = 0.0,
        frames_per_second: float | None = None,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(
            metric,
            heading=heading,
            travel_weight=travel_weight,
            frames_per_second=frames_per_second,
            n_components=n_components,
            n_jobs=n_jobs,
        )
        self.centered = centered
        self.between_frames = between_frames

    @property
    def _precision(self) -> str:
        return "double" if self.centered else "single"

    def _travel(self, space: AlignedSurfaces, motion: Motion, places: Array, name: str) -> Array:
        rate = frame_rate(motion, self.frames_per_second, name)
        return self.travel_weight * travel_speeds(space, places, rate)

    def _prepare(self, basis: FrameDistances, motion: Motion, name: str) -> _Sampled:
        frame_count(motion, name, 2)
        frames = basis.frames(motion, name)
        if not self.centered and not self.between_frames:
            return _Sampled(frames)
        within = basis.squared(frames, frames)
        steps = np.diagonal(within, 1) if self.between_frames else None
        if not self.centered:
            return _Sampled(frames, steps)
        shares = _shares_of_length(within)
        to_mean = within @ shares - 0.5 * (shares @ within @ shares)
        return _Sampled(frames, steps, (shares, to_mean))

    def _match(self, basis: FrameDistances, a: _Sampled, b: _Sampled) -> Warp:
        costs = basis.squared(a.frames, b.frames)
        if a.mean is not None and b.mean is not None:
            (shares_a, to_mean_a), (shares_b, to_mean_b) = a.mean, b.mean
            # |x − x̄ − (y − ȳ)|² in a flat space; metrics of surfaces are nearly flat.
            costs = (
                costs
                - (costs @ shares_b)[:, None]
                - shares_a @ costs
                + shares_a @ costs @ shares_b
                + to_mean_a[:, None]
                + to_mean_b
            )
            costs = np.maximum(costs, 0.0)
        if a.steps is not None and b.steps is not None:
            costs = costs_between_frames(costs, a.steps, b.steps)
        sums = least_sums(costs)
        first, second = trace_path(costs, sums)[::-1].T.astype(np.float64)
        return Warp(math.sqrt(sums[-1, -1] / sum(costs.shape)), first, second)


def _shares_of_length(within: Array) -> Array:
    """Return the weight of each frame in the mean of a motion along its length."""
    lengths = np.sqrt(np.maximum(np.diagonal(within, 1), 0.0))
    if not lengths.any():
        return np.full(len(within), 1.0 / len(within))
    shares = np.pad(lengths, (0, 1)) + np.pad(lengths, (1, 0))
    sum_to_one: Array = shares / shares.sum()
    return sum_to_one


@dataclass(frozen=True)
class _Steps:
    """A motion's frames, their squared distances, and lengths of the steps between `numbers`."""

    frames: Frames
    within: Array
    numbers: Array
    lengths: Array


class VelocityTimeWarping(FrameWarping):
    r"""The distance of square root velocities, at the frames of the motion with fewer frames.

    The frames of one motion are matched with positions on the other, at frames or between them. The
    steps v from frame to frame are compared with the chords w between these positions:

    .. math:: d(m_1 \to m_2)^2 = \frac{1}{\sum |v_k|} \min \sum_k
              \Big| \frac{v_k}{\sqrt{|v_k|}} - \frac{w_k}{\sqrt{|w_k|}} \Big|^2

    over positions that do not decrease, from the first frame to the last; negative products of v
    and w count as 0. Frames are points of the Euclidean space of the metric's
    `lower_bound_coordinates`, if it has them: normals and rotations are compared by chords, not
    arcs. The distance is the smaller of the two directions. It is 0 between motions that stand
    still, and 1 between a motion that moves and one that stands still.

    A motion is near all of its samplings, however few frames they have, and near a longer motion
    that differs only by movements that a single step can skip. The triangle inequality does not
    hold. Noise counts in proportion to the steps; `RateInvariantMetric` smooths it away.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames. Without `lower_bound_coordinates`, it needs a closed form, and inner
        products of steps and chords come from squared distances.
    heading : bool
        As for `DynamicTimeWarping`.
    travel_weight : float
        Weight of how far the body travels, in addition to its pose: the distance over the ground,
        in leg lengths, times this weight is an additional coordinate of every frame.
    frames_per_second, n_components, n_jobs
        As for `DynamicTimeWarping`; no frame rate is needed.

    Examples
    --------
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(knees.template), a=0.0, lam=0.0, c=1.0)
    >>> warping = rh.motions.VelocityTimeWarping(pose)
    >>> bool(warping.dist(knees[:81], knees[:81:8]) < 0.1 * warping.dist(knees[:81], other[:81:8]))
    True
    """

    _flat = True

    @property
    def _precision(self) -> str:
        return "double"

    def _travel(self, space: AlignedSurfaces, motion: Motion, places: Array, name: str) -> Array:
        return self.travel_weight * travelled_lengths(space, places)

    def _prepare(self, basis: FrameDistances, motion: Motion, name: str) -> _Steps:
        n_frames = frame_count(motion, name, 2)
        frames = basis.frames(motion, name)
        within = basis.squared(frames, frames)
        n_steps = min(_MOST_STEPS, n_frames - 1)
        numbers = np.linspace(0, n_frames - 1, n_steps + 1).round().astype(int)
        return _Steps(frames, within, numbers, np.sqrt(within[numbers[:-1], numbers[1:]]))

    def _match(self, basis: FrameDistances, a: _Steps, b: _Steps) -> Warp:
        costs = basis.squared(a.frames, b.frames)
        squared, places = _match_steps(a, b, costs)
        squared_back, places_back = _match_steps(b, a, costs.T)
        if squared <= squared_back:
            return Warp(math.sqrt(squared), a.numbers.astype(np.float64), places)
        return Warp(math.sqrt(squared_back), places_back, b.numbers.astype(np.float64))


def _match_steps(a: _Steps, b: _Steps, costs: Array) -> tuple[float, Array]:
    """Return the squared distance from a to b, and the positions of a's frames on b."""
    rows = np.ascontiguousarray(costs[a.numbers])
    total, places = match_chords(rows, a.lengths, b.within)
    length = float(a.lengths.sum())
    if length == 0.0:
        return 0.0 if b.lengths.sum() == 0.0 else math.inf, places
    return max(total, 0.0) / length, places
