"""Distances of motions by their best re-timing: what they share."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.geometry import RiemannianMetric
from riemhuman.kernels.threads import mapped, single_threaded_libraries, thread_count
from riemhuman.motions.frame_tables import Tables, tables_of
from riemhuman.motions.frames import Motion, several_motions
from riemhuman.motions.warp import Warp
from riemhuman.progress import ProgressBar
from riemhuman.representation import constructor_text


class TimeWarping(InheritsDocstrings, ABC):
    """A base of distances of motions by their best re-timing.

    Parameters
    ----------
    metric : RiemannianMetric
        Metric on frames, with a closed form.
    n_components : int, optional
        Number of principal components in place of exact distances in `dist_pairwise`; see
        `riemhuman.motions.frame_tables`. By default distances are exact.
    n_jobs : int, optional
        Number of threads, -1 for one a core; by default one.
    """

    def __init__(
        self, metric: RiemannianMetric, n_components: int | None, n_jobs: int | None
    ) -> None:
        self.metric = metric
        self.n_components = n_components
        self.n_jobs = n_jobs
        if n_components is not None:
            whole_number(n_components, "n_components", minimum=1)
        thread_count(n_jobs)

    def __repr__(self) -> str:
        return constructor_text(self)

    def dist(self, m1: Motion, m2: Motion) -> float:
        """Return the distance of two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.

        Returns
        -------
        float

        Raises
        ------
        ArgumentError
            If a frame is wrong, or there is no re-timing within the limits given.
        """
        return self.warp(m1, m2).dist

    @abstractmethod
    def warp(self, m1: Motion, m2: Motion) -> Warp:
        """Return the best re-timing, as the correspondence between the times of the two motions.

        Parameters
        ----------
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.

        Returns
        -------
        Warp

        Raises
        ------
        ArgumentError
            If a frame is wrong, or there is no re-timing within the limits given.
        """

    def dist_pairwise(self, motions: Sequence[Motion], *, progress: bool = False) -> ndarray:
        """Return all distances within a set of motions.

        Features of all frames are computed once and kept.

        Parameters
        ----------
        motions : sequence of motions
            Motions of at least two frames each; their numbers may differ.
        progress : bool
            Whether to show a progress bar.

        Returns
        -------
        array, shape (n, n)
            Symmetric, with zero diagonal.

        Raises
        ------
        ArgumentError
            If a motion is wrong, or there is no re-timing within the limits given.
        """
        several_motions(motions)
        tables = tables_of(self.metric, motions, self.n_components)
        kept = [self._prepared(tables, motion, f"motions[{k}]") for k, motion in enumerate(motions)]
        return all_pairs(partial(self._between, tables), kept, self.n_jobs, progress)

    @abstractmethod
    def _prepared(self, tables: Tables, motion: Motion, name: str) -> Any:
        """Return what distances need of a motion."""

    @abstractmethod
    def _between(self, tables: Tables, one: Any, other: Any) -> float:
        """Return the distance of two motions that were prepared."""


def all_pairs(
    dist: Callable[[Any, Any], float],
    items: Sequence[Any],
    n_jobs: int | None,
    progress: bool,
) -> ndarray:
    """Return the distances of all pairs of items.

    Parameters
    ----------
    dist : callable
        Returns the distance of two items.
    items : sequence
        The items.
    n_jobs : int or None
        Number of threads.
    progress : bool
        Whether to show a progress bar.

    Returns
    -------
    array, shape (n, n)
        Symmetric, with zero diagonal.
    """
    n = len(items)
    distances = np.zeros((n, n))

    def fill(i: int) -> int:
        for j in range(i):
            distances[i, j] = distances[j, i] = dist(items[i], items[j])
        return i

    bar = ProgressBar(total=n * (n - 1) // 2, desc="Distances", disable=not progress, unit=" pairs")
    with bar, single_threaded_libraries():
        # The longest rows first, so that no thread is left with one at the end.
        for done in mapped(fill, range(n - 1, -1, -1), thread_count(n_jobs)):
            bar.update(done)
    return distances
