"""The strategies that a metric takes for what it has no closed form of."""

from __future__ import annotations

from typing import Any, Protocol

from numpy import ndarray


class GeodesicSolver(Protocol):
    """A strategy that finds a path of least energy between two points."""

    def solve(self, metric: Any, start: ndarray, end: ndarray) -> Any:
        r"""Return a result with attributes `path` and `energy`.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        start, end : array, shape (\*shape,)
            End points.

        Returns
        -------
        object
            Its `path`, shape (n_nodes, \*shape), holds both ends; its `energy` is a float.
        """


class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start."""

    def solve(self, metric: Any, tangent_vec: ndarray, base_point: ndarray) -> Any:
        r"""Return a result with attributes `end`, `complete` and `message`.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        tangent_vec : array, shape (\*shape,)
            Initial velocity.
        base_point : array, shape (\*shape,)
            Where to start.

        Returns
        -------
        object
            Its `end`, shape (\*shape,), is the point reached; `complete` tells whether that is
            the end of the geodesic, and `message` why not.
        """


class LogSolver(Protocol):
    """A strategy that finds the initial velocity of a geodesic between two points."""

    def solve(self, metric: Any, point: ndarray, base_point: ndarray) -> Any:
        r"""Return a result with an attribute `tangent_vec`.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        point, base_point : array, shape (\*shape,)
            End and start.

        Returns
        -------
        object
            Its `tangent_vec` has shape (\*shape,).
        """
