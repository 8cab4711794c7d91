"""Checks of arguments and of units; errors name the argument, what was found and what was expected.

Arrays traced by autograd pass through unchanged, so that derivatives are kept.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Iterable, Mapping, Sequence, Sized
from typing import NoReturn, Protocol, SupportsIndex, TypeVar

import numpy as np
from autograd.tracer import getval, isbox

from riemhuman.arrays import Array, ArrayLike, Booleans, DType, Integers, Values
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FrameIndexError,
    PrecisionWarning,
    shown,
    warn,
    whole_text,
)
from riemhuman.memory import too_little

Rng = int | np.random.Generator | None

Choice = TypeVar("Choice")
Kind = TypeVar("Kind")


class SpaceOfPoints(Protocol):
    """What checks of points read of a `riemhuman.Manifold`."""

    shape: tuple[int, ...]
    is_surface_space: bool

    def as_array(self, points: object, name: str) -> object: ...


# Fourth powers of lengths, and what weights make of them, stay within double precision.
_LARGEST_WEIGHT = LONGEST_LENGTH = 1e60
_SHORTEST_LENGTH = 1e-60
# If the squares of the coordinates of up to 1e10 vertices add up to more, one is larger than that.
_SURELY_LONG = 1e-100

# Sums of squares of larger numbers overflow; what is larger has no meaning in any unit.
LARGEST_NUMBER = 1e150
# Sums of squares of larger distances overflow; d(i, j) and d(j, i) differ by rounding, relative to
# the largest distance.
_LARGEST_DISTANCE, _ASYMMETRY = 1e150, 1e-6
# Whole numbers of 64 bits, as those of arrays are.
_LARGEST_WHOLE = 2**63 - 1
# NumPy makes seeds of 128 bits.
_LARGEST_SEED = 2**128 - 1

MOST_REPEATS = 1_000_000
"""The most starts, nodes, frames or samples of one call, each of which is computed."""

MOST_DOUBLINGS = 20
"""The most doublings of a number of steps, to a million times as many."""

# From a frame in thirty years to one a nanosecond.
_FRAME_RATES = 1e-9, 1e9

# Units in a metre.
UNITS = {"metres": 1.0, "centimetres": 100.0, "millimetres": 1000.0, "inches": 39.37}

SCALES = ("template", None)
"""Choices of a reference that surfaces must have about the same size as."""

TAKE_ANY_SCALE = "scale=None (on the command line --any-scale) accepts them unchanged"
"""Advice for users who mean surfaces of any size."""

# Largest extents of human bodies, from infants to men with their arms raised.
_BODY_METRES = (0.45, 2.8)
# Feet are suspected in messages, but never inferred.
SUSPECTED_UNITS = UNITS | {"feet": 3.2808}

HUMAN_EXTENTS = (0.4, 4.0)
"""Smallest and largest extent of a body with its surroundings, metres.

Their ratio is 10, as between centimetres and millimetres, so that one unit fits at most.
"""

HUMAN_VOLUMES = (0.002, 0.65)
"""Volumes of the smallest and of the heaviest people who have lived, cubic metres.

