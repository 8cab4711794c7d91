"""Search for a short motion in a long one."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from riemhuman.arrays import Array, Integers
from riemhuman.checks import checked, flag, share, whole
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.metric import check_metric
from riemhuman.motions._frames import FrameDistances, Motion, frame_count, frame_runs
from riemhuman.motions._warping_kernels import extend_paths


@dataclass(frozen=True)
class Occurrence:
    """Frames `start` to `stop` - 1 of a motion, at a distance from a query after re-timing."""

    start: int
    stop: int
    dist: float


def _a_metric(metric: RiemannianMetric, name: str) -> RiemannianMetric:
    check_metric(metric)
    return metric


@checked(metric=_a_metric, progress=flag, heading=flag, shortest=share)
@dataclass(frozen=True)
class MotionSearch:
    """Dynamic time warping of a query to any part of a motion, at any speed.

    The motion is read once, in runs of frames, and no frame is kept (Sakurai, Faloutsos and
    Yamamuro, "Stream monitoring under the time warping distance", ICDE 2007).

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames, with a closed form.
    progress : bool
        Whether to show a progress bar over frames.
    heading : bool
        As for `DynamicTimeWarping`.
    shortest : float
        Length of the shortest part to find, as a share of the length of the query, at most 1. No
        frame of the motion is matched with more than about 1 / `shortest` frames of the query.
        Otherwise a single pose of the query would often be nearer to a few frames of any motion
        than the whole query is.

    Examples
    --------
    >>> knees = rh.datasets.load_open_motions("coarse", sequences="knees")[0]
    >>> pose = rh.ElasticMetric(rh.AlignedSurfaces(knees.template), a=0.0, lam=0.0, c=1.0)
    >>> found = rh.motions.MotionSearch(pose).find(knees[40:60], knees, n_occurrences=1)
    >>> found[0].start, found[0].stop
    (40, 60)
    """

    metric: RiemannianMetric
    progress: bool = False
    heading: bool = False
    shortest: float = 0.5

    @checked(n_occurrences=whole(minimum=1))
    def find(self, query: Motion, motion: Motion, n_occurrences: int = 5) -> list[Occurrence]:
        """Return the parts of a motion that are most similar to a query.

        Parameters
        ----------
        query, motion : array or sequence, shape (n, V, 3) and (m, V, 3)
            The short and the long motion, of at least two frames.
        n_occurrences : int
            Largest number of parts to return.

        Returns
        -------
        list of Occurrence
            The nearest first. No two overlap.
        """
        n_query = frame_count(query, "query", 2)
        n_frames = frame_count(motion, "motion", 2)
        frames = FrameDistances(self.metric, heading=self.heading)
        query_frames = frames.frames(query, "query")
        sums = np.full(n_query, math.inf)
        starts = np.zeros(n_query, dtype=np.int64)
        totals = np.empty(n_frames)
        begins: Integers = np.empty(n_frames, dtype=np.int64)
        longest_run = n_query
        if self.shortest * n_query > 1.0:
            longest_run = math.ceil(1.0 / self.shortest)
        first = 0
        bar = tqdm(total=n_frames, desc="Frames", disable=not self.progress, unit="frame")
        with bar:
            for run in frame_runs(self.metric.space, motion, heading=self.heading):
                costs = frames.squared(query_frames, frames.of_run(run))
                last = first + len(run)
                extend_paths(
                    costs, first, longest_run, sums, starts, totals[first:last], begins[first:last]
                )
                first = last
                bar.update(len(run))
        part_lengths = np.arange(n_frames) - begins + 1
        distances = np.sqrt(totals / (n_query + part_lengths))
        distances[part_lengths < self.shortest * n_query] = math.inf
        return _nearest_parts(distances, begins, n_occurrences)


def _nearest_parts(distances: Array, begins: Integers, n_occurrences: int) -> list[Occurrence]:
    """Return the nearest parts, by their last frames, that do not overlap nearer ones."""
    parts: list[Occurrence] = []
    for end in np.argsort(distances, kind="stable"):
        if not math.isfinite(distances[end]):
            break
        part = Occurrence(int(begins[end]), int(end) + 1, float(distances[end]))
        if all(part.stop <= nearer.start or nearer.stop <= part.start for nearer in parts):
            parts.append(part)
        if len(parts) == n_occurrences:
            break
    return parts
