"""The space that metrics need: its points and tangent vectors are arrays of one shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, values_of
from riemhuman.docstrings import InheritsDocstrings
from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry.samples import sample_count


class Space(InheritsDocstrings, ABC):
    r"""A space whose points and tangent vectors are arrays of one shape.

    `riemhuman.Manifold` adds a metric to it; metrics ask for no more than this.

    Parameters
    ----------
    dim : int
        Dimension.
    shape : tuple of int
        Shape of one point.
    """

    def __init__(self, dim: int, shape: tuple[int, ...]) -> None:
        self.dim = dim
        self.shape = shape

    @property
    def point_ndim(self) -> int:
        """The number of axes of one point."""
        return len(self.shape)

    @abstractmethod
    def belongs(self, point: ndarray, atol: float = 1e-9) -> ndarray:
        r"""Tell whether arrays are points of the manifold.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            Candidate points.
        atol : float
            Absolute tolerance.

        Returns
        -------
        array of bool, shape (...)
            Arrays of another shape are not points; there is one answer for each index of their
            leading axes.
        """

    @abstractmethod
    def to_tangent(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        r"""Project arrays to the tangent space at a point.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Arrays.
        base_point : array, shape (..., \*shape), optional
            Points; needed unless the tangent space is the same at all of them.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        ArgumentTypeError
            If no point is given where one is needed.
        """

    @abstractmethod
    def random_point(self, n_samples: int = 1, bound: float = 1.0, rng: Rng = None) -> ndarray:
        r"""Draw random points, from no distribution in particular.

        Parameters
        ----------
        n_samples : int
            Number of points.
        bound : float
            How far they spread, where the manifold is not compact.
        rng : int or numpy.random.Generator, optional
            Seed, or the generator to draw from; by default every call draws anew.

        Returns
        -------
        array, shape (n_samples, \*shape), or (\*shape,) for one sample
        """

    def is_tangent(
        self, vector: ndarray, base_point: ndarray | None = None, atol: float = 1e-9
    ) -> ndarray:
        r"""Tell whether arrays are tangent vectors at a point.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Candidate tangent vectors.
        base_point : array, shape (..., \*shape), optional
            Points; needed unless the tangent space is the same at all of them.
        atol : float
            Absolute tolerance.

        Returns
        -------
        array of bool, shape (...)
        """
        vector, finite = self._candidates(vector, "vector")
        if base_point is not None:
            base_point = self.check_point(base_point, "base_point")
            vector = vector + np.zeros_like(base_point)
        error = np.abs(vector - self.to_tangent(vector, base_point))
        return finite & np.all(error <= atol, axis=self._point_axes)

    def random_tangent_vec(
        self, base_point: ndarray | None = None, n_samples: int = 1, rng: Rng = None
    ) -> ndarray:
        r"""Draw random tangent vectors, one at each of several points or several at one.

        Parameters
        ----------
        base_point : array, shape (\*shape,) or (n, \*shape), optional
            Points; needed unless the tangent space is the same at all of them.
        n_samples : int
            Number of tangent vectors; for n > 1 points it may be 1 or n, with the same effect.
        rng : int or numpy.random.Generator, optional
            Seed, or the generator to draw from; by default every call draws anew.

        Returns
        -------
        array, shape (n_samples, \*shape), or that of `base_point` for one sample

        Raises
        ------
        ArgumentError
            If there are several samples and another number of several points.
        """
        n_samples = sample_count(n_samples)
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

    def projection(self, point: ndarray) -> ndarray:
        r"""Project arrays near the manifold to it, differentiably.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            Arrays near the manifold.

        Returns
        -------
        array, shape (..., \*shape)
        """
        return point

    def check_point(self, point: Any, name: str = "point") -> ndarray:
        r"""Return points as float64 arrays after checking them.

        Parameters
        ----------
        point : array_like, shape (..., \*shape)
            Points, or rows of as many numbers as a point has, shape (..., n).
        name : str
            Name of the argument, for messages.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        ArgumentError
            If the shape is wrong or there are NaN or infinite entries.
        """
        return real_array(point, name, self.shape, rows=True)

    def check_scale(self, point: ndarray, name: str = "point") -> None:
        r"""Refuse points that are measured in another unit of length, where there is one.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            Points.
        name : str
            Name of the argument, for messages.
        """

    def needed_base_point(self, base_point: ndarray | None) -> ndarray:
        r"""Return a base point, or say that one is needed.

        Parameters
        ----------
        base_point : array, shape (..., \*shape), optional
            Points.

        Returns
        -------
        array, shape (..., \*shape)

        Raises
        ------
        ArgumentTypeError
            If there is none.
        """
        if base_point is None:
            raise ArgumentTypeError(
                "base_point must be given: tangent vectors and inner products of "
                f"{type(self).__name__} depend on it"
            )
        return base_point

    @property
    def _point_axes(self) -> tuple[int, ...]:
        return tuple(range(-self.point_ndim, 0))

    def _candidates(
        self, array: ndarray, name: str, finite: bool = True
    ) -> tuple[ndarray, ndarray]:
        """Return arrays of the points' shape, and which of them are those that were given.

        The others, of another shape or, if `finite`, with entries that are not, become 0.
        """
        values = real_array(values_of(array, name), name, finite=False)
        leading = values.shape[: max(values.ndim - self.point_ndim, 0)]
        if values.shape != (*leading, *self.shape):
            return np.zeros((*leading, *self.shape)), np.zeros(leading, dtype=bool)
        if not finite:
            return values, np.ones(leading, dtype=bool)
        good = np.all(np.isfinite(values), axis=self._point_axes)
        return np.where(np.expand_dims(good, self._point_axes), values, 0.0), good
