"""Manifolds whose points and tangent vectors are arrays of one shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from copy import copy
from typing import TYPE_CHECKING, Self, TypeGuard

import autograd.numpy as np

from riemhuman.arrays import Array, Booleans, Points, TangentVectors, Triangles
from riemhuman.checks import (
    Rng,
    generator,
    real_array,
    real_number,
    refuse_type,
    values_of,
    whole_number,
)
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.representation import constructor_text
from riemhuman.surfaces.template import Template

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric

    # A class of metrics, each of which has parameters of its own.
    MetricClass = Callable[..., RiemannianMetric]  # type: ignore[explicit-any]


class Manifold(ABC):
    r"""A manifold whose points and tangent vectors are arrays of the same shape.

    Subclasses define which arrays are points (`belongs`), projections to the tangent spaces
    (`to_tangent`) and examples (`random_point`). `metric` is what it was equipped with last.
    `riemhuman.testing.check_manifold` tries all three out.

    Parameters
    ----------
    dim : int
    shape : tuple of int
        Shape of one point.
    equip : bool
        Whether to equip the manifold with its default metric.

    Examples
    --------
    >>> class Positive(rh.Manifold):
    ...     def __init__(self):
    ...         super().__init__(1, (1,))
    ...
    ...     def belongs(self, point, atol=1e-9):
    ...         point = np.asarray(point)
    ...         if point.shape[-1:] != self.shape:
    ...             return np.zeros(point.shape[:-1], dtype=bool)
    ...         return point[..., 0] > 0
    ...
    ...     def to_tangent(self, vector, base_point=None):
    ...         return vector
    ...
    ...     def random_point(self, n_samples=1, bound=1.0, rng=None):
    ...         shape = (1,) if n_samples == 1 else (n_samples, 1)
    ...         return np.exp(np.random.default_rng(rng).uniform(-bound, bound, shape))
    >>> Positive().belongs(np.array([[2.0], [-1.0]])).tolist()
    [True, False]
    >>> rh.testing.check_manifold(Positive()).passed
    True
    """

    metric: RiemannianMetric

    is_surface_space: bool = False
    """Whether points are surfaces over a `template`, with metric and normal fields."""

    template: Template | None = None
    """The template that points are surfaces over, or fields on, if there is one."""

    factors: tuple[Manifold, ...] = ()
    """The factors of a product, each equipped with a metric."""

    def __init__(self, dim: int, shape: tuple[int, ...], equip: bool = True) -> None:
        self.dim = dim
        self.shape = shape
        if equip and self.default_metric() is not None:
            self.equip_with_metric()

    def __repr__(self) -> str:
        return constructor_text(self, leave_out=("equip",))

    @property
    def point_ndim(self) -> int:
        """The number of axes of one point."""
        return len(self.shape)

    @property
    def is_equipped(self) -> bool:
        """Whether the manifold has a metric."""
        return "metric" in vars(self)

    def default_metric(self) -> MetricClass | None:
        """Return the class of the manifold's default metric, if there is one."""
        return None

    def equip_with_metric(self, Metric: MetricClass | None = None, **metric_kwargs: object) -> Self:
        """Equip the manifold with a metric, `Metric(self, **metric_kwargs)`, and return it.

        Parameters
        ----------
        Metric : type, optional
            Subclass of `RiemannianMetric`; by default the manifold's own.
        **metric_kwargs
        """
        make = self.default_metric() if Metric is None else Metric
        if make is None:
            raise ArgumentTypeError(f"{type(self).__name__} has no default metric: pass one")
        if not callable(make):
            raise ArgumentTypeError(
                "Metric must be a metric class, followed by its parameters by name, as in "
                f"equip_with_metric(ElasticMetric, a=1.0); found {type(make).__name__}"
            )
        self.metric = make(self, **metric_kwargs)
        return self

    def new(self, equip: bool = True) -> Self:
        """Return a manifold with the same parameters, with its default metric or without one.

        Parameters
        ----------
        equip : bool
        """
        space = copy(self)
        vars(space).pop("metric", None)
        if equip and space.default_metric() is not None:
            space.equip_with_metric()
        return space

    @abstractmethod
    def belongs(self, point: Points, atol: float = 1e-9) -> Booleans:
        r"""Return whether arrays are points of the manifold, shape (...).

        Arrays of another shape are not points.

        Parameters
        ----------
        point : array, shape (..., \*shape)
        atol : float
        """

    @abstractmethod
    def to_tangent(self, vector: TangentVectors, base_point: Points | None = None) -> Array:
        r"""Project arrays to the tangent space at a point, shape (..., \*shape).

        Parameters
        ----------
        vector : array, shape (..., \*shape)
        base_point : array, shape (..., \*shape), optional
            Points; needed unless the tangent space is the same at all of them.
        """

    @abstractmethod
    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> Array:
        r"""Draw random points, shape (n_samples, \*shape), or (\*shape,) for one sample.

        Parameters
        ----------
        n_samples : int
        bound : float
            Spread of the points, if the manifold is not compact.
        rng : int or numpy.random.Generator, optional
            Seed, or the generator to draw from; by default, every call draws different points.
        """

    def is_tangent(
        self, vector: TangentVectors, base_point: Points | None = None, atol: float = 1e-9
    ) -> Booleans:
        r"""Return whether arrays are tangent vectors at a point, shape (...).

        Parameters
        ----------
        vector : array, shape (..., \*shape)
        base_point : array, shape (..., \*shape), optional
            Points; needed unless the tangent space is the same at all of them.
        atol : float
        """
        vector, finite = self._candidates(vector, "vector")
        if base_point is not None:
            base_point = self.check_point(base_point, "base_point")
            vector = vector + np.zeros_like(base_point)
        error = np.abs(vector - self.to_tangent(vector, base_point))
        return finite & np.all(error <= atol, axis=self._point_axes)

    def random_tangent_vec(
        self, base_point: Points | None = None, n_samples: int = 1, rng: Rng = None
    ) -> Array:
        r"""Draw random tangent vectors, one at each of several points or several at one point.

        Parameters
        ----------
        base_point : array, shape (\*shape,) or (n, \*shape), optional
            Points; needed unless the tangent space is the same at all of them.
        n_samples : int
            Number of tangent vectors; for n > 1 points it may be 1 or n, with the same effect.
        rng : int or numpy.random.Generator, optional
        """
        n_samples = whole_number(n_samples, "n_samples", minimum=1)
        shape = self.shape
        if base_point is not None:
            base_point = self.check_point(base_point, "base_point")
            shape = base_point.shape
        if n_samples > 1 and len(shape) == self.point_ndim:
            shape = (n_samples, *shape)
        if n_samples > 1 and shape != (n_samples, *self.shape):
            raise ArgumentError(
                f"n_samples must be 1 or the number of base points; found {n_samples} with "
                f"base_point of shape {shape}"
            )
        return self.to_tangent(generator(rng).standard_normal(shape), base_point)

    def warn_of_tears(self, points: Points, directions: TangentVectors | None = None) -> None:
        r"""Warn if moving points along directions, as solvers do, would tear them.

        Spaces of surfaces check for seams in their template.

        Parameters
        ----------
        points : array, shape (..., \*shape)
        directions : array, shape (K, n), rows of as many numbers as a point, optional
            By default all coordinates are free.
        """
        del points, directions  # elsewhere, nothing tears

    def projection(self, point: Points) -> Array:
        r"""Project arrays near the manifold to it, differentiably, shape (..., \*shape).

        Parameters
        ----------
        point : array, shape (..., \*shape)
        """
        return point

    def check_point(self, point: object, name: str = "point") -> Array:
        r"""Return points as float64 arrays after checking them, shape (..., \*shape).

        Parameters
        ----------
        point : array_like, shape (..., \*shape)
            Points, or flattened points, shape (..., n).
        name : str, for messages
        """
        return real_array(self.as_array(point, name), name, self.shape, rows=True)

    def check_scale(self, point: Points, name: str = "point") -> None:
        r"""Raise an error if points seem to be in another unit of length, for spaces with units.

        Parameters
        ----------
        point : array, shape (..., \*shape)
        name : str, for messages
        """
        return

    def as_array(self, points: object, name: str = "points") -> object:
        """Return points as arrays, if they are something else, such as meshes on surfaces.

        Parameters
        ----------
        points : object
        name : str, for messages
        """
        return points

    @property
    def _point_axes(self) -> tuple[int, ...]:
        return tuple(range(-self.point_ndim, 0))

    def _needed_base_point(self, base_point: Points | None) -> Array:
        """Return a base point; raise ArgumentTypeError if there is none."""
        if base_point is None:
            raise ArgumentTypeError(
                "base_point must be given: tangent vectors and inner products of "
                f"{type(self).__name__} depend on it"
            )
        return base_point

    def _candidates(self, array: Array, name: str) -> tuple[Array, Booleans]:
        """Return arrays of the points' shape, and which of them are those that were given."""
        # Arrays of another shape, and arrays with infinite entries, become 0.
        values = real_array(values_of(array, name), name, finite=False)
        leading = values.shape[: max(values.ndim - self.point_ndim, 0)]
        if values.shape != (*leading, *self.shape):
            return np.zeros((*leading, *self.shape)), np.zeros(leading, dtype=bool)
        good = np.all(np.isfinite(values), axis=self._point_axes)
        return np.where(np.expand_dims(good, self._point_axes), values, 0.0), good


