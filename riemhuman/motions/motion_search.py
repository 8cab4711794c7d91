"""Search for a short motion in a long one."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.geometry import RiemannianMetric
from riemhuman.motions._frames import FrameDistances, Motion, frame_count, frame_runs
from riemhuman.motions._warping_kernels import extend_paths
from riemhuman.progress import ProgressBar


@dataclass(frozen=True)
class Occurrence:
    """Frames `start` to `stop` - 1 of a motion, at a distance from a query after re-timing."""

    start: int
    stop: int
    dist: float


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

    def find(self, query: Motion, motion: Motion, n_occurrences: int = 5) -> list[Occurrence]:
        """Return the parts of a motion that are most like a query.

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
        whole_number(n_occurrences, "n_occurrences", minimum=1)
        lengths = [frame_count(query, "query", 2), frame_count(motion, "motion", 2)]
        frames = FrameDistances(self.metric, heading=self.heading)
        wanted = frames.features(query, "query")
        sums, starts = np.full(lengths[0], math.inf), np.zeros(lengths[0], dtype=np.int64)
        totals, begins = np.empty(lengths[1]), np.empty(lengths[1], dtype=np.int64)
        first = 0
        bar: Any = ProgressBar(
            total=lengths[1], desc="Frames", disable=not self.progress, unit="frame"
        )
        with bar:
            for run in frame_runs(self.metric.space, motion, heading=self.heading):
                costs = frames.squared(wanted, self.metric.features(run))
                last = first + len(run)
                extend_paths(costs, first, sums, starts, totals[first:last], begins[first:last])
                first = last
                bar.update(len(run))
        weights = lengths[0] + np.arange(lengths[1]) - begins + 1
        return _nearest_parts(np.sqrt(totals / weights), begins, n_occurrences)


def _nearest_parts(distances: ndarray, begins: ndarray, n_occurrences: int) -> list[Occurrence]:
    """Return the nearest parts, by their last frames, that do not overlap nearer ones."""
    parts: list[Occurrence] = []
    for end in np.argsort(distances, kind="stable"):
        part = Occurrence(int(begins[end]), int(end) + 1, float(distances[end]))
        if all(part.stop <= nearer.start or nearer.stop <= part.start for nearer in parts):
            parts.append(part)
        if len(parts) == n_occurrences:
            break
    return parts
