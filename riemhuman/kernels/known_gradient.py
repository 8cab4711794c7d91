"""Autograd primitives whose value and gradient come from faster code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import autograd.numpy as np
import numpy as onp
from autograd import grad
from autograd.extend import defvjp, primitive
from autograd.tracer import getval, isbox

Function = Callable[[Any], Any]


def with_known_gradient(
    value_and_gradient: Callable[[onp.ndarray], tuple[float, onp.ndarray]], definition: Function
) -> Function:
    """Return a scalar function as an autograd primitive.

    Value and first derivatives come from `value_and_gradient`, in one evaluation; derivatives of
    the gradient come from the definition.

    Parameters
    ----------
    value_and_gradient : callable
        Returns value and gradient for a plain array.
    definition : callable
        The same function in differentiable operations.

    Returns
    -------
    callable
        Returns the value for an array, plain or traced by autograd.
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
