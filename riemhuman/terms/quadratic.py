"""What a term is that has an inner product at every surface, and no distance in closed form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

from numpy import ndarray
from scipy.sparse import csr_array

from riemhuman.docstrings import inherit_sections

Slopes = tuple[float, ndarray, ndarray]


class QuadraticTerm(ABC):
    """One term of a metric on surfaces that is given by its inner product.

    Attributes
    ----------
    sees_translations : bool
        Whether translations cost something.
    """

    sees_translations = False

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        inherit_sections(cls)

    @abstractmethod
    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of deformations, by `autograd.numpy`: the definition.

        Parameters
        ----------
        h, k : array, shape (..., V, 3)
            Deformations.
        f : array, shape (..., V, 3)
            Surfaces whose triangles have an area.

        Returns
        -------
        array, shape (...)
        """

    @abstractmethod
    def matrix(self, f: ndarray) -> csr_array:
        """Return the matrix M of the inner product, ⟨h, k⟩ = h·(M k), vertices flattened.

        Parameters
        ----------
        f : array, shape (V, 3)
            Surface whose triangles have an area.

        Returns
        -------
        csr_array, shape (3V, 3V)
        """

    @abstractmethod
    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        """Return the sum of the squared norms of deformations, each at its surface, and its slopes.

        Parameters
        ----------
        vectors, surfaces : array, shape (V, n, 3)
            Deformations and surfaces, vertex by vertex.

        Returns
        -------
        value : float
            Infinite where a triangle has no area.
        vector_slopes, surface_slopes : array, shape (V, n, 3)
            Slopes in the deformations and in the surfaces.
        """
