"""Types of arrays by role, and of the content of files.

Arrays that autograd traces stand for the values that they trace, and have the same types: every
function that is differentiated takes and returns them as it does arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "Array",
    "ArrayLike",
    "Booleans",
    "Callback",
    "DType",
    "FeatureRows",
    "Features",
    "Fields",
    "Image",
    "Integers",
    "JSONRecord",
    "JSONValue",
    "Labels",
    "MemoryMap",
    "PairsLike",
    "Points",
    "PointsByNumber",
    "PointsLike",
    "PointsOnDemand",
    "PointsOrBatches",
    "TangentVectors",
    "Triangles",
    "Values",
]

Array: TypeAlias = NDArray[np.float64]
"""Real numbers in double precision."""

Integers: TypeAlias = NDArray[np.int64 | np.intp]
"""Whole numbers, such as indices."""

Booleans: TypeAlias = NDArray[np.bool_]

Points: TypeAlias = NDArray[np.float64]
"""Points of a manifold, shape (..., *shape); surfaces have shape (..., V, 3), metres."""

TangentVectors: TypeAlias = NDArray[np.float64]
"""Tangent vectors of a manifold, shape (..., *shape); deformations of surfaces, (..., V, 3)."""

Fields: TypeAlias = tuple[NDArray[np.float64], ...]
"""Fields of surfaces, arrays of shape (..., F) or (..., F, n)."""

FeatureRows: TypeAlias = NDArray[np.float64]
"""Features of surfaces, in double or single precision; loops over them have one type for both."""

Features: TypeAlias = tuple[NDArray[np.float64], ...]
"""Features from which a metric computes distances, arrays whose first axis is that of points."""

Triangles: TypeAlias = NDArray[np.int64 | np.intp]
"""Vertex indices of triangles, shape (F, 3), counted from 0."""

Image: TypeAlias = NDArray[np.uint8]
"""Pixels, shape (height, width, channels)."""


class PointsOnDemand(Protocol):
    """Points, such as meshes in files or frames of a motion, that are read when they are asked for.

    An array of points has this form, too.
    """

    def __len__(self) -> int: ...

    def __getitem__(
        self, part: int | slice[int | None, int | None, int | None], /
    ) -> NDArray[np.float64]: ...


class PointsByNumber(Protocol):
    """Points that are read one at a time."""

    def __getitem__(self, number: int, /) -> NDArray[np.float64]: ...


PointsLike: TypeAlias = NDArray[np.float64] | Sequence[object] | PointsOnDemand
"""A set of points: an array, or a sequence whose items are read as points, such as meshes."""

PairsLike: TypeAlias = NDArray[np.float64] | Sequence[Sequence[object]]
"""Pairs of points: an array, shape (n, 2, *shape), or a sequence whose items are two points."""

PointsOrBatches: TypeAlias = NDArray[np.float64] | Iterable[NDArray[np.float64]]
"""A set of points: an array, or batches of them that can be read again."""

Values: TypeAlias = NDArray[Any]  # type: ignore[explicit-any]  # known once it was looked at
"""An array of a type that is not known yet, such as one that a user passes, or of a file."""

MemoryMap: TypeAlias = np.memmap[Any, np.dtype[Any]]  # type: ignore[explicit-any]
"""An array of a type that is not known yet, mapped into memory from its file."""

DType: TypeAlias = np.dtype[Any]  # type: ignore[explicit-any]  # NumPy has no type of all types
"""The type of an array's entries."""

Labels: TypeAlias = ArrayLike | Iterable[object]
"""Class labels, which can be hashed."""

Callback: TypeAlias = Callable[[int, float, NDArray[np.float64]], object]
"""Called with iteration, value and point or path."""

JSONValue: TypeAlias = Any  # type: ignore[explicit-any]  # readers check each value they use
"""A value of a document of JSON."""

JSONRecord: TypeAlias = dict[str, JSONValue]
"""An object of JSON, with names for its values."""
