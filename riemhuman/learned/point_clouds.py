"""Points spread over surfaces, and a network that does not depend on their order."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType
from typing import Any

import numpy as np
from numpy import ndarray

from riemhuman.errors import DegenerateSurfaceError
from riemhuman.learned.networks import activated


def surface_points(
    vertices: ndarray, faces: ndarray, n_points: int, rng: np.random.Generator
) -> ndarray:
    """Return random points spread evenly over a surface, relative to their mean.

    The sequence of triangles is cut into stretches of equal area; each contains one point.

    Parameters
    ----------
    vertices : array, shape (V, 3)
        Vertex positions.
    faces : array of int, shape (F, 3)
        Triangles.
    n_points : int
        Number of points.
    rng : numpy.random.Generator
        Generator of the points.

    Returns
    -------
    array, shape (n_points, 3)

    Raises
    ------
    DegenerateSurfaceError
        If the surface has no area.
    """
    corners = vertices[faces]
    sides = corners[:, 1:] - corners[:, :1]
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    ends = np.cumsum(areas)
    if not len(ends) or not ends[-1] > 0:
        raise DegenerateSurfaceError("the surface has no area; points cannot be spread over it")
    wanted = (np.arange(n_points) + rng.random(n_points)) * (ends[-1] / n_points)
    triangles = np.minimum(np.searchsorted(ends, wanted), len(ends) - 1)
    root, other = np.sqrt(rng.random(n_points)), rng.random(n_points)
    shares = np.stack([1.0 - root, root * (1.0 - other), root * other], axis=1)
    points = np.einsum("ij,ijk->ik", shares, corners[triangles])
    return points - points.mean(axis=0)


def cloud_features(parameters: Mapping[str, Any], x: Any, backend: ModuleType = np) -> Any:
    r"""Return the largest value of each feature over the points of a cloud.

    After Qi, Su, Mo and Guibas, "PointNet: deep learning on point sets for 3D classification and
    segmentation", CVPR 2017: three layers that are the same for all points.

    Parameters
    ----------
    parameters : mapping of str to array
        Parameters.
    x : array, shape (n, n_points, 3)
        Clouds.
    backend : module
        NumPy, or PyTorch if the parameters are tensors.

    Returns
    -------
    array, shape (n, n_features)
    """
    for layer in range(3):
        x = x @ parameters[f"cloud.W{layer}"] + parameters[f"cloud.b{layer}"]
        if layer < 2:
            x = activated(x, backend)
    return backend.amax(x, 1)


def cloud_shapes(n_hidden: int, n_features: int) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the parameters of `cloud_features`.

    Parameters
    ----------
    n_hidden, n_features : int
        Sizes of the layers: n_hidden, twice that, and n_features.

    Returns
    -------
    dict of str to tuple of int
    """
    sizes = (3, n_hidden, 2 * n_hidden, n_features)
    return {f"cloud.W{layer}": (sizes[layer], sizes[layer + 1]) for layer in range(3)} | {
        f"cloud.b{layer}": (sizes[layer + 1],) for layer in range(3)
    }


def initial_cloud(n_hidden: int, n_features: int, rng: np.random.Generator) -> dict[str, ndarray]:
    """Return initial parameters of `cloud_features`.

    Parameters
    ----------
    n_hidden, n_features : int
        Sizes of the layers.
    rng : numpy.random.Generator
        Generator of the parameters.

    Returns
    -------
    dict of str to array
        In single precision.
    """
    shapes = cloud_shapes(n_hidden, n_features)
    return {
        name: (rng.standard_normal(shape) * np.sqrt(2.0 / shape[0])).astype(np.float32)
        for name, shape in shapes.items()
        if len(shape) == 2
    } | {
        # Random biases activate features at different places of the cloud.
        name: (0.5 * rng.standard_normal(shape)).astype(np.float32)
        for name, shape in shapes.items()
        if len(shape) == 1
    }
