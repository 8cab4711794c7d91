"""Paths that turn every triangle: initial paths where a straight one would collapse."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import PathEnergy
from riemhuman.solvers.results import PathResult
from riemhuman.solvers.simple_paths import KnownPath, check_end_points, known_path, linear_path

if TYPE_CHECKING:
    from riemhuman.geometry import AlignedSurfaces


# A part of this share of the area is a limb. At most so many are tried both ways, the largest, each
# at the cost of one path; smaller parts, most of them a few triangles, are tried together.
_LIMB = 0.01
_MOST_LIMBS = 8

# A path within this factor of the least energy may still lead to less once it is minimised.
_RIVAL = 1.1


@dataclass(frozen=True)
class PoissonPath(KnownPath):
    """The path of surfaces whose triangles turn and stretch uniformly, see `surfaces.poisson`.

    Triangles turn by the smaller angle. Where neighbours then turn in different directions, as in a
    limb that makes about half a turn, each limb, the largest first, turns by the smaller angle or
    like its neighbours, whichever has less energy; so do all smaller parts together.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> metric = rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.1)
    >>> result = rh.solvers.PoissonPath(n_nodes=5).solve(metric, bodies[0], bodies[2])
    >>> result.path.shape
    (5, 1202, 3)
    """

    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        """Return the path.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on surfaces over a template.
        start, end : array, shape (V, 3)
            Surfaces whose triangles have an area.

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of an end point has no area, so that it has no rotation.
        """
        start, end = check_end_points(metric, start, end)
        path, _ = turned_paths(metric, self.energy, start, end, self.n_nodes)[0]
        return known_path(metric, self.energy, path, "interpolated deformation gradients")


def turned_paths(
    metric: RiemannianMetric, energy: PathEnergy, start: ndarray, end: ndarray, n_nodes: int
) -> list[tuple[ndarray, float]]:
    """Return the path of least energy whose triangles turn one way or the other, and alternatives.

    All are compared at all times: at few times the chords of large rotations have too little
    energy, which favours limbs that shrink or swing too far.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces over a template.
    energy : PathEnergy
        Energy by which the paths are compared.
    start, end : array, shape (V, 3)
        Surfaces whose triangles have an area.
    n_nodes : int
        Number of points of the path, both ends included.

    Returns
    -------
    list of (array of shape (n_nodes, V, 3), float)
        Paths with their energies: the best, then those with a whole limb that turns the other way,
        if their energy is only a little higher.

    Raises
    ------
    DegenerateSurfaceError
        If a triangle of an end point has no area, so that it has no rotation.
    """
    space: AlignedSurfaces = metric.space  # type: ignore[assignment]
    space.check_immersed(start, "start")
    space.check_immersed(end, "end")
    interpolator = space.template.interpolator

    shorter = interpolator.turns(start, end)
    if not interpolator.is_torn(shorter):
        path = turned_path(metric, start, end, n_nodes, shorter)
        return [(path, energy.value(metric, path))]
    alike = interpolator.mended(shorter)
    parts = interpolator.parts(np.linalg.norm(alike - shorter, axis=1) > np.pi)
    areas = space.template.face_areas
    n_limbs = sum(areas[part].sum() >= _LIMB * areas.sum() for part in parts[:_MOST_LIMBS])
    if parts[n_limbs:]:
        parts = [*parts[:n_limbs], np.concatenate(parts[n_limbs:])]

    @cache
    def candidate(ways: tuple[bool, ...]) -> tuple[float, ndarray]:
        """Return energy and path if some parts turn like their neighbours."""
        turns = shorter.copy()
        for part, is_alike in zip(parts, ways, strict=True):
            turns[part] = (alike if is_alike else shorter)[part]
        path = turned_path(metric, start, end, n_nodes, turns)
        return energy.value(metric, path), path

    def cost(ways: tuple[bool, ...]) -> float:
        return candidate(ways)[0]

    best = min((False,) * len(parts), (True,) * len(parts), key=cost)
    rivals = []
    for k in range(len(parts)):
        best, other = sorted([best, (*best[:k], not best[k], *best[k + 1 :])], key=cost)
        if k < n_limbs:
            rivals.append(other)
    rivals = [ways for ways in rivals if cost(ways) <= _RIVAL * cost(best)]
    return [candidate(ways)[::-1] for ways in (best, *rivals)]


def turned_path(
    metric: RiemannianMetric, start: ndarray, end: ndarray, n_nodes: int, turns: ndarray
) -> ndarray:
    """Return the path whose triangles turn as given.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces over a template.
    start, end : array, shape (V, 3)
        Surfaces whose triangles have an area.
    n_nodes : int
        Number of points of the path, both ends included.
    turns : array, shape (F, 3)
        Rotation vectors.

    Returns
    -------
    array, shape (n_nodes, V, 3)
    """
    space: AlignedSurfaces = metric.space  # type: ignore[assignment]
    path = linear_path(start, end, n_nodes)
    times = np.linspace(0.0, 1.0, n_nodes)[1:-1]
    path[1:-1] = space.template.interpolator.interpolate(start, end, times, turns)
    return path
