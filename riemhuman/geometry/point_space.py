"""Spaces whose points and tangent vectors are arrays of one shape, without a metric."""

from __future__ import annotations

from abc import ABC, abstractmethod

import autograd.numpy as np

from riemhuman.arrays import Array, Booleans, Points, TangentVectors
from riemhuman.checks import Rng, generator, real_array, values_of, whole_number
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.representation import constructor_text
from riemhuman.surfaces.template import Template

__all__ = ["PointSpace"]


class PointSpace(ABC):
    r"""A space whose points and tangent vectors are arrays of the same shape.

    It is the part of `riemhuman.Manifold` that metrics are defined on: a manifold can have a metric
    and a metric has a space, so what metrics know of their space knows no metrics.

    Parameters
    ----------
    dim : int
    shape : tuple of int
        Shape of one point.
    """

    is_surface_space: bool = False
    """Whether points are surfaces over a `template`, with metric and normal fields."""

    template: Template | None = None
    """The template that points are surfaces over, or fields on, if there is one."""

    def __init__(self, dim: int, shape: tuple[int, ...]) -> None:
        self.dim = dim
        self.shape = shape

    def __repr__(self) -> str:
        return constructor_text(self, leave_out=("equip",))

    @property
    def point_ndim(self) -> int:
        """The number of axes of one point."""
        return len(self.shape)

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
        # Arrays of another shape, and those with entries that are not finite, become 0.
        values = real_array(values_of(array, name), name, finite=False)
        leading = values.shape[: max(values.ndim - self.point_ndim, 0)]
        if values.shape != (*leading, *self.shape):
            return np.zeros((*leading, *self.shape)), np.zeros(leading, dtype=bool)
        good: Booleans = np.all(np.isfinite(values), axis=self._point_axes)
        if not good.all():
            values = np.where(np.expand_dims(good, self._point_axes), values, 0.0)
        return values, good
