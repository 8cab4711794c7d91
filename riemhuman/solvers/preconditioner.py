r"""Variables in which the energy of a path over a basis is nearly a sum of squares.

Near a straight path the Hessian of the energy of n segments, in the coefficients α of the interior
times, is close to 2n (D ⊗ G): D = tridiag(−1, 2, −1) couples the times, G is the metric's Gram
matrix on the basis. With Cholesky factors of both, the change of variables α = L_D^{-T} β L_G^{-1}
makes the Hessian the identity.
"""

from __future__ import annotations

import numpy as np
from numpy import ndarray
from scipy import linalg

from riemhuman.errors import ArgumentError

INDEFINITE = (
    "the matrix of the metric is not positive semidefinite, or not finite; "
    "riemhuman.solvers.check_metric(metric, points) tells what is wrong"
)
"""What is said of a metric whose matrix has no Cholesky factor."""

# The Gram matrix is singular on deformations the metric does not see, translations for one.
_RIDGE = 1e-8


class CholeskyFactor:
    """Cholesky factor L of a positive semidefinite matrix with a tiny ridge, A ≈ L Lᵀ.

    Parameters
    ----------
    matrix : array, shape (K, K)
        Symmetric positive semidefinite matrix.

    Raises
    ------
    ArgumentError
        If the matrix is indefinite or not finite.
    """

    def __init__(self, matrix: ndarray) -> None:
        size = np.trace(matrix) / len(matrix)
        ridge = _RIDGE * (np.diag(matrix) + (size if size > 0 else 1.0))
        try:
            self._lower = linalg.cholesky(matrix + np.diag(ridge), lower=True)
        except (np.linalg.LinAlgError, ValueError) as error:
            raise ArgumentError(INDEFINITE) from error

    def solve(self, columns: ndarray) -> ndarray:
        """Return L⁻¹ X.

        Parameters
        ----------
        columns : array, shape (K, m)
            X.

        Returns
        -------
        array, shape (K, m)
        """
        return linalg.solve_triangular(self._lower, columns, lower=True, check_finite=False)

    def solve_transposed(self, columns: ndarray) -> ndarray:
        """Return L⁻ᵀ X.

        Parameters
        ----------
        columns : array, shape (K, m)
            X.

        Returns
        -------
        array, shape (K, m)
        """
        return linalg.solve_triangular(
            self._lower, columns, lower=True, trans="T", check_finite=False
        )

    def inverse(self, columns: ndarray) -> ndarray:
        """Return A⁻¹ X.

        Parameters
        ----------
        columns : array, shape (K, m)
            X.

        Returns
        -------
        array, shape (K, m)
        """
        return self.solve_transposed(self.solve(columns))


class PathPreconditioner:
    """The change of variables β ↦ α = L_D⁻ᵀ β L_G⁻¹/√(2n) for paths of n segments.

    Parameters
    ----------
    gram : CholeskyFactor
        Factor of the Gram matrix G of the basis, times any scale of the energy.
    n_segments : int
        Number of segments n, at least 2.
    """

    def __init__(self, gram: CholeskyFactor, n_segments: int) -> None:
        steps = np.diff(np.eye(n_segments), axis=0)
        self._time = CholeskyFactor(steps @ steps.T)
        self._inverse_time = self._time.inverse(np.eye(n_segments - 1))
        self._gram = gram
        self._scale = 1.0 / np.sqrt(2.0 * n_segments)

    def coefficients(self, variables: ndarray) -> ndarray:
        """Return the coefficients α of preconditioned variables β.

        Parameters
        ----------
        variables : array, shape (n_segments − 1, K)
            β.

        Returns
        -------
        array, shape (n_segments − 1, K)
        """
        return self._scale * self._time.solve_transposed(self._gram.solve_transposed(variables.T).T)

    def gradient(self, gradient: ndarray) -> ndarray:
        """Return the gradient in β from the gradient in α.

        Parameters
        ----------
        gradient : array, shape (n_segments − 1, K)
            Derivatives with respect to α.

        Returns
        -------
        array, shape (n_segments − 1, K)
        """
        return self._scale * self._time.solve(self._gram.solve(gradient.T).T)

    def inverse(self, gradient: ndarray) -> ndarray:
        """Return the inverse Hessian's image of the gradient in α.

        Parameters
        ----------
        gradient : array, shape (n_segments − 1, K)
            Derivatives with respect to α.

        Returns
        -------
        array, shape (n_segments − 1, K)
        """
        return self._scale**2 * self._inverse_time @ self._gram.inverse(gradient.T).T