Newborns have 3 litres and more. A volume is the same in every pose, which an extent is not.
"""

# An infant and a tall man with raised arms differ by less than this, and units by more, but for
# centimetres and inches, which differ by 2.54.
_LARGEST_RATIO = 8.0
# Two bodies in different units differ by the ratio of the units times that of the bodies.
_BODY_RATIO = 1.5
# A sample of vertices is enough to tell the size of a surface.
_N_SAMPLES = 256

# Digits of the usual distance between neighbouring vertices; with fewer, warn or refuse.
_ENOUGH_DIGITS, _FEWEST_DIGITS = 2.0, 0.5
# In double precision, whatever the unit, nothing is lost this near the origin. Beyond the second
# number of extents, coordinates may be rounded; with fewer vertices, grids may be intended.
_NEAR, _FAR, _FEWEST_VERTICES = 30.0, 50.0, 100
_N_SURFACES = 8


def values_of(array: object, name: str = "array") -> Values:
    """Return the plain NumPy values of an array, traced by autograd or not."""
    while array is not (value := getval(array)):
        array = value
    if type(array) is not np.ndarray and (masked := _count_masked(array)):
        raise ArgumentTypeError(
            f"{name} has {masked} masked entries; fill them, or remove the surfaces that "
            "contain them"
        )
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


def _count_masked(array: object) -> int:
    """Return the number of masked entries of an array, or of arrays in nested lists."""
    if isinstance(array, np.ma.MaskedArray):
        return int(np.ma.getmaskarray(array).sum())
    if isinstance(array, (list, tuple)):
        return sum(map(_count_masked, array))
    return 0


def real_array(
    array: object,
    name: str,
    shape: Sequence[int | str] | None = None,
    *,
    batched: bool = True,
    finite: bool = True,
    rows: bool = False,
    lengths: bool = False,
    maximum: float = LARGEST_NUMBER,
) -> Array:
    """Return `array` as a float64 array after checking its shape and finiteness.

    `shape` is the expected trailing shape, in which a string stands for any length; with `batched`,
    leading axes may precede it. `rows` also accepts rows that hold a whole point each. With
    `finite`, entries are at most `maximum` in absolute value, so that sums of squares stay within
    double precision; `lengths` checks that areas of these vertices, shape (..., V, 3), do.
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
    try:
        checked = values
        if values.dtype != np.float64:
            with np.errstate(over="ignore"):  # what double precision cannot hold is refused below
                checked = np.asarray(values, dtype=np.float64)
    except MemoryError as error:
        raise too_little(f"{name} of shape {values.shape} in double precision", error) from error
    if finite and checked.size:
        bound = LONGEST_LENGTH if lengths else maximum
        # The sum of the squares is found fastest. Nearly always it tells that no number is large,
        # and that a single surface is not too small.
        square = float(np.vdot(checked, checked)) if checked.flags.c_contiguous else np.inf
        if not square <= bound * bound:
            # NaN is the largest and the smallest number, if there is one.
            largest = max(abs(float(checked.max())), abs(float(checked.min())))
            if not largest <= bound:
                _refuse_size(checked, name, largest, maximum, lengths)
        is_long = checked.ndim == 2 and _SURELY_LONG < square < np.inf
        # The first vertex of a surface nearly always tells that it is not too small.
        if (
            lengths
            and not is_long
            and np.abs(checked[..., :1, :]).max(axis=(-2, -1)).min() < _SHORTEST_LENGTH
        ):
            _check_shortest(checked, name)
    return array if isbox(array) else checked


def _refuse_size(
    values: Array, name: str, largest: float, maximum: float, lengths: bool
) -> NoReturn:
    """Raise an ArgumentError for numbers that are not finite, or too large."""
    if not largest < np.inf:
        bad = np.argwhere(~np.isfinite(values))
        index = tuple(int(i) for i in bad[0])
        raise ArgumentError(
            f"{name} holds {len(bad)} NaN or infinite entries, the first at index {index}; "
            "every entry must be finite"
        )
    if lengths:
        _refuse_length(name, largest)
    raise ArgumentError(
        f"{name} must have entries of at most {maximum:g} in absolute value; the largest is "
        f"{largest:g}"
    )


def _check_shortest(values: Array, name: str) -> None:
    """Raise an ArgumentError if areas of a surface, shape (..., V, 3), would vanish."""
    sizes = np.abs(values).max(axis=(-2, -1))
    wrong = sizes[(sizes > 0) & (sizes < _SHORTEST_LENGTH)]
    if wrong.size:
        _refuse_length(name, wrong.flat[0])


def _refuse_length(name: str, length: float) -> NoReturn:
    raise ArgumentError(
        f"{name} must have coordinates between {_SHORTEST_LENGTH:g} and {LONGEST_LENGTH:g} in "
        f"absolute value; the largest coordinate of one item is {length:g}: choose another unit"
    )


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
        lengths=space.is_surface_space,
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
    bad = np.argwhere(~((matrix >= 0) & (matrix <= _LARGEST_DISTANCE)))
    if len(bad):
        row, column = bad[0].tolist()
        raise ArgumentError(
            f"{name} must be from 0 to {_LARGEST_DISTANCE:g}; {name}[{row}, {column}] is "
            f"{matrix[row, column]:g}, the first of {len(bad)} wrong entries"
        )
    if not symmetric:
        return matrix
    gap = np.abs(matrix - matrix.T).max()
    if gap > _ASYMMETRY * matrix.max():
        raise ArgumentError(f"{name} must be symmetric; it differs from its transpose by {gap:.3g}")
    return 0.5 * (matrix + matrix.T)


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


def number_of_item(index: SupportsIndex, count: int, item: str) -> int:
    """Return the number, from 0, that an index chooses among `count` items."""
    number = whole_number(index, f"the number of a {item}")
    if not -count <= number < count:
        raise FrameIndexError(f"there are {count} of them, and no {item} {shown(index)}")
    return number % count


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


