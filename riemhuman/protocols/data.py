"""Data sets, and vectors that stand for surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from numpy import ndarray
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from riemhuman.surfaces.template import Template


@runtime_checkable
class Descriptor(Protocol):
    """Vectors that stand for surfaces, with a distance between them.

    `riemhuman.descriptors.Descriptor` is a base class that has everything but `describe`.
    """

    def describe(self, vertices: ArrayLike, faces: ArrayLike) -> ndarray:
        """Return the vector of one surface.

        Parameters
        ----------
        vertices : array_like, shape (V, 3)
            Vertex positions, in metres.
        faces : array_like, shape (F, 3)
            Vertex indices of each triangle, counted from 0.

        Returns
        -------
        array, shape (d,)
        """

    def distances(self, vectors: ArrayLike) -> ndarray:
        """Return all distances within a set of vectors.

        Parameters
        ----------
        vectors : array_like, shape (n, d)
            Vectors of `describe`, one a row.

        Returns
        -------
        array, shape (n, n)
            Symmetric, with zero diagonal.
        """


@runtime_checkable
class Dataset(Protocol):
    """Registered surfaces with labels; `riemhuman.datasets.Bodies` is one.

    It may also have `model`, the body model that the surfaces come from; without one, or with
    None, the representations by model vectors are left out. Either label may be None: what it
    would tell is then left out.
    """

    @property
    def points(self) -> Any:
        """Surfaces, shape (n, V, 3): an array, or an object whose slices and items are arrays."""

    @property
    def template(self) -> Template:
        """The surface all are registered to."""

    @property
    def subject(self) -> Sequence[Any] | ndarray | None:
        """Who is shown, shape (n,)."""

    @property
    def pose(self) -> Sequence[Any] | ndarray | None:
        """Which pose is held, shape (n,)."""

    def __len__(self) -> int:
        """Return the number of surfaces."""
