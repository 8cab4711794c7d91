"""Geodesics between motions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.motions.alignment import Alignment, at_times, default_alignment, even_times
from riemhuman.motions.frames import Motion
from riemhuman.motions.motion_space import MotionSpace


@dataclass(frozen=True)
class MotionPath:
    """A path of motions.

    Attributes
    ----------
    path : array, shape (n_nodes, n_times, V, 3)
        Motions from the first to the second, at equally spaced times of the first.
    times : array, shape (n_times,)
        Times of the second motion that correspond to those of the first, as shares of its duration.
    """

    path: ndarray
    times: ndarray


@dataclass(frozen=True)
class MotionGeodesic:
    """The geodesic of the L² metric between a motion and the best re-timing of another.

    At each time it is a geodesic between the two surfaces, by the solver of the space of motions.

    Parameters
    ----------
    n_nodes : int
        Number of motions of the path, both ends included.
    alignment : Alignment, optional
        How the second motion is aligned with the first; by default by `DynamicTimeWarping` of
        changes, under the metric of the frames.

    Examples
    --------
    >>> import riemhuman as rh
    >>> knees, other = rh.datasets.load_open_motions("coarse", sequences="knees")[:2]
    >>> space = rh.AlignedSurfaces(knees.template)
    >>> space = space.equip_with_metric(rh.ElasticMetric, a=0.0, lam=0.0, c=1.0)
    >>> motions = rh.motions.MotionSpace(space, n_times=4)
    >>> result = rh.motions.MotionGeodesic(n_nodes=3).solve(motions, knees[:30:6], other[:30:6])
    >>> result.path.shape
    (3, 4, 1202, 3)
    """

    n_nodes: int = 5
    alignment: Alignment | None = None

    def __post_init__(self) -> None:
        whole_number(self.n_nodes, "n_nodes", minimum=2)

    def solve(self, space: MotionSpace, m1: Motion, m2: Motion) -> MotionPath:
        """Return the path.

        Parameters
        ----------
        space : MotionSpace
            Space of motions.
        m1, m2 : array or sequence, shape (n, V, 3) and (m, V, 3)
            Motions of at least two frames.

        Returns
        -------
        MotionPath

        Raises
        ------
        ArgumentError
            If a frame is wrong.
        DegenerateSurfaceError
            If a triangle has no area.
        """
        alignment = self.alignment or default_alignment(space)
        times = even_times(alignment.warp(m1, m2), space.n_times)
        start = space.resample(m1, name="m1")
        end = at_times(space, m2, times, "m2")
        shares = np.linspace(0.0, 1.0, self.n_nodes)
        columns = [space.between(one, other, shares) for one, other in zip(start, end, strict=True)]
        return MotionPath(np.stack(columns, axis=1), times)