def metric_weight(value: ArrayLike, name: str, *, strict: bool = False) -> float:
    """Return a weight of a metric as a float of at least 0, or above it if `strict`."""
    number = real_number(value, name, minimum=0.0, strict=strict)
    if number > _LARGEST_WEIGHT:
        raise ArgumentError(f"{name} must be at most {_LARGEST_WEIGHT:g}; found {number:g}")
    return number


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
    is_signed = values.dtype.kind == "i"  # of at most 64 bits
    if (
        not is_signed
        and values.size
        and not -(2**63) <= int(values.min()) <= int(values.max()) < 2**63
    ):
        raise ArgumentError(
            f"{name} must be an array of numbers of at most 64 bits; found "
            f"{values.min()} to {values.max()}"
        )
    return values.astype(np.int64)


def real_number(
    value: ArrayLike,
    name: str,
    *,
    minimum: float = -np.inf,
    strict: bool = False,
    maximum: float = LARGEST_NUMBER,
) -> float:
    """Return `value` as a finite float between bounds (if `strict`, above the lower one)."""
    try:
        # Text and moments in time convert to float as well, and arrays of one number did so
        # before NumPy 2.4.
        if isinstance(value, (str, bytes)) or np.ndim(value) != 0:
            raise TypeError
        if getattr(getattr(value, "dtype", None), "kind", "f") not in "fiub":
            raise TypeError
        number = float(value)  # type: ignore[arg-type]  # TypeError where it is no number
    except OverflowError:  # a whole number beyond the range of floats
        number = np.inf
    except (TypeError, ValueError) as error:
        raise ArgumentTypeError(f"{name} must be a real number; found {shown(value)}") from error
    if not np.isfinite(number) or number < minimum or (strict and number == minimum):
        bound = "" if minimum == -np.inf else f" {'above' if strict else 'of at least'} {minimum:g}"
        raise ArgumentError(f"{name} must be a finite number{bound}; found {number!r}")
    if abs(number) > maximum:
        raise ArgumentError(
            f"{name} must be at most {maximum:g} in absolute value; found {number:g}"
        )
    return number


def whole_number(
    value: SupportsIndex, name: str, *, minimum: int | None = None, maximum: int = _LARGEST_WHOLE
) -> int:
    """Return `value` as an int from `minimum` to `maximum`; answers, True or False, are refused."""
    try:
        if isinstance(value, bool):
            raise TypeError
        number = operator.index(value)
    except TypeError as error:
        raise ArgumentTypeError(f"{name} must be a whole number; found {shown(value)}") from error
    if minimum is not None and number < minimum:
        raise ArgumentError(
            f"{name} must be a whole number of at least {minimum}; found {whole_text(number)}"
        )
    if number > maximum:
        raise ArgumentError(
            f"{name} must be a whole number of at most {maximum}; found {whole_text(number)}"
        )
    return number


def checked_rate(value: ArrayLike, name: str = "frames_per_second") -> float:
    """Return a number of frames in a second as a float, within what clocks can measure."""
    slowest, fastest = _FRAME_RATES
    rate = real_number(value, name, minimum=0.0, strict=True, maximum=fastest)
    if rate < slowest:
        raise ArgumentError(f"{name} must be at least {slowest:g}; found {rate:g}")
    return rate


def one_of(value: Choice, name: str, choices: Sequence[object]) -> Choice:
    """Return `value`, or raise an ArgumentError if it is not one of `choices`."""
    try:
        is_known = not isinstance(value, np.ndarray) and value in choices
    except (TypeError, ValueError):  # what compares by elements, such as a series of pandas
        is_known = False
    if not is_known:
        listed = ", ".join(repr(choice) for choice in choices)
        raise ArgumentError(f"{name} must be one of {listed}; found {shown(value)}")
    return value


def generator(rng: Rng) -> np.random.Generator:
    """Return a NumPy generator: the one given, or a new one, with a seed if one is given."""
    if isinstance(rng, np.random.Generator):
        return rng
    if rng is None:
        return np.random.default_rng()
    return np.random.default_rng(whole_number(rng, "rng", minimum=0, maximum=_LARGEST_SEED))


def likely_units(extent: float) -> list[str]:
    """Return the units in which this extent is the size of a human body."""
    low, high = _BODY_METRES
    return [name for name, size in UNITS.items() if low * size <= extent <= high * size]