class SurfaceSpace(Manifold):
    """A manifold of surfaces over a template: what metrics and solvers need of one."""

    is_surface_space = True
    template: Template

    @property
    @abstractmethod
    def faces(self) -> Triangles:
        """Vertex indices of each triangle, shape (F, 3)."""

    @abstractmethod
    def partial_derivatives(self, f: Points) -> tuple[Array, Array]:
        """Return f_u and f_v in orthonormal frames of the template, each of shape (..., F, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
            Surfaces, or deformations.
        """

    @abstractmethod
    def metric_field(self, f: Points) -> Array:
        """Return the metric field g, shape (..., F, 2, 2); triangles without area are legal.

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """

    @abstractmethod
    def normal_field(self, f: Points) -> Array:
        """Return the normal field n, shape (..., F, 3).

        Parameters
        ----------
        f : array, shape (..., V, 3)
        """

    @abstractmethod
    def check_tangent_vec(self, tangent_vec: object, name: str = "tangent_vec") -> TangentVectors:
        """Return deformations as float64 arrays after checking them, shape (..., V, 3).

        Parameters
        ----------
        tangent_vec : array_like, shape (..., V, 3)
            Deformations, of any size.
        name : str, for messages
        """

    @abstractmethod
    def check_immersed(self, f: object, name: str = "f") -> Points:
        """Return surfaces as float64 arrays if all their triangles have area, shape (..., V, 3).

        Parameters
        ----------
        f : array_like, shape (..., V, 3)
        name : str, for messages
        """


def holds_surfaces(space: Manifold) -> TypeGuard[SurfaceSpace]:
    """Return whether points are surfaces over a template, in words that type checkers follow."""
    return space.is_surface_space


def surface_space(space: Manifold) -> SurfaceSpace:
    """Return a space of surfaces; raise an ArgumentTypeError for any other space."""
    if not holds_surfaces(space):
        refuse_type(space, "space", "a space of surfaces, such as AlignedSurfaces(template)")
    return space


def sample_count(n_samples: int) -> int:
    """Return the number of random samples, at least 1."""
    return whole_number(n_samples, "n_samples", minimum=1)


def sample_bound(bound: float) -> float:
    """Return the spread of random points, at least 0."""
    return real_number(bound, "bound", minimum=0.0)


def stack_samples(samples: Array, n_samples: int) -> Array:
    """Return samples without their first axis if there is only one."""
    return samples[0] if n_samples == 1 else samples
