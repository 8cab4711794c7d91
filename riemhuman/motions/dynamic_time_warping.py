"""Dynamic time warping of motions over the distances of their frames."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_number, whole_number
from riemhuman.errors import ArgumentError
from riemhuman.geometry import RiemannianMetric
from riemhuman.motions.dtw_kernels import accumulate, lower_bound, trace
from riemhuman.motions.frame_tables import (
    ExactTables,
    Frames,
    Tables,
    costs_between,
    kept_frames,
)
from riemhuman.motions.frames import Motion, n_frames_of, several_motions
from riemhuman.motions.time_warping import TimeWarping
from riemhuman.motions.warp import Warp


class DynamicTimeWarping(TimeWarping):
    r"""The least root mean squared distance of frames along a common clock.

    .. math:: d(m_1, m_2)^2 = \min_{path} \frac{1}{n + m} \sum_{(i, j)} w_{ij}\, d(f_i, h_j)^2

    over monotone paths from the first frames to the last, with the symmetric weights of Sakoe and
    Chiba. It does not satisfy the triangle inequality; `RateInvariantMetric` does. Where the frames
    of one motion leave out parts of the other, `VelocityTimeWarping` is nearer to 0.

    Parameters
    ----------
    window : float, optional
        Largest distance of matched frames, as a share of each motion; by default there is no limit.
    n_times : int, optional
        Compare motions at this many equally spaced times, by cubic interpolation between frames;
        by default at their frames.
    centered : bool
        Whether to take off the mean of each motion along its length. This leaves what changes, and
        takes off what belongs to a person, such as a habit of holding the arms.
    between_frames : bool
        Whether to match frames with places between frames, too. A motion is then nearer to its own
        re-timing.

    Raises
    ------
    ArgumentError
        If a parameter is out of its range.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees.template)
    >>> pose = rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0)
    >>> warping = rh.motions.DynamicTimeWarping(pose)
    >>> slow, fast = knees[:40], knees[:40:2]
    >>> bool(warping.dist(slow, fast) < warping.dist(slow, other[:40:2]))
    True
    >>> float(warping.warp(slow, fast)(20))
    10.0
    """

    def __init__(
        self,
        metric: RiemannianMetric,
        window: float | None = None,
        *,
        n_times: int | None = None,
        centered: bool = False,
        between_frames: bool = False,
        n_components: int | None = None,
        n_jobs: int | None = None,
    ) -> None:
        super().__init__(metric, n_components, n_jobs)
        self.window = window
        self.n_times = n_times
        self.centered = centered
        self.between_frames = between_frames
        self._window = math.inf
        if window is not None:
            self._window = real_number(window, "window", minimum=0.0)
        if n_times is not None:
            whole_number(n_times, "n_times", minimum=2)

    def warp(self, m1: Motion, m2: Motion) -> Warp:
        tables = ExactTables(self.metric)
        costs = costs_between(
            tables, self._prepared(tables, m1, "m1"), self._prepared(tables, m2, "m2")
        )
        total, cells = best_path(costs, self._window)
        scales = [
            (n_frames_of(motion) - 1) / (length - 1)
            for motion, length in zip((m1, m2), costs.shape, strict=True)
        ]
        first, second = (cells * scales).T
        return Warp(self._from_sum(total, costs), first, second)

    def kneighbors(
        self, queries: Sequence[Motion], motions: Sequence[Motion], n_neighbors: int = 1
    ) -> tuple[ndarray, ndarray]:
        """Return the motions nearest to queries, exactly as all distances would give them.

        A motion is given up once a lower bound, or all sums in a row of the table, are above the
        distance of the neighbours found so far.

        Parameters
        ----------
        queries, motions : sequence of motions
            Queries, and the motions to search.
        n_neighbors : int
            Number of neighbours.

        Returns
        -------
        distances : array, shape (n_queries, n_neighbors)
            Ascending.
        indices : array of int, shape (n_queries, n_neighbors)
            Of motions at the same distance, the lower index comes first.

        Raises
        ------
        ArgumentError
            If a motion is wrong, the window admits no path, or there are not as many motions.
        """
        several_motions(queries, "queries")
        several_motions(motions)
        if not 1 <= whole_number(n_neighbors, "n_neighbors") <= len(motions):
            raise ArgumentError(
                f"n_neighbors must be at least 1 and at most {len(motions)}, the number of "
                f"motions; found {n_neighbors}"
            )
        tables = ExactTables(self.metric)
        kept = [self._prepared(tables, motion, f"motions[{k}]") for k, motion in enumerate(motions)]
        distances = np.empty((len(queries), n_neighbors))
        indices = np.empty((len(queries), n_neighbors), dtype=np.int64)
        for row, motion in enumerate(queries):
            query = self._prepared(tables, motion, f"queries[{row}]")
            found = self._nearest(tables, query, kept, n_neighbors)
            distances[row], indices[row] = zip(*found, strict=True)
        return distances, indices

    def _nearest(
        self, tables: Tables, query: Frames, kept: Sequence[Frames], n_neighbors: int
    ) -> list[tuple[float, int]]:
        costs = [costs_between(tables, query, other) for other in kept]
        bounds = [self._from_sum(lower_bound(c, self._window), c) for c in costs]
        found: list[tuple[float, int]] = []
        for k in np.argsort(bounds, kind="stable"):
            most = found[-1][0] if len(found) == n_neighbors else math.inf
            if bounds[k] > most:
                break
            least = self._least_sum(costs[k], (1.0 + 1e-9) * most**2 * sum(costs[k].shape))
            found = sorted([*found, (self._from_sum(least, costs[k]), int(k))])[:n_neighbors]
        return found

    def _prepared(self, tables: Tables, motion: Motion, name: str) -> Frames:
        return kept_frames(tables, motion, name, self.n_times, self.centered, self.between_frames)

    def _between(self, tables: Tables, one: Frames, other: Frames) -> float:
        costs = costs_between(tables, one, other)
        return self._from_sum(self._least_sum(costs), costs)

    def _least_sum(self, costs: ndarray, most: float = math.inf) -> float:
        sums = np.empty(costs.shape)
        if accumulate(costs, self._window, most, sums) < len(costs):
            return math.inf if most < math.inf else _refuse(self._window, costs.shape)
        total = float(sums[-1, -1])
        return total if total < math.inf else _refuse(self._window, costs.shape)

    @staticmethod
    def _from_sum(total: float, costs: ndarray) -> float:
        return math.sqrt(total / sum(costs.shape))


def best_path(costs: ndarray, window: float) -> tuple[float, ndarray]:
    """Return the least sum of costs from corner to corner, and its path.

    Parameters
    ----------
    costs : array, shape (n, m)
        Costs of cells.
    window : float
        How far, as a share of both motions, matched frames may be apart; infinite for any.

    Returns
    -------
    total : float
        The least sum, with symmetric weights.
    cells : array of int, shape (n_cells, 2)
        Cells of the path, in order.

    Raises
    ------
    ArgumentError
        If the window admits no path.
    """
    sums = np.empty(costs.shape)
    filled = accumulate(costs, window, math.inf, sums)
    if filled < len(costs) or not sums[-1, -1] < math.inf:
        _refuse(window, costs.shape)
    path = np.empty((sum(costs.shape), 2), dtype=np.int64)
    length = trace(costs, sums, path)
    return float(sums[-1, -1]), path[:length][::-1]


def _refuse(window: float, shape: tuple[int, ...]) -> float:
    raise ArgumentError(
        f"window={window:g} admits no path between {shape[0]} and {shape[1]} frames; "
        f"{math.ceil(1000 / (min(shape) - 1)) / 1000:g} does"
    )