def is_human_size(extent: float, volume: float = math.nan, unit: float = 1.0) -> bool:
    """Return whether a body of people, from newborns to giants, has this extent and volume.

    `unit` is the number of units in a metre; NaN is the volume of an open surface.
    """
    low, high = HUMAN_EXTENTS
    least, most = HUMAN_VOLUMES
    if not low * unit <= extent < high * unit:
        return False
    return math.isnan(volume) or least * unit**3 <= abs(volume) <= most * unit**3


def check_human_size(extent: float, volume: float, name: str) -> None:
    """Raise an error that suspects a unit if no human body, in metres, has this size."""
    if is_human_size(extent, volume):
        return
    units = [unit for unit, size in SUSPECTED_UNITS.items() if is_human_size(extent, volume, size)]
    least, most = (1000 * litres for litres in HUMAN_VOLUMES)
    encloses = "" if math.isnan(volume) else f" and encloses {1000 * abs(volume):.4g} litres"
    raise ArgumentError(
        f"{name} is {extent:.4g} m long{encloses}, which no human body is"
        + (f", but a body in {' or '.join(units)} would be" if units else "")
        + f"; bodies must be in metres, {HUMAN_EXTENTS[0]:g} to {HUMAN_EXTENTS[1]:g} m long and of "
        f"{least:g} to {most:g} litres"
        + ("; files are converted by unit, on the command line --unit" if units else "")
    )


