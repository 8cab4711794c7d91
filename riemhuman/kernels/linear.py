"""Entries of the last axes, and differentials, as autograd knows them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
from autograd.core import make_vjp
from autograd.extend import defjvp, defvjp, primitive
from numpy import ndarray


@primitive
def entry(values: ndarray, *index: int | slice) -> ndarray:
    """Return ``values[..., *index]``.

    Registered as an autograd primitive, because autograd accumulates the transpose of indexing
    entry by entry, in case an index occurs twice.

    Parameters
    ----------
    values : array, shape (..., m, n)
        Values.
    *index : int or slice
        One for each of the last axes.

    Returns
    -------
    array, shape (...)
    """
    return values[(..., *index)]


@primitive
def _entry_alone(values: ndarray, shape: tuple[int, ...], *index: int | slice) -> ndarray:
    """Return zeros except for one entry of the last axes, the transpose of `entry`."""
    zeros = np.zeros(shape)
    zeros[(..., *index)] = values
    return zeros


defvjp(
    entry,
    lambda answer, values, *index: lambda upstream: _entry_alone(upstream, values.shape, *index),
    argnums=(0,),
)
defjvp(entry, lambda tangent, answer, values, *index: entry(tangent, *index), argnums=(0,))
defvjp(
    _entry_alone,
    lambda answer, values, shape, *index: lambda upstream: entry(upstream, *index),
    argnums=(0,),
)
defjvp(
    _entry_alone,
    lambda tangent, answer, values, shape, *index: _entry_alone(tangent, shape, *index),
    argnums=(0,),
)


def differential(map: Callable[[Any], Any], tangent_vec: ndarray, base_point: ndarray) -> ndarray:
    r"""Apply the differential of a map to tangent vectors, :math:`d_x\varphi(v)`.

    The transposed differential :math:`w \mapsto d_x\varphi^T w` that reverse-mode automatic
    differentiation gives is linear in w, so its own gradient along v is :math:`d_x\varphi(v)`. This
    needs only reverse-mode rules, which every autograd function has.

    Parameters
    ----------
    map : callable
        Differentiable map from (..., \*shape) to (..., \*image_shape), acting on each point of a
        batch by itself.
    tangent_vec : array, shape (..., \*shape)
        Tangent vectors v.
    base_point : array, shape (..., \*shape)
        Base points x, already broadcast with `tangent_vec`.

    Returns
    -------
    array, shape (..., \*image_shape)
    """
    pull_back, image = make_vjp(map, base_point)
    transposed, _ = make_vjp(pull_back, np.zeros_like(image))
    return transposed(tangent_vec)
