"""Points that arrive as rows of numbers, as scikit-learn passes them to a distance."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import autograd.numpy as np

from riemhuman.checks import real_array


def point_array(array: Any, name: str, shape: Sequence[int], *, batched: bool = True) -> Any:
    r"""Return points as a float64 array after checking them; they may come as rows of numbers.

    Parameters
    ----------
    array : array_like, shape (..., \*shape) or (..., n)
        Points, or rows of as many numbers as a point has; an autograd box is kept.
    name : str
        Name of the argument, for messages.
    shape : sequence of int
        Shape of a point.
    batched : bool
        Whether any number of leading axes is legal; otherwise it is one.

    Returns
    -------
    array, shape (..., \*shape)

    Raises
    ------
    ArgumentTypeError
        If it does not convert to real numbers.
    ArgumentError
        If its shape is another, or entries are NaN or infinite.
    """
    points = unflattened(real_array(array, name, finite=False), shape)
    expected: Sequence[int | str] = tuple(shape) if batched else ("n_points", *shape)
    return real_array(points, name, expected, batched=batched)


def unflattened(array: Any, shape: Sequence[int]) -> Any:
    r"""Return rows of numbers as points, and every other array as it is.

    Parameters
    ----------
    array : array, shape (..., \*shape) or (..., n)
        Points, or rows of as many numbers as a point has; or an autograd box.
    shape : sequence of int
        Shape of a point.

    Returns
    -------
    array, shape (..., \*shape), or what was given
    """
    given, size = np.shape(array), math.prod(shape)
    if given[-len(shape) :] == tuple(shape) or given[-1:] != (size,) or size == shape[-1]:
        return array
    return np.reshape(array, (*given[:-1], *shape))
