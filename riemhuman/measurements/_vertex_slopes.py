"""Derivatives of measurements by the vertices of bodies, as terms that are added when needed.

A girth depends on about a hundred vertices, a volume on all of them. Each line, place or axis comes
with a function that receives the derivatives with respect to it and adds those with respect to the
vertices: the chain rule, backwards.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy import sparse

from riemhuman.arrays import Array, Integers


class VertexSlopes:
    """Derivatives of one measurement of each of n bodies by its vertices, shape (n, V, 3)."""

    def __init__(self, shape: tuple[int, int, int]) -> None:
        self.shape = shape
        self._terms: list[tuple[Integers, Integers, Array]] = []
        self._of_all: Array | None = None

    def add(self, bodies: Integers, vertices: Integers, slopes: Array) -> None:
        """Add derivatives by vertices of bodies, shape (..., 3); their numbers are broadcast."""
        self._terms.append((bodies, vertices, slopes))

    def add_of_all(self, slopes: Array) -> None:
        """Add derivatives by all vertices of all bodies."""
        self._of_all = slopes if self._of_all is None else self._of_all + slopes

    def by_vertex(self) -> Array:
        """Return the derivatives, shape (n, V, 3)."""
        total = np.zeros(self.shape) if self._of_all is None else self._of_all.copy()
        for bodies, vertices, slopes in self._terms:
            np.add.at(total, (bodies, vertices), slopes)
        return total

    def of_one_body(self) -> tuple[Integers, Array, Array | None]:
        """Return vertex numbers with their derivatives, which add up to the total."""
        vertices, slopes = [np.empty(0, np.int64)], [np.empty((0, 3))]
        for _, numbers, terms in self._terms:
            vertices.append(numbers.ravel())
            slopes.append(terms.reshape(-1, 3))
        of_all = None if self._of_all is None else self._of_all.ravel()
        return np.concatenate(vertices), np.concatenate(slopes), of_all


Pull = Callable[[Array, VertexSlopes], None]
"""Adds the derivatives by vertices, given those by something that depends on them, (n, 3)."""


def fixed(upstream: Array, slopes: VertexSlopes) -> None:
    """Add nothing, for values that do not depend on the vertices."""


def slopes_along(measurements: Sequence[VertexSlopes], directions: Array) -> Array:
    """Return derivatives of measurements of one body along columns of directions, (3V, K)."""
    parts = [slopes.of_one_body() for slopes in measurements]
    vertices = np.concatenate([numbers for numbers, _, _ in parts])
    values = np.concatenate([slopes for _, slopes, _ in parts])
    columns = 3 * vertices[:, np.newaxis] + np.arange(3)
    ends = 3 * np.cumsum([0, *(len(numbers) for numbers, _, _ in parts)])
    terms = values.ravel(), columns.ravel(), ends
    along: Array = sparse.csr_array(terms, shape=(len(parts), len(directions))) @ directions
    rows = [row for row, (_, _, of_all) in enumerate(parts) if of_all is not None]
    if rows:
        along[rows] += np.array([parts[row][2] for row in rows]) @ directions
    return along
