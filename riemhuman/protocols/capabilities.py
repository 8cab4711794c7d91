"""What some metrics and spaces can do, and solvers make use of where they can."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from numpy import ndarray

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


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
    def is_translation_invariant(self) -> bool:
        """Whether translating one of two surfaces leaves distances unchanged."""

    @property
    def is_stretch_invariant(self) -> bool:
        """Whether changes of the lengths of edges leave distances unchanged."""


@runtime_checkable
class MetricOfSlides(Protocol):
    """A metric of surfaces that tells whether it sees them slide along themselves.

    Where it does not, meshes in paths over all vertices crumple: creases that slide cost little.
    """

    @property
    def is_reparametrization_invariant(self) -> bool:
        """Whether deformations tangential to a surface cost nothing."""


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
    def target_metric(self) -> Any:
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
