"""Terms that have an inner product at every surface, and no distance in closed form."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy import ndarray
from scipy.sparse import csr_array

from riemhuman.checks import values_of
from riemhuman.kernels import surface
from riemhuman.kernels.triangles import by_vertex

Slopes = tuple[float, ndarray, ndarray]


class QuadraticTerm(ABC):
    """A term of a metric on surfaces, given by its inner product."""

    is_translation_invariant = True
    is_stretch_invariant = False
    is_reparametrization_invariant = False

    @abstractmethod
    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of deformations, by `autograd.numpy`: the definition."""

    @abstractmethod
    def matrix(self, f: ndarray) -> csr_array:
        """Return the matrix M of the inner product, ⟨h, k⟩ = h·(M k), vertices flattened."""

    def squared_norms(self, vectors: ndarray, surfaces: ndarray) -> float:
        """Return the sum of the squared norms of deformations, see `squared_norms_and_slopes`."""
        return self.squared_norms_and_slopes(vectors, surfaces)[0]

    @abstractmethod
    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        """Return the sum of the squared norms of deformations at surfaces, and its slopes."""


class SumOfQuadraticTerms:
    """The driver of a sum of terms that are given by their inner products."""

    term_class = QuadraticTerm

    def __init__(self, terms: Sequence[QuadraticTerm], template: Any) -> None:
        self.terms, self.template = tuple(terms), template

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        """Return the inner product of deformations."""
        self._refuse_degenerate(f)
        total: Any = 0.0
        for term in self.terms:
            total = total + term.inner_product(h, k, f)
        return total

    def matrix(self, surfaces: ndarray) -> csr_array:
        """Return the matrix of the inner product, the mean over surfaces."""
        self._refuse_degenerate(surfaces)
        size = surfaces[0].size
        total = csr_array((size, size))
        for f in surfaces:
            for term in self.terms:
                total = total + term.matrix(f)
        return total / len(surfaces)

    def path_energy(self, path: ndarray, *, gradient: bool = True) -> tuple[float, Any]:
        """Return n Σ G at the midpoints of the n segments of a path, and its gradient."""
        n_segments = len(path) - 1
        surfaces, steps = by_vertex(0.5 * (path[:-1] + path[1:])), by_vertex(np.diff(path, axis=0))
        if not gradient:
            values = sum(term.squared_norms(steps, surfaces) for term in self.terms)
            return n_segments * float(values), None
        parts = [term.squared_norms_and_slopes(steps, surfaces) for term in self.terms]
        values, in_steps, in_surfaces = (sum(part) for part in zip(*parts, strict=True))
        slopes = np.zeros(path.shape)
        slopes[:-1] = by_vertex(0.5 * in_surfaces - in_steps)
        slopes[1:] += by_vertex(0.5 * in_surfaces + in_steps)
        return n_segments * float(values), n_segments * slopes

    def _refuse_degenerate(self, f: ndarray) -> None:
        first = surface.derivatives(values_of(f), self.template.differential_operator)
        surface.refuse_degenerate(first.degenerate, "base_point")
