"""Orthonormal deformations of a surface, and coefficients with respect to them."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np
import numpy as onp
from numpy.typing import ArrayLike

from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import read_only
from riemhuman.surfaces.template import Template
from riemhuman.surfaces.vertex_weights import (
    normalized_weights,
    orthonormal_rows,
    vectors_of_rows,
    weighted_rows,
)

_ORTHONORMAL = 1e-8


class OrthonormalDeformations:
    r"""Orthonormal deformations :math:`D_k`, which combine coefficients and project deformations.

    `riemhuman.DeformationBasis` adds constructors and files.

    Parameters
    ----------
    vectors : array_like, shape (K, V, 3)
        The deformations; they are copied.
    orthonormalize : bool
        Whether to make them orthonormal; by default they are checked to be orthonormal within 1e-8.
    vertex_weights : array_like, shape (V,), optional
        Positive weights of the inner product.
    """

    # Read by the fingerprint of a job: the kept vectors are orthonormal whatever the argument was.
    _orthonormalize = False

    def __init__(
        self,
        vectors: ArrayLike,
        *,
        orthonormalize: bool = False,
        vertex_weights: ArrayLike | None = None,
    ) -> None:
        values = real_array(vectors, "vectors", ("n_components", "n_vertices", 3), batched=False)
        if values.size == 0:
            raise ArgumentError(f"vectors holds no deformation; found shape {values.shape}")
        self._weights = normalized_weights(vertex_weights, values.shape[1])
        if orthonormalize:
            rows = orthonormal_rows(weighted_rows(values, self._weights), "vectors")
            self._vectors = read_only(vectors_of_rows(rows, self._weights))
        else:
            self._vectors = read_only(onp.array(values, order="C"))
            self._check_orthonormal()

    @property
    def vectors(self) -> onp.ndarray:
        """The deformations, shape (K, V, 3), read-only, orthonormal."""
        return self._vectors

    @property
    def flat(self) -> onp.ndarray:
        """The deformations as rows, shape (K, 3V), read-only, C-contiguous, not copied."""
        return self._vectors.reshape(len(self), -1)

    @property
    def n_components(self) -> int:
        """Number of deformations K."""
        return len(self._vectors)

    @property
    def n_vertices(self) -> int:
        """Number of vertices V."""
        return self._vectors.shape[1]

    @property
    def vertex_weights(self) -> onp.ndarray | None:
        """Weights of the inner product, shape (V,), of mean 1; None if all are 1."""
        return self._weights

    def coefficients(self, deformation: Any) -> Any:
        """Return the inner products of deformations with the vectors.

        Parameters
        ----------
        deformation : array_like, shape (..., V, 3)
            Deformations; no mean is subtracted.

        Returns
        -------
        coefficients : array, shape (..., K)

        Raises
        ------
        ArgumentError
            If the shape is wrong or an entry is not finite.
        """
        deformation = real_array(deformation, "deformation", (self.n_vertices, 3))
        if self._weights is not None:
            deformation = deformation * self._weights[:, onp.newaxis]
        rows = np.reshape(deformation, (*deformation.shape[:-2], -1))
        return np.matmul(rows, self.flat.T)

    def combine(self, coefficients: Any) -> Any:
        r"""Return the deformations :math:`\sum_k \alpha_k D_k`.

        Parameters
        ----------
        coefficients : array_like, shape (..., K)
            Coefficients α.

        Returns
        -------
        deformation : array, shape (..., V, 3)

        Raises
        ------
        ArgumentError
            If the shape is wrong or an entry is not finite.
        """
        coefficients = real_array(coefficients, "coefficients", (len(self),))
        rows = np.matmul(coefficients, self.flat)
        return np.reshape(rows, (*coefficients.shape[:-1], self.n_vertices, 3))

    def project(self, deformation: Any) -> Any:
        """Project deformations onto the span of the vectors.

        Parameters
        ----------
        deformation : array_like, shape (..., V, 3)
            Deformations.

        Returns
        -------
        projection : array, shape (..., V, 3)

        Raises
        ------
        ArgumentError
            If the shape is wrong or an entry is not finite.
        """
        return self.combine(self.coefficients(deformation))

    def check_fits(self, template: Template | int) -> None:
        """Refuse a template with another number of vertices.

        Parameters
        ----------
        template : Template or int
            The template, or its number of vertices.

        Raises
        ------
        ArgumentError
            If the number of vertices differs.
        """
        expected = template.n_vertices if isinstance(template, Template) else template
        if self.n_vertices != expected:
            raise ArgumentError(
                f"the basis belongs to another template: it has {self.n_vertices} vertices, "
                f"the template has {expected}"
            )

    def __len__(self) -> int:
        return self.n_components

    def __repr__(self) -> str:
        weights = "" if self._weights is None else ", weighted"
        return (
            f"{type(self).__name__}(n_components={self.n_components}, "
            f"n_vertices={self.n_vertices}{weights})"
        )

    def _check_orthonormal(self) -> None:
        rows = weighted_rows(self._vectors, self._weights)
        with onp.errstate(over="ignore", invalid="ignore"):
            deviation = float(onp.abs(rows @ rows.T - onp.eye(len(rows))).max())
        if not deviation <= _ORTHONORMAL:
            raise ArgumentError(
                f"vectors must be orthonormal within {_ORTHONORMAL:g}; their inner products are "
                f"up to {deviation:.3g} away from it: pass orthonormalize=True to make them so"
            )
