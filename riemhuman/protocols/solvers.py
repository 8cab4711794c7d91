"""Strategies that metrics and estimators are given, and what they find."""

from __future__ import annotations

from typing import Any, Protocol, runtime_checkable

from numpy import ndarray


class FoundPath(Protocol):
    """What a `GeodesicSolver` returns.

    Whatever `riemhuman.solvers.PathResult` has beyond these two may be left out.
    """

    @property
    def path(self) -> ndarray:
        r"""Points at equally spaced times, both ends included, shape (n_nodes, \*shape)."""

    @property
    def energy(self) -> float:
        """Energy of the path."""


class FoundPoint(Protocol):
    """What an `ExpSolver` returns.

    It may also have `complete`, False where the geodesic could not be followed to its end, and
    `message`, which says why.
    """

    @property
    def end(self) -> ndarray:
        r"""The point reached, shape (\*shape,)."""


class FoundTangentVec(Protocol):
    """What a `LogSolver` or a `TransportSolver` returns."""

    @property
    def tangent_vec(self) -> ndarray:
        r"""The tangent vector, shape (\*shape,)."""


class FoundMean(Protocol):
    """What a `MeanSolver` returns.

    Whatever `riemhuman.solvers.MeanResult` has beyond these two may be left out.
    """

    @property
    def point(self) -> ndarray:
        r"""The mean, shape (\*shape,)."""

    @property
    def variance(self) -> float:
        """Weighted mean of the squared distances to it."""


@runtime_checkable
class GeodesicSolver(Protocol):
    """A strategy that finds a path of least energy between two points."""

    def solve(self, metric: Any, start: ndarray, end: ndarray) -> FoundPath:
        r"""Return the path that was found.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        start, end : array, shape (\*shape,)
            End points.

        Returns
        -------
        FoundPath
            Its path begins at `start` and ends at `end`.
        """


@runtime_checkable
class ExpSolver(Protocol):
    """A strategy that follows a geodesic from its start."""

    def solve(self, metric: Any, tangent_vec: ndarray, base_point: ndarray) -> FoundPoint:
        r"""Return the point that is reached after unit time.

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
        FoundPoint
        """


@runtime_checkable
class DifferentiableExpSolver(ExpSolver, Protocol):
    """An `ExpSolver` whose results have a `path`, and which knows how they change."""

    def derivatives(
        self, metric: Any, path: ndarray, tangent_vec: ndarray, covectors: ndarray
    ) -> tuple[ndarray, ndarray]:
        r"""Return the derivatives of a function of a path by its initial velocity and point.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        path : array, shape (n_nodes, \*shape)
            What `solve` found.
        tangent_vec : array, shape (\*shape,)
            The initial velocity it was found for.
        covectors : array, shape (n_nodes, \*shape)
            Derivatives of the function by the points of the path.

        Returns
        -------
        by_tangent_vec, by_base_point : array, shape (\*shape,)
        """


@runtime_checkable
class LogSolver(Protocol):
    """A strategy that finds the initial velocity of a geodesic between two points."""

    def solve(self, metric: Any, point: ndarray, base_point: ndarray) -> FoundTangentVec:
        r"""Return the initial velocity.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        point, base_point : array, shape (\*shape,)
            End and start.

        Returns
        -------
        FoundTangentVec
        """


@runtime_checkable
class TransportSolver(Protocol):
    """A strategy that carries tangent vectors along geodesics."""

    def solve(
        self,
        metric: Any,
        tangent_vec: ndarray,
        base_point: ndarray,
        direction: ndarray | None = None,
        end_point: ndarray | None = None,
    ) -> FoundTangentVec:
        r"""Return the vector at the end of a geodesic.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        tangent_vec : array, shape (\*shape,)
            Tangent vector at the base point.
        base_point : array, shape (\*shape,)
            Where the geodesic starts.
        direction : array, shape (\*shape,), optional
            Its initial velocity; it is followed for unit time.
        end_point : array, shape (\*shape,), optional
            Its end; exactly one of the two is given.

        Returns
        -------
        FoundTangentVec
        """


@runtime_checkable
class MeanSolver(Protocol):
    """A strategy that finds a point of least weighted mean squared distance."""

    def solve(
        self,
        metric: Any,
        points: ndarray,
        weights: ndarray | None = None,
        initial_point: ndarray | None = None,
    ) -> FoundMean:
        r"""Return the mean.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        points : array, shape (n, \*shape)
            Points.
        weights : array, shape (n,), optional
            Weights of at least 0; by default all are the same.
        initial_point : array, shape (\*shape,), optional
            Where to start; by default the solver chooses. `GeometricMedian` passes it, others
            do not, and a solver may leave it out for them.

        Returns
        -------
        FoundMean
        """


@runtime_checkable
class PathEnergy(Protocol):
    """An energy of discrete paths, with its gradient."""

    def value(self, metric: Any, path: ndarray) -> float:
        r"""Return the energy of a path.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        path : array, shape (n_nodes, \*shape)
            Path.

        Returns
        -------
        float
        """

    def value_and_gradient(self, metric: Any, path: ndarray) -> tuple[float, ndarray]:
        r"""Return the energy of a path and its gradient with respect to all points.

        Parameters
        ----------
        metric : RiemannianMetric
            The metric.
        path : array, shape (n_nodes, \*shape)
            Path.

        Returns
        -------
        energy : float
            May be infinite where the path leaves the manifold.
        gradient : array, shape (n_nodes, \*shape)
        """


@runtime_checkable
class Basis(Protocol):
    """Orthonormal vectors; a `riemhuman.DeformationBasis` for surfaces."""

    @property
    def flat(self) -> ndarray:
        """The vectors, shape (K, size of a point)."""
