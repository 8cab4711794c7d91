"""Time warping of velocities, at the resolution of the coarser motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.geometry import RiemannianMetric
from riemhuman.motions.chord_kernels import match_chords
from riemhuman.motions.frame_tables import ExactTables, Tables
from riemhuman.motions.frames import Motion, n_frames_of
from riemhuman.motions.time_warping import TimeWarping
from riemhuman.motions.warp import Warp


@dataclass(frozen=True)
class _Sampled:
    """One motion, prepared for comparison.

    Attributes
    ----------
    features : tuple of array, each of shape (m, ...)
        Features of each frame.
    within : array, shape (m, m)
        Squared distances of frames.
    chosen : array of int, shape (n,)
        Frames between which the motion steps.
    steps : array, shape (n - 1,)
        Lengths of the steps.
    """

    features: tuple[ndarray, ...]
    within: ndarray
    chosen: ndarray
    steps: ndarray

    @property
    def length(self) -> float:
        return float(self.steps.sum())


class VelocityTimeWarping(TimeWarping):
    r"""The distance of square root velocities, at the frames of the motion that has fewer of them.

    The frames of one motion are matched with positions on the other, at frames or between them. The
    steps v from frame to frame are compared with the chords w between these positions:

    .. math:: d(m_1 \to m_2)^2 = \frac{1}{\sum |v_k|} \min \sum_k
              \Big| \frac{v_k}{\sqrt{|v_k|}} - \frac{w_k}{\sqrt{|w_k|}} \Big|^2

    over positions that do not decrease, from the first frame to the last; negative products of v
    and w count as 0. The distance is the smaller of the two directions, mostly the one from the
    motion of fewer frames. It is 0 between motions that stand still, and 1 between a motion that
    moves and one that stands still.

    A motion is near all of its samplings, however few frames they have. But it is also near a
    longer motion that differs from it only in what one step can skip, such as a knee lifted once
    and three times. And the triangle inequality does not hold: two samplings of a motion are both
    near it, and may be far from each other. No distance that vanishes between a motion and all of
    its samplings satisfies it, because two motions that share some frames would be at 0.
    `RateInvariantMetric` is a metric, but less near to 0 between a motion and few of its frames.

    Noise counts in proportion to the steps: if it is as large as the steps of a slow motion, all
    distances are about 1. `RateInvariantMetric` smooths it away.

    In flat spaces the distance does not change when one vector is added to all frames of a motion,
    such as a habit of holding the arms.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames, with a closed form. Inner products of steps and chords come from its
        squared distances, see `riemhuman.motions.chord_kernels`.
    n_steps : int
        Largest number of steps of a motion; frames in excess are skipped. More steps distinguish
        finer movements. Fewer steps are longer, so that noise counts less.

    Raises
    ------
    ArgumentError
        If a parameter is out of its range.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(knees.template), a=0.0, lam=0.0, c=1.0)
    >>> warping = rh.motions.VelocityTimeWarping(pose)
    >>> whole, few = knees[:81], knees[:81:8]
    >>> bool(warping.dist(whole, few) < 0.01 * warping.dist(whole, other[:81:8]))
    True
    """

    def __init__(
        self,
        metric: RiemannianMetric,
        *,
        n_steps: int = 20,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(metric, n_components, n_jobs)
        self.n_steps = whole_number(n_steps, "n_steps", minimum=1)

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        tables = ExactTables(self.metric)
        one, other = self._prepared(tables, m1, "m1"), self._prepared(tables, m2, "m2")
        return self._matched(one, other, tables.squared(one.features, other.features))

    def _prepared(self, tables: Tables, motion: Motion, name: str) -> _Sampled:
        n_frames = n_frames_of(motion, name, 2)
        features = tables.features(motion, name)
        within = tables.squared(features, features)
        n_steps = min(self.n_steps, n_frames - 1)
        chosen = np.linspace(0, n_frames - 1, n_steps + 1).round().astype(int)
        return _Sampled(features, within, chosen, np.sqrt(within[chosen[:-1], chosen[1:]]))

    def _between(self, tables: Tables, one: _Sampled, other: _Sampled) -> float:
        return self._matched(one, other, tables.squared(one.features, other.features)).dist

    def _matched(self, one: _Sampled, other: _Sampled, costs: ndarray) -> Warp:
        """Return the warp of the lesser distance."""
        squared, places = self._directed(one, other, costs)
        back, places_back = self._directed(other, one, costs.T)
        if squared <= back:
            return Warp(math.sqrt(squared), one.chosen.astype(np.float64), places)
        return Warp(math.sqrt(back), places_back, other.chosen.astype(np.float64))

    def _directed(self, one: _Sampled, other: _Sampled, costs: ndarray) -> tuple[float, ndarray]:
        places = np.empty(len(one.chosen))
        rows = np.ascontiguousarray(costs[one.chosen])
        total = match_chords(rows, one.steps, other.within, places)
        if one.length == 0.0:
            return 0.0 if other.length == 0.0 else math.inf, places
        return max(total, 0.0) / one.length, places
