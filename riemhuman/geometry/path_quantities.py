"""Energies and lengths of discrete paths."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np
from autograd import value_and_grad
from numpy import ndarray

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.kernels.scalars import square_root


class PathQuantities:
    """Energies of discrete paths with their gradients, and lengths.

    A part of `RiemannianMetric`, whose other methods it uses.
    """

    def energy(self: Any, path: ndarray) -> ndarray:
        r"""Return the energy of discrete paths with n segments.

        :math:`n \sum_i d^2(x_i, x_{i+1})` where `squared_dist` has a closed form, else the finite
        differences :math:`n \sum_i \|x_{i+1} - x_i\|^2` at the midpoints of the segments
        (equation 7 of the paper).

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
            Paths.

        Returns
        -------
        array, shape (...)
        """
        path = self._check_path(path)
        n_segments = path.shape[-len(self.space.shape) - 1] - 1
        return n_segments * np.sum(self._squared_segments(path), axis=-1)

    def energy_and_gradient(self: Any, path: ndarray) -> tuple[float, ndarray]:
        r"""Return the energy of one path and its gradient.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
            Path.

        Returns
        -------
        energy : float
            May be infinite at a path that leaves the manifold.
        gradient : array, shape (n_times, \*shape)
            Derivatives with respect to all entries of the path.
        """
        path = self.check_points(path, "path")
        energy, gradient = value_and_grad(self.energy)(path)
        return float(energy), gradient

    def squared_dists_and_gradient(
        self: Any, point: ndarray, others: ndarray, weights: ndarray
    ) -> tuple[ndarray, ndarray]:
        r"""Return the squared distances of a point from others, and the gradient of their sum.

        Distances are energies of paths of one segment.

        Parameters
        ----------
        point : array, shape (\*shape,)
            Point x.
        others : array, shape (n, \*shape)
            Points x_i.
        weights : array, shape (n,)
            Weights w_i > 0.

        Returns
        -------
        squared : array, shape (n,)
            d(x_i, x)², infinite where x or x_i leaves the manifold.
        gradient : array, shape (\*shape,)
            Gradient of Σ_i w_i d(x_i, x)² with respect to x.
        """
        squared, gradient = np.empty(len(others)), np.zeros(np.shape(point))
        for i, (weight, other) in enumerate(zip(weights, others, strict=True)):
            squared[i], slopes = self.energy_and_gradient(np.stack([other, point]))
            gradient += weight * slopes[1]
        return squared, gradient

    def remove_drift(self: Any, path: ndarray) -> ndarray:
        r"""Move interior points of a path by motions the metric does not see, if there are any.

        Parameters
        ----------
        path : array, shape (n_times, \*shape)
            Path.

        Returns
        -------
        array, shape (n_times, \*shape)
            A path of the same energy; by default the same path.
        """
        return path

    def length(self: Any, path: ndarray) -> ndarray:
        r"""Return the length of discrete paths, the sum of the lengths of their segments.

        Parameters
        ----------
        path : array, shape (..., n_times, \*shape)
            Paths.

        Returns
        -------
        array, shape (...)
        """
        path = self._check_path(path)
        self.space.check_scale(path, "path")
        return np.sum(square_root(self._squared_segments(path)), axis=-1)

    def _squared_segments(self: Any, path: ndarray) -> ndarray:
        before: Any = (..., slice(None, -1), *self._whole_point)
        after: Any = (..., slice(1, None), *self._whole_point)
        start, end = path[before], path[after]
        if self.has_closed_form_dist:
            return self.squared_dist(start, end)
        return self.squared_norm(end - start, self.space.projection(0.5 * (start + end)))

    @property
    def _whole_point(self: Any) -> tuple[slice, ...]:
        return (slice(None),) * len(self.space.shape)

    def _check_path(self: Any, path: ndarray, batched: bool = True) -> ndarray:
        path = real_array(path, "path", ("n_times", *self.space.shape), batched=batched)
        n_times = path.shape[-len(self.space.shape) - 1]
        if n_times < 2:
            raise ArgumentError(f"path must have at least two times; found {n_times}")
        return path
