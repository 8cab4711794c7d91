"""The base class of descriptors: vectors that represent meshes, and their distances."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import pdist, squareform

from riemhuman.arrays import Array
from riemhuman.checks import real_array
from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.kernels.threads import mapped, thread_count
from riemhuman.representation import constructor_text

if TYPE_CHECKING:
    from riemhuman.datasets import Bodies

Mesh = tuple[ArrayLike, ArrayLike]


class Descriptor(ABC):
    """A vector that represents a surface, with a distance between such vectors.

    Subclasses are frozen dataclasses of parameters. They define `describe`, and `distances` if the
    distance is not Euclidean.

    Examples
    --------
    >>> class Height(rh.descriptors.Descriptor):
    ...     def describe(self, vertices, faces):
    ...         return np.ptp(vertices[:, 1:2], axis=0)
    >>> described = Height().describe_all(rh.datasets.load_open_bodies("coarse"))
    >>> Height().distances(described).shape
    (100, 100)
    """

    # Whether threads make `describe_all` faster.
    _in_threads = True

    def __repr__(self) -> str:
        return constructor_text(self)

    @abstractmethod
    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> Array:
        """Return the vector of one surface.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.
        """

    def describe_all(self, bodies: Surfaces, n_jobs: int | None = None) -> Array:
        """Return the vectors of many surfaces.

        Parameters
        ----------
        bodies : Bodies or iterable of (vertices, faces)
            Registered surfaces, or meshes. Those of a sequence, such as
            `riemhuman.datasets.LabelledMeshes`, are read one at a time.
        n_jobs : int, optional
            Number of threads, -1 for one per core; by default one. Spectra are always computed one
            at a time.
        """
        count, mesh = meshes_of(bodies)

        def describe(index: int) -> Array:
            try:
                return self.describe(*mesh(index))
            except RiemhumanError as error:
                raise type(error)(f"body {index}: {error}") from error

        n_threads = thread_count(n_jobs) if self._in_threads else 1
        return np.stack(list(mapped(describe, range(count), n_threads)))

    def distances(self, vectors: ArrayLike) -> Array:
        """Return all distances within a set of vectors.

        Parameters
        ----------
        vectors : array_like, shape (n, d)
            Vectors of `describe`, one per row.
        """
        return pairwise(vectors, "euclidean")


def pairwise(vectors: ArrayLike, metric: str | Callable[[Array, Array], float]) -> Array:
    """Return all distances of `pdist` within vectors, shape (n, d), as a matrix (n, n)."""
    rows = real_array(vectors, "vectors", ("n_vectors", "n_numbers"), batched=False)
    return squareform(pdist(rows, metric)) if len(rows) > 1 else np.zeros((len(rows), len(rows)))


def histograms(values: Array, weights: Array, limits: tuple[float, float], n_bins: int) -> Array:
    """Return histograms of functions (m, n) with weights (n,); end bins count what lies beyond."""
    lower, upper = limits
    position = (values - lower) * (n_bins / (upper - lower))
    bins = np.clip(position, 0, n_bins - 1).astype(np.int64)
    bins += n_bins * np.arange(len(values))[:, np.newaxis]
    shares = np.broadcast_to(weights, values.shape)
    sums = np.bincount(bins.ravel(), shares.ravel(), minlength=len(values) * n_bins)
    return np.asarray(sums, dtype=np.float64)


def positive_numbers(numbers: ArrayLike, name: str) -> tuple[float, ...]:
    """Return one positive number or more as a tuple."""
    values = real_array(numbers, name, (f"n_{name}",), batched=False)
    if values.size == 0 or values.min() <= 0:
        raise ArgumentError(f"{name} must be positive numbers; found {values.tolist()}")
    return tuple(values.tolist())


@runtime_checkable
class MeshesOnDemand(Protocol):
    """Meshes that are read one at a time."""

    def __len__(self) -> int: ...

    def __getitem__(self, index: int, /) -> Mesh: ...


Surfaces: TypeAlias = "Bodies | MeshesOnDemand | Iterable[Mesh]"
"""Registered bodies, or meshes."""


def meshes_of(bodies: Surfaces) -> tuple[int, Callable[[int], Mesh]]:
    """Return the number of meshes, and a function that returns the mesh of an index."""
    if hasattr(bodies, "points") and hasattr(bodies, "template"):
        points, faces = bodies.points, bodies.template.faces
        return len(points), lambda index: (points[index], faces)
    meshes = bodies if isinstance(bodies, MeshesOnDemand) else list(bodies)
    if len(meshes) == 0:
        raise ArgumentError("bodies must hold at least one surface; found none")
    return len(meshes), lambda index: meshes[index]
