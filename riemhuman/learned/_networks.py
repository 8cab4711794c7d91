"""Small networks, run by NumPy, or by PyTorch in training."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from types import ModuleType

import numpy as np

from riemhuman.arrays import Array

# Layers of the network of a point cloud.
_N_CLOUD_LAYERS = 3


def network(
    parameters: Mapping[str, Array], name: str, x: Array, backend: ModuleType = np
) -> Array:
    """Return the outputs (..., n_out) of a network with a residual block and a linear part."""
    # y = L x + C h + b₃, h = g + σ(B g + b₂), g = σ(A x + b₁), with names such as "shape.A".
    A, b1 = parameters[f"{name}.A"], parameters[f"{name}.b1"]
    B, b2 = parameters[f"{name}.B"], parameters[f"{name}.b2"]
    C, L, b3 = parameters[f"{name}.C"], parameters[f"{name}.L"], parameters[f"{name}.b3"]
    hidden = activate(x @ A + b1, backend)
    hidden = hidden + activate(hidden @ B + b2, backend)
    return x @ L + hidden @ C + b3


@dataclass(frozen=True)
class NetworkSizes:
    """Numbers of inputs, of hidden units in a layer, and of outputs of a network."""

    n_in: int
    n_hidden: int
    n_out: int


def shapes_of_networks(networks: Mapping[str, NetworkSizes]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the parameters of networks by name."""
    shapes: dict[str, tuple[int, ...]] = {}
    for name, sizes in networks.items():
        shapes |= network_shapes(name, sizes)
    return shapes


def network_shapes(name: str, sizes: NetworkSizes) -> dict[str, tuple[int, ...]]:
    """Return the shapes of a network's parameters."""
    n_in, n_hidden, n_out = sizes.n_in, sizes.n_hidden, sizes.n_out
    return {
        f"{name}.A": (n_in, n_hidden),
        f"{name}.b1": (n_hidden,),
        f"{name}.B": (n_hidden, n_hidden),
        f"{name}.b2": (n_hidden,),
        f"{name}.C": (n_hidden, n_out),
        f"{name}.L": (n_in, n_out),
        f"{name}.b3": (n_out,),
    }


def cloud_features(parameters: Mapping[str, Array], x: Array, backend: ModuleType = np) -> Array:
    """Return the largest value of each feature over the points of clouds (n, n_points, 3)."""
    for layer in range(_N_CLOUD_LAYERS):
        x = x @ parameters[f"cloud.W{layer}"] + parameters[f"cloud.b{layer}"]
        if layer < _N_CLOUD_LAYERS - 1:
            x = activate(x, backend)
    largest: Array = backend.amax(x, 1)
    return largest


def cloud_shapes(n_hidden: int, n_features: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the parameters of `cloud_features`."""
    sizes = (3, n_hidden, 2 * n_hidden, n_features)
    shapes: dict[str, tuple[int, ...]] = {}
    for layer, (n_in, n_out) in enumerate(pairwise(sizes)):
        shapes[f"cloud.W{layer}"] = (n_in, n_out)
        shapes[f"cloud.b{layer}"] = (n_out,)
    return shapes


def activate(x: Array, backend: ModuleType = np) -> Array:
    r"""Return :math:`x / (1 + e^{-x})`."""
    # By the hyperbolic tangent, which does not overflow.
    activated: Array = x * (0.5 + 0.5 * backend.tanh(0.5 * x))
    return activated
