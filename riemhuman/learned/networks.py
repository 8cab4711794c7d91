"""Small networks: one definition runs in NumPy for use and in PyTorch for training."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np
from numpy import ndarray

Parameters = Mapping[str, Any]

_KEYS = ("A", "b1", "B", "b2", "C", "L", "b3")


def network(parameters: Parameters, name: str, x: Any, backend: ModuleType = np) -> Any:
    r"""Return the value of a network with one hidden layer, a residual block and a linear part.

    .. math::
        y = L x + C h + b_3, \quad h = g + \sigma(B g + b_2), \quad g = \sigma(A x + b_1)

    with :math:`\sigma(x) = x / (1 + e^{-x})`.

    Parameters
    ----------
    parameters : mapping of str to array
        Parameters of all networks, with names such as "shape.A" for the network "shape".
    name : str
        Name of the network.
    x : array, shape (..., n_in)
        Inputs.
    backend : module
        NumPy, or PyTorch if `x` and `parameters` are tensors.

    Returns
    -------
    array, shape (..., n_out)
    """
    A, b1, B, b2, C, L, b3 = (parameters[f"{name}.{key}"] for key in _KEYS)
    hidden = activated(x @ A + b1, backend)
    hidden = hidden + activated(hidden @ B + b2, backend)
    return x @ L + hidden @ C + b3


def initial_network(
    name: str, n_in: int, n_hidden: int, n_out: int, rng: np.random.Generator
) -> dict[str, ndarray]:
    """Return initial parameters: a random linear part, and hidden layers without effect.

    Parameters
    ----------
    name : str
        Name of the network.
    n_in, n_hidden, n_out : int
        Sizes of its layers.
    rng : numpy.random.Generator
        Generator of the random parameters.

    Returns
    -------
    dict of str to array
        In single precision.
    """
    found = {}
    for key, shape in network_shapes(name, n_in, n_hidden, n_out).items():
        is_random = key[-1] in "ABL"
        array = rng.standard_normal(shape) / np.sqrt(shape[0]) if is_random else np.zeros(shape)
        found[key] = array.astype(np.float32)
    return found


def network_shapes(name: str, n_in: int, n_hidden: int, n_out: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a network's parameters.

    Parameters
    ----------
    name : str
        Name of the network.
    n_in, n_hidden, n_out : int
        Sizes of its layers.

    Returns
    -------
    dict of str to tuple of int
    """
    found = {
        "A": (n_in, n_hidden),
        "b1": (n_hidden,),
        "B": (n_hidden, n_hidden),
        "b2": (n_hidden,),
        "C": (n_hidden, n_out),
        "L": (n_in, n_out),
        "b3": (n_out,),
    }
    return {f"{name}.{key}": shape for key, shape in found.items()}


def in_single_precision(numbers: Any) -> ndarray:
    """Return numbers rounded to single precision, the precision of files.

    Rounding also removes the last digits of sums, which depend on the order of their terms.

    Parameters
    ----------
    numbers : array_like
        Numbers.

    Returns
    -------
    array
        In double precision.
    """
    return np.asarray(numbers, dtype=np.float32).astype(np.float64)


def activated(x: Any, backend: ModuleType = np) -> Any:
    r"""Return :math:`x / (1 + e^{-x})`.

    Parameters
    ----------
    x : array
        Numbers.
    backend : module
        NumPy, or PyTorch if `x` is a tensor.

    Returns
    -------
    array
    """
    # By the hyperbolic tangent, which does not overflow.
    return x * (0.5 + 0.5 * backend.tanh(0.5 * x))
