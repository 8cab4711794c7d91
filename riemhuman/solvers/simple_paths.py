"""Paths that need no optimisation: the straight line, and geodesics in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy import ndarray

from riemhuman.checks import real_array, whole_number
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.geometry import RiemannianMetric
from riemhuman.geometry.strategies import PathEnergy
from riemhuman.solvers.energies import SegmentEnergy
from riemhuman.solvers.many_paths import ManyPaths
from riemhuman.solvers.results import PathResult


@dataclass(frozen=True)
class KnownPath(ManyPaths):
    """A base of paths that no search is needed for.

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


@dataclass(frozen=True)
class LinearPath(KnownPath):
    """The straight path (1 − t) x₀ + t x₁, projected to the manifold where necessary.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> space = rh.AlignedSurfaces(bodies.template)
    >>> result = rh.solvers.LinearPath(n_nodes=3).solve(space.metric, bodies[0], bodies[1])
    >>> bool((result.path[1] == (bodies[0] + bodies[1]) / 2).all())
    True
    """

    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        r"""Return the straight path."""
        start, end = check_end_points(metric, start, end)
        path = linear_path(start, end, self.n_nodes)
        path[1:-1] = metric.space.projection(path[1:-1])
        return known_path(metric, self.energy, path, "the straight path")


@dataclass(frozen=True)
class ClosedFormGeodesic(KnownPath):
    """The geodesic, for metrics that have it in closed form.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> fields = rh.NormalFields(bodies.template)
    >>> n = fields.random_point(2, rng=0)
    >>> result = rh.solvers.ClosedFormGeodesic(n_nodes=5).solve(fields.metric, n[0], n[1])
    >>> bool(abs(result.energy / fields.metric.squared_dist(n[0], n[1]) - 1) < 1e-9)
    True
    """

    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> PathResult:
        r"""Return the geodesic.

        Parameters
        ----------
        metric : RiemannianMetric
            A metric with closed-form geodesics.

        Raises
        ------
        NotDefinedError
            If the metric has no closed form.
        """
        if not metric.has_closed_form_geodesic:
            raise NotDefinedError(
                f"{type(metric).__name__} has no closed-form geodesics; use BasisPath or "
                "PathStraightening"
            )
        start, end = check_end_points(metric, start, end)
        path = metric.geodesic(start, end_point=end)(np.linspace(0.0, 1.0, self.n_nodes))
        return known_path(metric, self.energy, path, "closed form", gap=0.0)


def check_end_points(
    metric: RiemannianMetric, start: ndarray, end: ndarray
) -> tuple[ndarray, ndarray]:
    r"""Return the end points as float64 arrays after checking them.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    start, end : array_like, shape (\*shape,)
        End points.

    Returns
    -------
    start, end : array, shape (\*shape,)
    """
    checked = []
    for point, name in ((start, "start"), (end, "end")):
        checked.append(real_array(point, name, metric.space.shape, batched=False, rows=True))
        metric.space.check_scale(checked[-1], name)
    return checked[0], checked[1]


def check_initial_path(
    metric: RiemannianMetric,
    start: ndarray,
    end: ndarray,
    n_nodes: int,
    initial_path: ndarray,
) -> ndarray:
    r"""Return an initial path as a float64 array after checking it.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    start, end : array, shape (\*shape,)
        End points.
    n_nodes : int
        Number of times expected.
    initial_path : array_like, shape (n_nodes, \*shape)
        Path, whose ends may be off by rounding.

    Returns
    -------
    array, shape (n_nodes, \*shape)

    Raises
    ------
    ArgumentError
        If it does not fit the metric's space, or has other times or ends.
    """
    path = metric.check_points(initial_path, "initial_path")
    if len(path) != n_nodes:
        raise ArgumentError(f"initial_path must have n_nodes = {n_nodes} times; found {len(path)}")
    gap = max(np.abs(path[0] - start).max(), np.abs(path[-1] - end).max())
    if gap > 1e-9 * max(np.abs(start).max(), np.abs(end).max()):
        raise ArgumentError(
            f"initial_path must run from start to end; its ends are off by up to {gap:.3g}"
        )
    return path


def linear_path(start: ndarray, end: ndarray, n_nodes: int) -> ndarray:
    r"""Return (1 − t) x₀ + t x₁ at equally spaced times (step 4 of Algorithm 1, corrected).

    Parameters
    ----------
    start, end : array, shape (\*shape,)
        End points.
    n_nodes : int
        Number of times.

    Returns
    -------
    array, shape (n_nodes, \*shape)
    """
    t = np.linspace(0.0, 1.0, n_nodes)
    return np.multiply.outer(1.0 - t, start) + np.multiply.outer(t, end)


def known_path(
    metric: RiemannianMetric, energy: PathEnergy, path: ndarray, message: str, gap: float = np.nan
) -> PathResult:
    r"""Return the result of a solver that does not search.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    energy : PathEnergy
        Energy that the result states.
    path : array, shape (n_nodes, \*shape)
        The path.
    message : str
        How it was found.
    gap : float
        How far its energy is above the minimum, in per cent, where known.

    Returns
    -------
    PathResult
    """
    value = energy.value(metric, path)
    bound = lower_bound(metric, path)
    return PathResult(path, value, np.array([value]), bound, gap, n_evaluations=1, message=message)


def percentage(gap: float, energy: float) -> float:
    """Return the gap of an energy to its minimum in per cent of the energy, 0 if the energy is 0.

    Parameters
    ----------
    gap : float
        How far the energy is above its minimum.
    energy : float
        The energy.

    Returns
    -------
    float
    """
    return 100.0 * gap / energy if energy > 0 else 0.0


def lower_bound(metric: RiemannianMetric, path: ndarray) -> float:
    r"""Return the squared distance of the ends of a path, if it is in closed form, else 0.

    Parameters
    ----------
    metric : RiemannianMetric
        The metric.
    path : array, shape (n_nodes, \*shape)
        A path.

    Returns
    -------
    float
    """
    return float(metric.squared_dist(path[0], path[-1])) if metric.has_closed_form_dist else 0.0
