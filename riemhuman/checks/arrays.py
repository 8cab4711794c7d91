"""Checks of arrays; errors name the argument, what was found and what was expected.

Arrays traced by autograd pass through unchanged, so that derivatives are kept.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Sized
from typing import Protocol, SupportsIndex

import numpy as np
from autograd.tracer import getval, isbox

from riemhuman.arrays import Array, ArrayLike, Booleans, Integers, Values
from riemhuman.errors import ArgumentError, ArgumentTypeError, FrameIndexError, shown

# d(i, j) and d(j, i) differ by rounding, relative to the largest distance.
_ASYMMETRY = 1e-6


class SpaceOfPoints(Protocol):
    """What checks of points read of a `riemhuman.Manifold`."""

    shape: tuple[int, ...]
    is_surface_space: bool

    def as_array(self, points: object, name: str) -> object: ...


def values_of(array: object, name: str = "array") -> Values:
    """Return the plain NumPy values of an array, traced by autograd or not."""
    while array is not (value := getval(array)):
        array = value
    try:
        return np.asarray(array)
    except ValueError as error:
        raise ArgumentTypeError(
            f"{name} must be an array; found a {type(array).__name__} whose items have "
            "different shapes"
        ) from error
    except (TypeError, RuntimeError, BufferError) as error:
        # Tensors that require gradients, of precisions that NumPy lacks, or on another device.
        raise ArgumentTypeError(
            f"{name} cannot be read as an array: {error}; pass a NumPy array, such as "
            "tensor.detach().cpu().double().numpy()"
        ) from error


def real_array(
    array: object,
    name: str,
    shape: Sequence[int | str] | None = None,
    *,
    batched: bool = True,
    finite: bool = True,
    rows: bool = False,
    maximum: float = np.inf,
) -> Array:
    """Return `array` as a float64 array after checking its shape and finiteness.

    `shape` is the expected trailing shape, in which a string stands for any length; with `batched`,
    leading axes may precede it. `rows` also accepts rows that hold a whole point each. Entries are
    at most `maximum` in absolute value.
    """
    values = array if type(array) is np.ndarray else values_of(array, name)
    if values.dtype.kind not in "fiub":
        raise ArgumentTypeError(
            f"{name} must be an array of real numbers; found {_describe(array, values)}"
        )
    if shape is not None and not (batched and values.shape[-len(shape) :] == tuple(shape)):
        if rows:
            array = unflatten(array if isbox(array) else values, shape)
            values = values_of(array)
        check_shape(values, name, shape, batched=batched)
    numbers = values.astype(np.float64, copy=False)
    if finite and not np.isfinite(numbers).all():
        bad = np.argwhere(~np.isfinite(numbers))
        index = tuple(int(i) for i in bad[0])
        raise ArgumentError(
            f"{name} holds {len(bad)} NaN or infinite entries, the first at index {index}; "
            "every entry must be finite"
        )
    if maximum < np.inf and numbers.size and np.abs(numbers).max() > maximum:
        raise ArgumentError(
            f"{name} must have entries of at most {maximum:g} in absolute value; the largest is "
            f"{np.abs(numbers).max():g}"
        )
    return array if values is not array and isbox(array) else numbers


def unflatten(array: Array, shape: Sequence[int | str]) -> Array:
    """Return rows of numbers, shape (..., n), as points; return any other array unchanged."""
    given, size = np.shape(array), math.prod(shape)
    if given[-len(shape) :] == tuple(shape) or given[-1:] != (size,) or size == shape[-1]:
        return array
    return array.reshape(*given[:-1], *shape)


def check_shape(
    values: Values, name: str, shape: Sequence[int | str], *, batched: bool = True
) -> None:
    """Raise an ArgumentError if the trailing shape of an array is not `shape`."""
    fits = values.ndim >= len(shape) if batched else values.ndim == len(shape)
    for expected, length in zip(reversed(shape), reversed(values.shape), strict=False):
        fits = fits and (isinstance(expected, str) or expected == length)
    if not fits:
        expected = ", ".join(str(length) for length in (["..."] if batched else []) + list(shape))
        raise ArgumentError(f"{name} must have shape ({expected}); found {values.shape}")


def joint_shape(**stacks: ArrayLike) -> tuple[int, ...]:
    """Return the shape that stacks of points or vectors broadcast to; there must be one."""
    shapes = [values_of(stack, name).shape for name, stack in stacks.items()]
    if shapes and shapes.count(shapes[0]) == len(shapes):
        return shapes[0]
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError as error:
        raise ArgumentError(
            f"{' and '.join(stacks)} must be stacks of the same length, or single; found "
            f"{' and '.join(map(str, shapes))}"
        ) from error


def path_array(path: object, space: SpaceOfPoints, *, batched: bool = True) -> Array:
    """Return discrete paths of a space's points, at two times at least, as a float64 array."""
    if not isinstance(path, np.ndarray):
        path = space.as_array(path, "path")
    path = real_array(
        path,
        "path",
        ("n_times", *space.shape),
        batched=batched,
    )
    n_times = path.shape[-len(space.shape) - 1]
    if n_times < 2:
        raise ArgumentError(f"path must have at least two times; found {n_times}")
    return path


