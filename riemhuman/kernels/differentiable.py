"""Functions whose derivatives are registered with autograd."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
import numpy as onp
from autograd import grad
from autograd.core import make_vjp
from autograd.extend import defjvp, defvjp, primitive
from autograd.tracer import getval, isbox
from numpy import ndarray


@primitive
def entry(values: ndarray, *index: int | slice) -> ndarray:
    """Return ``values[..., *index]``.

    Registered as an autograd primitive, because autograd accumulates the transpose of indexing
    entry by entry, in case an index occurs twice.
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
    """
    pull_back, image = make_vjp(map, base_point)
    transposed, _ = make_vjp(pull_back, np.zeros_like(image))
    return transposed(tangent_vec)


@primitive
def square_root(x: ndarray) -> ndarray:
    """Return the square root, with subgradient 0 at 0 (rounding below 0 counts as 0)."""
    return np.sqrt(np.maximum(x, 0.0))


def _square_root_slope(answer: ndarray) -> ndarray:
    return np.where(answer > 0, 0.5 / np.where(answer > 0, answer, 1.0), 0.0)


defvjp(
    square_root,
    lambda answer, x: lambda upstream: upstream * _square_root_slope(square_root(x)),
)


@primitive
def product_minus_square(a: ndarray, b: ndarray, c: ndarray) -> ndarray:
    """Return ab − c² to working precision, however much the two terms cancel, shape (...).

    Both products are formed with their rounding errors (Dekker's algorithm).
    """
    product, product_error = _exact_product(a, b)
    square, square_error = _exact_product(c, c)
    return (product - square) + (product_error - square_error)


def _exact_product(a: ndarray, b: ndarray) -> tuple[ndarray, ndarray]:
    """Return the rounded product and its rounding error."""
    product = a * b
    (a_high, a_low), (b_high, b_low) = _halves(a), _halves(b)
    error = a_low * b_low - (((product - a_high * b_high) - a_low * b_high) - a_high * b_low)
    return product, error


def _halves(a: ndarray) -> tuple[ndarray, ndarray]:
    """Return two numbers of half the digits that add up to a."""
    shifted = 134217729.0 * a  # 2²⁷ + 1
    high = shifted - (shifted - a)
    return high, a - high


defvjp(
    product_minus_square,
    lambda answer, a, b, c: lambda upstream: upstream * b,
    lambda answer, a, b, c: lambda upstream: upstream * a,
    lambda answer, a, b, c: lambda upstream: -2.0 * upstream * c,
)


def sine_cardinal(x: ndarray) -> ndarray:
    """Return sin(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sin(x) / np.where(x == 0, 1.0, x))


def inverse_hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return x/sinh(x), 1 at 0."""
    safe = np.where(x == 0, 1.0, x)
    # exp(-x) keeps the quotient finite where sinh overflows.
    decay = np.exp(-np.abs(safe))
    return np.where(x == 0, 1.0, 2.0 * np.abs(safe) * decay / -np.expm1(-2.0 * np.abs(safe)))


def hyperbolic_sine_cardinal(x: ndarray) -> ndarray:
    """Return sinh(x)/x, 1 at 0."""
    return np.where(x == 0, 1.0, np.sinh(x) / np.where(x == 0, 1.0, x))


Function = Callable[[Any], Any]


def with_known_gradient(
    value_and_gradient: Callable[[onp.ndarray], tuple[float, onp.ndarray]], definition: Function
) -> Function:
    """Return a scalar function as an autograd primitive.

    Value and first derivatives come from `value_and_gradient`, in one evaluation; derivatives of
    the gradient come from the definition.
    """

    @primitive
    def evaluate(x: onp.ndarray) -> onp.ndarray:
        value, gradient = value_and_gradient(x)
        return onp.concatenate([[value], gradient.ravel()])

    def transposed(answer: Any, x: Any) -> Function:
        def pull_back(upstream: Any) -> Any:
            # The answer is traced too where higher derivatives are asked for.
            pulled = upstream[0] * np.reshape(answer[1:], np.shape(x))
            direction = upstream[1:]
            if onp.any(_plain(direction)):
                direction = np.reshape(direction, np.shape(x))
                slope = grad(lambda y: np.sum(grad(definition)(y) * direction))
                pulled = pulled + slope(x)
            return pulled

        return pull_back

    defvjp(evaluate, transposed)
    return lambda x: evaluate(x)[0]


def _plain(x: Any) -> onp.ndarray:
    while isbox(x):
        x = getval(x)
    return x
