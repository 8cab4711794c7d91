"""What the parts of the library ask of each other, for those who bring a part of their own.

Any object with these methods and attributes will do; nothing need be subclassed. Each protocol says
what a method takes, what it returns, and what it may leave out. `riemhuman.solvers.check_solver`,
`check_metric`, `check_manifold` and `riemhuman.datasets.check_dataset` try an object out.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, runtime_checkable

from numpy import ndarray
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric
    from riemhuman.surfaces.template import Template


INTERRUPTED = "interrupted from the keyboard"
"""What a result says whose solver was stopped from the keyboard."""

Found = TypeVar("Found")


def was_interrupted(result: object) -> bool:
    """Tell whether a solver was stopped from the keyboard.

    Parameters
    ----------
    result : object
        What it returned.

    Returns
    -------
    bool
    """
    unfinished = not getattr(result, "converged", True)
    return unfinished and INTERRUPTED in str(getattr(result, "message", ""))


def uninterrupted(result: Found) -> Found:
    """Return a result, unless its solver was stopped from the keyboard: then the caller stops too.

    Parameters
    ----------
    result : object
        What a solver returned.

    Returns
    -------
    object
        The same.

    Raises
    ------
    KeyboardInterrupt
        If the solver was interrupted: half a search is no number to go on with.
    """
    if was_interrupted(result):
        raise KeyboardInterrupt
    return result


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

    def solve(self, metric: RiemannianMetric, start: ndarray, end: ndarray) -> FoundPath:
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

    def solve(
        self, metric: RiemannianMetric, tangent_vec: ndarray, base_point: ndarray
    ) -> FoundPoint:
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
        self, metric: RiemannianMetric, path: ndarray, tangent_vec: ndarray, covectors: ndarray
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

    def solve(
        self, metric: RiemannianMetric, point: ndarray, base_point: ndarray
    ) -> FoundTangentVec:
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
        metric: RiemannianMetric,
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
        metric: RiemannianMetric,
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

    def value(self, metric: RiemannianMetric, path: ndarray) -> float:
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

    def value_and_gradient(self, metric: RiemannianMetric, path: ndarray) -> tuple[float, ndarray]:
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


@runtime_checkable
class Descriptor(Protocol):
    """Vectors that stand for surfaces, with a distance between them.

    `riemhuman.descriptors.Descriptor` is a base class that has everything but `describe`.
    """

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> ndarray:
        """Return the vector of one surface.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.

        Returns
        -------
        array, shape (d,)
        """

    def distances(self, vectors: ArrayLike) -> ndarray:
        """Return all distances within a set of vectors.

        Parameters
        ----------
        vectors : array_like, shape (n, d)
            Vectors of `describe`, one a row.

        Returns
        -------
        array, shape (n, n)
            Symmetric, with zero diagonal.
        """


@runtime_checkable
class Dataset(Protocol):
    """Registered surfaces with labels; `riemhuman.datasets.Bodies` is one.

    It may also have `model`, the body model that the surfaces come from; without one, or with
    None, the representations by model vectors are left out. Either label may be None: what it
    would tell is then left out.
    """

    @property
    def points(self) -> Any:
        """Surfaces, shape (n, V, 3): an array, or an object whose slices and items are arrays."""

    @property
    def template(self) -> Template:
        """The surface all are registered to."""

    @property
    def subject(self) -> Sequence[Any] | ndarray | None:
        """Who is shown, shape (n,)."""

    @property
    def pose(self) -> Sequence[Any] | ndarray | None:
        """Which pose is held, shape (n,)."""

    def __len__(self) -> int:
        """Return the number of surfaces."""


# What some metrics and spaces can do, and solvers make use of where they can.


@runtime_checkable
class SpaceWithFields(Protocol):
    """A space whose points have normals and first fundamental forms, triangle by triangle."""

    def normal_field(self, f: ndarray) -> ndarray:
        """Return unit normals.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 3)
        """

    def metric_field(self, f: ndarray) -> ndarray:
        """Return first fundamental forms.

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces.

        Returns
        -------
        array, shape (..., F, 2, 2)
        """


@runtime_checkable
class SurfaceSpace(SpaceWithFields, Protocol):
    """A space of surfaces over a template; `riemhuman.AlignedSurfaces` is one."""

    @property
    def template(self) -> Template:
        """The template."""

    def check_immersed(self, f: ndarray, name: str = "f") -> ndarray:
        """Return surfaces as arrays, refusing those with triangles without area.

        Parameters
        ----------
        f : array_like, shape (..., V, 3)
            Surfaces.
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., V, 3)
        """


@runtime_checkable
class MetricWithMatrix(Protocol):
    """A metric that gives the sparse matrix of its inner product: solvers precondition with it."""

    def metric_matrix(self, base_point: ndarray) -> Any:
        r"""Return the matrix M of the metric: ⟨h, k⟩ = h·(M k), points flattened.

        Parameters
        ----------
        base_point : array, shape (\*shape,) or (n, \*shape)
            One point, or several to average over.

        Returns
        -------
        sparse array, shape (size of a point, size of a point)
        """


@runtime_checkable
class MetricOfSurfaces(Protocol):
    """A metric of surfaces that tells what it sees.

    Where lengths are not seen, surfaces of least mean squared distance have limbs like rubber;
    where translations are not, nothing says where the next surface of a geodesic is.
    """

    @property
    def sees_translations(self) -> bool:
        """Whether distances change when one of two surfaces is translated."""

    @property
    def sees_lengths(self) -> bool:
        """Whether distances change when edges get longer or shorter."""


@runtime_checkable
class MetricWithCompanion(MetricOfSurfaces, Protocol):
    """A metric that knows what joins it in searches for surfaces, to see what it does not."""

    @property
    def unseen_part(self) -> Any:
        """A metric of what this one does not see, or None if it sees all first derivatives."""

    def seeing_lengths(self, weight: float) -> Any:
        """Return the metric with one of lengths beside it, or itself if it sees lengths.

        Parameters
        ----------
        weight : float
            Weight above 0 of the metric of lengths, in units of the metric's own weights.

        Returns
        -------
        RiemannianMetric
        """


@runtime_checkable
class MetricWithLowerBound(Protocol):
    """A metric bounded from below by Euclidean distances: they find nearest neighbours early."""

    def lower_bound_coordinates(self, points: ndarray, n_patches: int | None = None) -> ndarray:
        r"""Return coordinates whose Euclidean distances are at most those of the metric.

        Parameters
        ----------
        points : array, shape (..., \*shape)
            Points.
        n_patches : int, optional
            Number of patches to average over; by default there is no averaging.

        Returns
        -------
        array, shape (..., m)
        """


@runtime_checkable
class PulledBackMetric(Protocol):
    """A metric pulled back by a map to a space where statistics can be done."""

    @property
    def space(self) -> Any:
        """The space of the metric."""

    @property
    def target_metric(self) -> RiemannianMetric:
        """The metric on the image."""

    def map(self, f: ndarray) -> ndarray:
        r"""Return the images of points.

        Parameters
        ----------
        f : array, shape (..., \*shape)
            Points.

        Returns
        -------
        array, shape (..., \*image_shape)
        """


@runtime_checkable
class SpaceOfFactors(Protocol):
    """A product of equipped spaces; `riemhuman.ProductManifold` is one."""

    @property
    def factors(self) -> Sequence[Any]:
        """The factors."""

    def project_from_product(self, point: ndarray) -> tuple[ndarray, ...]:
        r"""Split a point into its factors.

        Parameters
        ----------
        point : array, shape (..., size)
            Points of the product.

        Returns
        -------
        tuple of array, the k-th of shape (..., \*factors[k].shape)
        """
