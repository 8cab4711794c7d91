"""The abstract manifold."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Self

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, generator, real_array, values_of, whole_number
from riemhuman.errors import ArgumentTypeError

if TYPE_CHECKING:
    from riemhuman.geometry.metric import RiemannianMetric


class Manifold(ABC):
    r"""A manifold whose points and tangent vectors are arrays of one shape.

    Subclasses say which arrays are points (`belongs`), project to the tangent spaces
    (`to_tangent`) and make examples (`random_point`).

    Parameters
    ----------
    dim : int
        Dimension.
    shape : tuple of int
        Shape of one point.
    equip : bool
        Whether to equip the manifold with its default metric.

    Attributes
    ----------
    dim : int
        Dimension.
    shape : tuple of int
        Shape of one point.
    metric : RiemannianMetric
        The metric the manifold was equipped with last.
    """

    metric: RiemannianMetric

    def __init__(self, dim: int, shape: tuple[int, ...], equip: bool = True) -> None:
        self.dim = dim
        self.shape = shape
        if equip and self.default_metric() is not None:
            self.equip_with_metric()

    @property
    def point_ndim(self) -> int:
        """The number of axes of one point."""
        return len(self.shape)

    def default_metric(self) -> type[RiemannianMetric] | None:
        """Return the class of the metric the manifold comes with, if there is one."""
        return None

    def equip_with_metric(
        self, metric_class: type[RiemannianMetric] | None = None, **parameters: Any
    ) -> Self:
        """Equip the manifold with a metric, `metric_class(self, **parameters)`.

        Parameters
        ----------
        metric_class : type, optional
            Subclass of `RiemannianMetric`; by default the manifold's own.
        **parameters
            Parameters of the metric.

        Returns
        -------
        Manifold
            The manifold itself.

        Raises
        ------
        ArgumentTypeError
            If no class is named and the manifold has no default metric.
        """
        metric_class = metric_class or self.default_metric()
        if metric_class is None:
            raise ArgumentTypeError(
                f"metric_class must be named: {type(self).__name__} has no default metric"
            )
        self.metric = metric_class(self, **parameters)
        return self

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
        """

    @abstractmethod
    def to_tangent(self, vector: ndarray, base_point: ndarray) -> ndarray:
        r"""Project arrays to the tangent space at a point.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Arrays.
        base_point : array, shape (..., \*shape)
            Points.

        Returns
        -------
        array, shape (..., \*shape)
        """

    @abstractmethod
    def random_point(self, n_samples: int = 1, rng: Rng = 0) -> ndarray:
        r"""Draw random points, from no distribution in particular.

        Parameters
        ----------
        n_samples : int
            Number of points.
        rng : int or numpy.random.Generator
            Seed, or the generator to draw from.

        Returns
        -------
        array, shape (n_samples, \*shape), or (\*shape,) for one sample
        """

    def is_tangent(self, vector: ndarray, base_point: ndarray, atol: float = 1e-9) -> ndarray:
        r"""Tell whether arrays are tangent vectors at a point.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Candidate tangent vectors.
        base_point : array, shape (..., \*shape)
            Points.
        atol : float
            Absolute tolerance.

        Returns
        -------
        array of bool, shape (...)
        """
        base_point = self.check_point(base_point, "base_point")
        vector, finite = self._finite_values(vector, "vector")
        vector = vector + np.zeros_like(base_point)
        error = np.abs(vector - self.to_tangent(vector, base_point))
        return finite & np.all(error <= atol, axis=self._point_axes)

    def random_tangent_vec(self, base_point: ndarray, n_samples: int = 1, rng: Rng = 0) -> ndarray:
        r"""Draw random tangent vectors.

        Parameters
        ----------
        base_point : array, shape (..., \*shape)
            Points; several of them with more than one sample give the samples on the first axis.
        n_samples : int
            Number of tangent vectors at each point.
        rng : int or numpy.random.Generator
            Seed, or the generator to draw from.

        Returns
        -------
        array, shape (n_samples, ..., \*shape), or (..., \*shape) for one sample
        """
        base_point = self.check_point(base_point, "base_point")
        n_samples = sample_count(n_samples)
        leading = () if n_samples == 1 else (n_samples,)
        noise = generator(rng).standard_normal(leading + base_point.shape)
        return self.to_tangent(noise, base_point)

    def regularize(self, point: ndarray) -> ndarray:
        r"""Bring arrays that are slightly off the manifold back to it, differentiably.

        Parameters
        ----------
        point : array, shape (..., \*shape)
            Arrays near the manifold.

        Returns
        -------
        array, shape (..., \*shape)
        """
        return point

    def check_point(self, point: ndarray, name: str = "point") -> ndarray:
        r"""Return points as float64 arrays, or say what is wrong with them.

        Parameters
        ----------
        point : array_like, shape (..., \*shape)
            Points.
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
        return real_array(point, name, self.shape)

    @property
    def _point_axes(self) -> tuple[int, ...]:
        return tuple(range(-self.point_ndim, 0))

    def _finite_values(self, array: ndarray, name: str) -> tuple[ndarray, ndarray]:
        """Return the arrays, 0 in place of those that are not finite, and which are finite."""
        values = real_array(values_of(array), name, self.shape, finite=False)
        finite = np.all(np.isfinite(values), axis=self._point_axes)
        return np.where(np.expand_dims(finite, self._point_axes), values, 0.0), finite


def sample_count(n_samples: int) -> int:
    """Return the number of samples asked for, at least one.

    Parameters
    ----------
    n_samples : int
        Number of samples.

    Returns
    -------
    int

    Raises
    ------
    ArgumentTypeError
        If the number is not an integer.
    ArgumentError
        If it is below 1.
    """
    return whole_number(n_samples, "n_samples", minimum=1)


def stack_samples(samples: ndarray, n_samples: int) -> ndarray:
    """Drop the first axis when one sample was asked for.

    Parameters
    ----------
    samples : array, shape (n_samples, ...)
        Samples.
    n_samples : int
        Number of samples.

    Returns
    -------
    array, shape (n_samples, ...), or (...) for one sample
    """
    return samples[0] if n_samples == 1 else samples