def check_same_scale(
    points: Array,
    reference: Array,
    name: str,
    reference_name: str,
    *,
    error: type[Exception] = ArgumentError,
    remedy: str = TAKE_ANY_SCALE,
) -> None:
    """Raise an error if a surface, shape (..., V, 3), is over 8 times larger or smaller."""
    # Diagonals of the boxes around some of the vertices, found faster in rows than in columns.
    samples = (f[..., :: max(1, f.shape[-2] // _N_SAMPLES), :] for f in (points, reference))
    rows = (np.ascontiguousarray(np.swapaxes(f, -1, -2)) for f in samples)
    sizes, size = (np.linalg.norm(np.ptp(f, axis=-1), axis=-1) for f in rows)
    if size == 0:
        return
    ratios = sizes / size
    strange = (ratios > _LARGEST_RATIO) | ((ratios > 0) & (ratios < 1 / _LARGEST_RATIO))
    if not strange.any():
        return
    index = tuple(int(i) for i in np.argwhere(strange)[0]) if strange.ndim else ()
    ratio = float(ratios[index])
    place = f"{name}[{', '.join(map(str, index))}]" if index else name
    factor, adjective = (ratio, "large") if ratio > 1 else (1 / ratio, "small")
    raise error(
        f"{place} is {factor:.3g} times as {adjective} as {reference_name}{_unit_hint(ratio)}; "
        f"bring both to one unit; {remedy}"
    )


def _numpy_dtype(dtype: object) -> DType | None:
    """Return NumPy's type of the same name as a type of another library, if any."""
    if dtype is None:
        return None
    try:
        return np.dtype(str(dtype).rpartition(".")[2].lower())
    except TypeError:
        return None


def check_resolution(
    points: object, name: str, dtype: object = None, error: type[Exception] = ArgumentError
) -> None:
    """Warn, or raise an error, if few digits of the distances between vertices are left.

    Coordinates, shape (..., V, 3), have the resolution of their type, or of the `dtype` that they
    had; far from the origin also that of steps that they are all multiples of, as those of numbers
    that were once in single precision or written with few decimals.
    """
    values = values_of(points, name)
    if not isinstance(dtype, np.dtype):
        dtype = _numpy_dtype(dtype) or values.dtype
    if values.size == 0 or values.shape[-2] < _FEWEST_VERTICES or dtype.kind not in "fiu":
        return
    first = values[..., 0, :]
    largest = float(max(abs(first.max()), abs(first.min())))
    if dtype.itemsize == 8 and dtype.kind == "f" and largest <= _NEAR:
        return
    sample = values.reshape(-1, *values.shape[-2:])
    sample = sample[:: max(1, len(sample) // _N_SURFACES)]
    sample = sample[:, :: max(1, sample.shape[1] // _N_SAMPLES)].astype(np.float64)
    extent = float(np.ptp(sample, axis=1).max())
    if not 0.0 < extent < np.inf:
        return
    largest = float(np.abs(sample).max())
    step = 1.0 if dtype.kind in "iu" else float(np.spacing(np.abs(sample).max().astype(dtype)))
    has_step = dtype.kind in "iu" or dtype.itemsize < 8
    if not has_step and largest > _FAR * extent:
        step = max(step, *(_common_step(x.ravel()) for x in np.moveaxis(sample, 2, 0)))
    usual = extent / math.sqrt(values.shape[-2])
    digits = math.log10(usual / step)
    if digits >= _ENOUGH_DIGITS:
        return
    message = (
        f"{name} are up to {largest:.3g} from the origin, with a rounding step of {step:.2g}: "
        f"this leaves {max(digits, 0.0):.1f} digits of the usual distance {usual:.2g} between "
        "vertices; subtract an offset in double precision, before coordinates are rounded"
    )
    if digits < _FEWEST_DIGITS:
        raise error(message)
    warn(message, PrecisionWarning)


def _common_step(values: Array) -> float:
    """Return the step between numbers that are all on one grid, 0 if they are on none."""
    gaps = np.diff(np.unique(values))
    # Rounding of decimal fractions leaves gaps that are far smaller than the step.
    gaps = gaps[gaps > 8.0 * np.spacing(np.abs(values).max())]
    if not len(gaps):
        return 0.0
    step = float(gaps.min())
    multiples = gaps / step
    is_grid = np.all(np.abs(multiples - np.round(multiples)) < 0.01)
    return step if is_grid else 0.0


def refuse_type(value: object, name: str, expected: str) -> NoReturn:
    """Raise an ArgumentTypeError that says which class was found, or that it was a class itself."""
    if isinstance(value, type):
        raise ArgumentTypeError(f"{name} must be {expected}; found the class {value.__name__}")
    raise ArgumentTypeError(f"{name} must be {expected}; found {type(value).__name__}")


def check_instance(value: object, name: str, cls: type[object], expected: str = "") -> None:
    """Raise an ArgumentTypeError, which says what was found, unless an object is of this class."""
    if not isinstance(value, cls):
        refuse_type(value, name, expected or f"a {cls.__name__}")


def items_of(values: Iterable[Kind], name: str, expected: str) -> tuple[Kind, ...]:
    """Return the items of an iterable that is no text and no mapping."""
    if isinstance(values, (str, bytes, memoryview, Mapping)):
        refuse_type(values, name, expected)
    try:
        return tuple(values)
    except TypeError as error:
        raise ArgumentTypeError(
            f"{name} must be {expected}; found {type(values).__name__}"
        ) from error


def flag(value: object, name: str) -> bool:
    """Return an answer, yes or no, as a bool; 0 and 1 are answers as well."""
    if isinstance(value, (bool, np.bool_)) or (
        isinstance(value, (int, np.integer)) and 0 <= value <= 1
    ):
        return bool(value)
    raise ArgumentTypeError(f"{name} must be True or False; found {shown(value)}")


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


def check_methods(value: object, name: str, expected: str, *methods: str) -> None:
    """Raise an ArgumentTypeError unless this is an object, no class, with these methods."""
    if isinstance(value, type) or not all(
        callable(getattr(value, method, None)) for method in methods
    ):
        refuse_type(value, name, expected)


def check_strategy(solver: object, name: str) -> None:
    """Raise an ArgumentTypeError for what has no method `solve`, and for classes."""
    expected = "an object with a method solve, such as LinearPath() for paths or BasisMean() for "
    check_methods(solver, name, expected + "means", "solve")


def check_function(value: object, name: str) -> None:
    """Raise an ArgumentTypeError for what cannot be called."""
    check_methods(value, name, "a function", "__call__")


def check_basis(value: object, name: str) -> None:
    """Raise an ArgumentTypeError for what lacks the methods of a DeformationBasis."""
    check_methods(value, name, "a DeformationBasis", "check_fits", "extend")


def _describe(array: object, values: Values) -> str:
    class_name = type(array).__name__
    if values.ndim:
        return f"{class_name} of dtype {values.dtype}"
    return f"{class_name} {shown(array)}"


def _unit_hint(ratio: float) -> str:
    """Return a text that names the units of two surfaces whose sizes have this ratio, if likely."""
    pairs = itertools.permutations(UNITS, 2)
    gaps = {
        (unit, other_unit): abs(np.log(ratio * UNITS[other_unit] / UNITS[unit]))
        for unit, other_unit in pairs
    }
    unit, other_unit = min(gaps, key=lambda pair: gaps[pair])
    if gaps[unit, other_unit] > np.log(_BODY_RATIO):
        return ""
    return f", as if one were in {unit} and the other in {other_unit}"
