"""Quantities derived from the inner product, distances and curvature of a metric."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np
from numpy import ndarray

from riemhuman.checks import Rng, whole_number
from riemhuman.errors import NotDefinedError
from riemhuman.geometry.pairwise import Points


class DerivedQuantities:
    """Unit vectors, diameters and curvature of a metric.

    A part of `RiemannianMetric`, whose other methods it uses. Subclasses that know their curvature
    define `curvature_form`, and `injectivity_radius` if they know that too.
    """

    def normalize(self, vector: ndarray, base_point: ndarray | None = None) -> ndarray:
        r"""Return tangent vectors scaled to norm 1; zero vectors stay zero.

        Parameters
        ----------
        vector : array, shape (..., \*shape)
            Tangent vectors.
        base_point : array, shape (..., \*shape), optional
            Base point.

        Returns
        -------
        array, shape (..., \*shape)
        """
        metric: Any = self
        norm = metric.norm(vector, base_point)
        scale = 1.0 / np.where(norm == 0.0, 1.0, norm)
        return np.expand_dims(scale, metric.space._point_axes) * vector

    def random_unit_tangent_vec(
        self, base_point: ndarray | None = None, n_vectors: int = 1, rng: Rng = None
    ) -> ndarray:
        r"""Draw random tangent vectors of norm 1.

        Parameters
        ----------
        base_point : array, shape (\*shape,) or (n, \*shape), optional
            Points; needed unless tangent spaces and inner products are the same at all of them.
        n_vectors : int
            Number of vectors; at several points, one at each.
        rng : int or numpy.random.Generator, optional
            Seed, or the generator to draw from; by default every call draws anew.

        Returns
        -------
        array, shape (n_vectors, \*shape), or that of `base_point` for one vector
        """
        metric: Any = self
        n_vectors = whole_number(n_vectors, "n_vectors", minimum=1)
        vector = metric.space.random_tangent_vec(base_point, n_vectors, rng)
        return self.normalize(vector, base_point)

    def diameter(self, points: Points) -> float:
        r"""Return the largest distance between some points.

        Parameters
        ----------
        points : array, shape (n, \*shape)
            Points.

        Returns
        -------
        float
        """
        metric: Any = self
        return float(np.max(metric.dist_pairwise(points, precision="double")))

    def injectivity_radius(self, base_point: ndarray | None = None) -> ndarray:
        r"""Return the radius of the largest ball in which `exp` is one to one.

        Parameters
        ----------
        base_point : array, shape (..., \*shape), optional
            Points.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        NotDefinedError
            If the class does not know it.
        """
        raise NotDefinedError(f"{type(self).__name__} has no closed form for injectivity_radius")

    def curvature_form(
        self, tangent_vec_a: ndarray, tangent_vec_b: ndarray, base_point: ndarray
    ) -> ndarray:
        r"""Return ⟨R(a, b) b, a⟩, R the curvature tensor.

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., \*shape)
            Tangent vectors a and b.
        base_point : array, shape (..., \*shape)
            Base point.

        Returns
        -------
        array, shape (...)

        Raises
        ------
        NotDefinedError
            If the class does not know it.
        """
        raise NotDefinedError(f"{type(self).__name__} has no closed form for curvature")

    def sectional_curvature(
        self,
        tangent_vec_a: ndarray,
        tangent_vec_b: ndarray,
        base_point: ndarray | None = None,
    ) -> ndarray:
        r"""Return the sectional curvature of the planes spanned by two tangent vectors.

        .. math:: K = \frac{\langle R(a, b) b, a\rangle}{\|a\|^2\|b\|^2 - \langle a, b\rangle^2}

        Parameters
        ----------
        tangent_vec_a, tangent_vec_b : array, shape (..., \*shape)
            Tangent vectors a and b.
        base_point : array, shape (..., \*shape), optional
            Base point.

        Returns
        -------
        array, shape (...)
            NaN where the vectors span no plane.

        Raises
        ------
        NotDefinedError
            If the class does not know its curvature.
        """
        metric: Any = self
        form = metric.curvature_form(tangent_vec_a, tangent_vec_b, base_point)
        product = metric.inner_product(tangent_vec_a, tangent_vec_b, base_point)
        squares = metric.squared_norm(tangent_vec_a, base_point) * metric.squared_norm(
            tangent_vec_b, base_point
        )
        area = squares - product**2
        flat = area <= 1e-14 * squares
        return np.where(flat, np.nan, form / np.where(flat, 1.0, area))
