"""Paths that turn every triangle: a start for geodesics that a straight path would collapse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy import ndarray

from riemhuman.checks import whole_number
from riemhuman.geometry.metric import RiemannianMetric
from riemhuman.protocols import PathEnergy
from riemhuman.solvers.energies import SegmentEnergy
from riemhuman.solvers.results import PathResult
from riemhuman.solvers.simple_paths import check_end_points, known_path, linear_path

if TYPE_CHECKING:
    from riemhuman.geometry.aligned_surfaces import AlignedSurfaces


@dataclass(frozen=True)
class PoissonPath:
    """The path of surfaces whose triangles turn and stretch uniformly, see `surfaces.poisson`.

    Triangles turn the shorter way. Where neighbours then turn different ways, as in a limb that
    turns by about half a turn, a second path has them turn alike; the one whose middle costs less
    energy is taken.

    Parameters
    ----------
    n_nodes : int
        Number of points of the path, both ends included.
    energy : PathEnergy
        Energy that the result states.
    """

    n_nodes: int = 11
    energy: PathEnergy = SegmentEnergy()

    def __post_init__(self) -> None:
        whole_number(self.n_nodes, "n_nodes", minimum=2)

    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        """Return the path.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric on surfaces over a template.
        start, end : array, shape (V, 3)
            Surfaces whose triangles have an area.

        Returns
        -------
        PathResult

        Raises
        ------
        DegenerateSurfaceError
            If a triangle of an end point has no area, so that it has no rotation.
        """
        start, end = check_end_points(metric, start, end)
        turns, _ = best_turns(metric, self.energy, start, end)
        path = turned_path(metric, start, end, self.n_nodes, turns)
        return known_path(metric, self.energy, path, "interpolated deformation gradients")


def best_turns(
    metric: RiemannianMetric, energy: PathEnergy, start: ndarray, end: ndarray
) -> tuple[ndarray, float]:
    """Return how the triangles turn, the shorter way or alike, whichever has the better middle.

    Parameters
    ----------
    metric : RiemannianMetric
        A metric on surfaces over a template.
    energy : PathEnergy
        Energy by which the surfaces in the middle are compared.
    start, end : array, shape (V, 3)
        Surfaces whose triangles have an area.

    Returns
    -------
    turns : array, shape (F, 3)
        Rotation vectors.
    middle_energy : float
        Energy of the path of three points through the middle.

    Raises
    ------
    DegenerateSurfaceError
        If a triangle of an end point has no area, so that it has no rotation.
    """
    space: AlignedSurfaces = metric.space  # type: ignore[assignment]
    space.check_immersed(start, "start")
    space.check_immersed(end, "end")
    interpolator = space.template.interpolator
    turns = interpolator.turns(start, end)
    ways = [turns]
    if interpolator.is_torn(turns):
        ways.append(interpolator.mended(turns))
    energies = [energy.value(metric, turned_path(metric, start, end, 3, way)) for way in ways]
    best = int(np.argmin(energies))
    return ways[best], energies[best]


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
