"""Terms whose fields are compared by their differences, as vectors."""

from __future__ import annotations

import math
from abc import abstractmethod

import autograd.numpy as np
from numpy import ndarray

from riemhuman.kernels.compiled import SUM, compiled, squared_differences
from riemhuman.kernels.surface import Derivatives, dot
from riemhuman.kernels.tiles import CHUNK, LARGEST, UNDERFLOW, of_one_kind, padded, rounding
from riemhuman.terms.term import Fields, Term

# Numbers summed in the precision of the features before they join the sum over all.
_CHUNK = 2 * CHUNK


class FlatTerm(Term):
    r"""A term with the L² distance :math:`\int_T \|\varphi(f_1) - \varphi(f_2)\|^2 dx`.

    A subclass defines `field` alone; distances of many pairs run in compiled loops.

    Parameters
    ----------
    weight : float
        w > 0.

    Examples
    --------
    >>> import riemhuman as rh
    >>> class AreaVectors(rh.terms.FlatTerm):
    ...     def field(self, first):
    ...         return first.area_vectors
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> metric = rh.SurfaceMetric(rh.AlignedSurfaces(bodies.template), [AreaVectors()])
    >>> bool(metric.dist(bodies[0], bodies[1]) > 0)
    True
    """

    single = True

    @abstractmethod
    def field(self, first: Derivatives) -> ndarray:
        """Return the field φ(f) of surfaces.

        Parameters
        ----------
        first : Derivatives
            First derivatives of surfaces, arrays of shape (..., F) and (..., F, 3).

        Returns
        -------
        array, shape (..., F, n)
        """

    def fields(self, first: Derivatives) -> Fields:
        return (self.field(first),)

    def squared_dist(self, fields_a: Fields, fields_b: Fields) -> ndarray:
        difference = fields_a[0] - fields_b[0]
        return dot(difference, difference)

    def inner_product(self, changes_a: Fields, changes_b: Fields, fields: Fields) -> ndarray:
        return dot(changes_a[0], changes_b[0])

    def chart(self, fields: Fields) -> ndarray:
        return fields[0]

    def pack(self, fields: Fields, areas: ndarray, kept: ndarray) -> float:
        # Write the field times √w; return the squared distance to what is written.
        return pack_vector(of_one_kind(np.sqrt(areas)[:, None] * fields[0]).reshape(-1), kept)

    def squared_distances(self, a: ndarray, b: ndarray, areas: ndarray) -> ndarray:
        return flat_distances(a, b)


def vector_features(vectors: ndarray, weights: ndarray, precision: str) -> tuple[ndarray, ndarray]:
    """Return the features of sets of vectors with a weighted sum of squares for squared norm.

    Parameters
    ----------
    vectors : array, shape (n, m, k)
        n sets of m vectors.
    weights : array, shape (m,)
        Weights w of the vectors.
    precision : {"single", "double"}
        Precision of the features.

    Returns
    -------
    features : array, shape (n, (mk)⁺)
        Components times √w.
    rounding : array, shape (n,)
        Bound on the distance to the vectors that the features stand for.
    """
    scaled = np.sqrt(weights)[:, None] * vectors
    flat = of_one_kind(scaled.reshape(len(vectors), vectors.shape[1] * vectors.shape[2]))
    features = padded(flat.shape, precision)
    gaps = [
        rounding(pack_vector(row, kept), kept) for row, kept in zip(flat, features, strict=True)
    ]
    return features, np.array(gaps)


@compiled(fastmath=SUM)
def pack_vector(vector: ndarray, kept: ndarray) -> float:
    """Write a vector; return the squared distance to what is written.

    Parameters
    ----------
    vector : array, shape (n,)
        The vector, see `riemhuman.kernels.tiles.of_one_kind`.
    kept : array of float32 or float64, shape (at least n,)
        Features.

    Returns
    -------
    float
        Infinite where single precision has no room for it.
    """
    gap = UNDERFLOW * len(vector)
    for k in range(len(vector)):
        kept[k] = vector[k]
        gap += (vector[k] - kept[k]) ** 2 if abs(vector[k]) < LARGEST else math.inf
    return gap


@compiled
def _tile(a: ndarray, b: ndarray, within: bool, squared: ndarray) -> None:
    n_values, n_rows, n_columns = a.shape[1], len(a), len(b)
    for first in range(0, n_values, _CHUNK):
        last = min(first + _CHUNK, n_values)
        for j in range(0, n_columns, 4):
            # At the edge, the last vector comes again.
            end = n_columns - 1
            columns = (j, min(j + 1, end), min(j + 2, end), min(j + 3, end))
            n_above = min(j + 4, n_rows) if within else n_rows
            n_whole = n_above - n_above % 4
            for i in range(0, n_whole, 4):
                rows = (i, i + 1, i + 2, i + 3)
                _add(squared, i, j, squared_differences(a, b, rows, columns, first, last))
            for i in range(n_whole, n_above):
                _add(squared, i, j, squared_differences(a, b, (i,), columns, first, last))


@compiled(forceinline=True)
def _add(squared: ndarray, i: int, j: int, sums: tuple[float, ...]) -> None:
    """Add the sums of rows from the i-th on with four columns from the j-th on."""
    for k in range(len(sums)):
        if j + k % 4 < squared.shape[1]:
            squared[i + k // 4, j + k % 4] += sums[k]


def flat_distances(a: ndarray, b: ndarray) -> ndarray:
    """Return squared Euclidean distances of vectors, from their differences.

    A product of matrices, ‖a‖² + ‖b‖² − 2 ⟨a, b⟩, loses the digits of what is close; with these
    pairs summed again by differences, it takes no less time.

    Parameters
    ----------
    a, b : array of float32 or float64, shape (n_a, k⁺) and (n_b, k⁺)
        Vectors, see `vector_features`; for the distances within one set, one array twice, and what
        is above the diagonal counts.

    Returns
    -------
    array, shape (n_a, n_b)
    """
    squared = np.zeros((len(a), len(b)))
    _tile(a, b, a is b, squared)
    return squared