def distance_matrix(distances: ArrayLike, name: str, *, symmetric: bool = True) -> Array:
    """Return distances, shape (n, n), with zero diagonal, exactly symmetric if they must be."""
    matrix = real_array(distances, name, ("n", "n"), batched=False, finite=False).copy()
    if matrix.shape[0] != matrix.shape[1] or not len(matrix):
        raise ArgumentError(f"{name} must be a square matrix; found shape {matrix.shape}")
    np.fill_diagonal(matrix, 0.0)
    bad = np.argwhere(~((matrix >= 0) & (matrix < np.inf)))
    if len(bad):
        row, column = bad[0].tolist()
        raise ArgumentError(
            f"{name} must be finite and at least 0; {name}[{row}, {column}] is "
            f"{matrix[row, column]:g}, the first of {len(bad)} wrong entries"
        )
    if not symmetric:
        return matrix
    gap = np.abs(matrix - matrix.T).max()
    if gap > _ASYMMETRY * matrix.max():
        raise ArgumentError(f"{name} must be symmetric; it differs from its transpose by {gap:.3g}")
    return 0.5 * (matrix + matrix.T)


def weight_shares(weights: ArrayLike | None, n: int) -> Array:
    """Return n weights of at least 0 as shares that sum to one; by default all the same."""
    if weights is None:
        return np.full(n, 1.0 / max(n, 1))
    shares = real_array(weights, "weights", (n,), batched=False)
    smallest, largest = shares.min(), shares.max()
    if smallest < 0 or largest <= 0:
        raise ArgumentError(
            f"weights must be at least 0 and not all 0; the smallest is {smallest:g}, the largest "
            f"{largest:g}"
        )
    # Their sum might overflow.
    below_one: Array = shares / largest
    sum_to_one: Array = below_one / below_one.sum()
    return sum_to_one


def integer_array(array: object, name: str, shape: Sequence[int | str]) -> Integers:
    """Return `array` as int64 of exactly this shape; whole-numbered floats are accepted."""
    values = values_of(array, name)
    if values.dtype.kind not in "iu" and not (
        values.dtype.kind == "f" and np.isfinite(values).all() and (values == values.round()).all()
    ):
        raise ArgumentTypeError(
            f"{name} must be an array of whole numbers; found {_describe(array, values)}"
        )
    check_shape(values, name, shape, batched=False)
    return values.astype(np.int64)


def index_array(
    array: object, name: str, shape: Sequence[int | str], count: int, least: int = 0
) -> Integers:
    """Return `array` as int64 of exactly this shape, with numbers from `least` to `count` - 1."""
    numbers = integer_array(array, name, shape)
    if numbers.size and not least <= numbers.min() <= numbers.max() < count:
        raise ArgumentError(
            f"{name} must hold whole numbers from {least} to {count - 1}; found {numbers.min()} to "
            f"{numbers.max()}"
        )
    return numbers


def mask(values: object, name: str, shapes: Sequence[tuple[int, ...]]) -> Booleans:
    """Return a Boolean array of one of these shapes."""
    array = values_of(values, name)
    if array.dtype != bool or array.shape not in shapes:
        expected = " or ".join(dict.fromkeys(map(str, shapes)))
        raise ArgumentError(
            f"{name} must be Boolean, of shape {expected}; found {array.dtype} of shape "
            f"{array.shape}"
        )
    return array


def length_of(points: object, name: str) -> int:
    """Return the number of points of an array, or of an object that has a length and slices."""
    # Arrays of no dimension have the methods of others, and classes those of their objects.
    has_slices = hasattr(points, "__getitem__") and getattr(points, "shape", None) != ()
    is_refused = isinstance(points, (type, Mapping, str, bytes, memoryview))
    if is_refused or not has_slices or not isinstance(points, Sized):
        raise ArgumentTypeError(
            f"{name} must be an array, or have a length and slices; found {type(points).__name__}"
        )
    return len(points)


def numbers_at(
    index: SupportsIndex | slice[int | None, int | None, int | None],
    count: int,
    owner: object,
    item: str,
) -> int | range:
    """Return the number, or the numbers, that an index or a slice chooses among `count` items."""
    try:
        return range(count)[index]
    except IndexError as error:
        raise FrameIndexError(f"{owner} has no {item} {shown(index)}") from error
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(
            f"{owner} is indexed by a whole number or a slice; found {shown(index)}"
        ) from error


def _describe(array: object, values: Values) -> str:
    class_name = type(array).__name__
    if values.ndim:
        return f"{class_name} of dtype {values.dtype}"
    return f"{class_name} {shown(array)}"
