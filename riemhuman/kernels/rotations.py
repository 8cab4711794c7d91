"""Rotations from axis-angle vectors, smooth through the zero angle."""

from __future__ import annotations

from typing import Any

import autograd.numpy as np

from riemhuman.checks import real_array

# Below this squared angle the power series is exact to double precision and, unlike the
# quotients, has derivatives of every order at zero.
_SERIES_BELOW = 1e-3


def rotation_matrix(axis_angle: Any) -> Any:
    """Return the rotation matrices of axis-angle vectors (Rodrigues' formula).

    R = I + (sin θ / θ) K + ((1 − cos θ) / θ²) K², with θ = ‖ω‖ and K the cross-product
    matrix of ω. Differentiable with autograd everywhere, θ = 0 included.

    Parameters
    ----------
    axis_angle : array_like, shape (..., 3)
        Rotation vectors ω in radians: direction is the axis, length the angle.

    Returns
    -------
    rotations : array, shape (..., 3, 3)
        Matrices that act on columns.

    Raises
    ------
    ArgumentError
        If the last axis is not of length 3 or an entry is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> rh.bodies.rotation_matrix(np.array([0.0, 0.0, np.pi / 2])).round(6).astype(int).tolist()
    [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    """
    vector = real_array(axis_angle, "axis_angle", (3,))
    squared_angle = np.sum(vector * vector, axis=-1)[..., None, None]
    small = squared_angle < _SERIES_BELOW
    x = np.where(small, squared_angle, 0.0)
    angle = np.sqrt(np.where(small, 1.0, squared_angle))
    sine_quotient = np.where(
        small, 1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0)), np.sin(angle) / angle
    )
    cross = cross_product_matrix(vector)
    second = _cosine_quotient(x, angle, small) * np.matmul(cross, cross)
    return np.eye(3) + sine_quotient * cross + second


def rotation_derivative(axis_angle: Any) -> Any:
    """Return the matrices that take changes of axis-angle vectors to turns of the bodies.

    The left Jacobian of the rotation group: with R(ω) the rotation, for small changes,
    R(ω + dω) = R(J dω) R(ω) to first order, where
    J = I + ((1 − cos θ) / θ²) K + ((θ − sin θ) / θ³) K².

    Parameters
    ----------
    axis_angle : array_like, shape (..., 3)
        Rotation vectors ω in radians.

    Returns
    -------
    derivatives : array, shape (..., 3, 3)
        Matrices J, in the axes that R maps into.

    Raises
    ------
    ArgumentError
        If the last axis is not of length 3 or an entry is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> rh.bodies.rotation_derivative(np.zeros(3)).tolist()  # turns about the axes
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    vector = real_array(axis_angle, "axis_angle", (3,))
    squared_angle = np.sum(vector * vector, axis=-1)[..., None, None]
    small = squared_angle < _SERIES_BELOW
    x = np.where(small, squared_angle, 0.0)
    angle = np.sqrt(np.where(small, 1.0, squared_angle))
    third_quotient = np.where(
        small,
        1.0 / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0))),
        (angle - np.sin(angle)) / angle**3,
    )
    cross = cross_product_matrix(vector)
    return (
        np.eye(3)
        + _cosine_quotient(x, angle, small) * cross
        + third_quotient * np.matmul(cross, cross)
    )


def _cosine_quotient(x: Any, angle: Any, small: Any) -> Any:
    # (1 − cos θ)/θ² as ½ (sin(θ/2) / (θ/2))²: no cancellation.
    return np.where(
        small,
        0.5 * (1.0 - x / 12.0 * (1.0 - x / 30.0 * (1.0 - x / 56.0))),
        2.0 * (np.sin(0.5 * angle) / angle) ** 2,
    )


def cross_product_matrix(vector: Any) -> Any:
    """Return the matrices of the cross products with vectors, shape (..., 3, 3).

    Parameters
    ----------
    vector : array, shape (..., 3)
        Vectors.

    Returns
    -------
    array, shape (..., 3, 3)
    """
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = np.zeros(np.shape(x))
    entries = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    return np.reshape(entries, (*np.shape(x), 3, 3))
