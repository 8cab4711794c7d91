"""Alignment of surfaces: Procrustes analysis, and conversion to metres with y up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Points
from riemhuman.checks import (
    UNITS,
    check_resolution,
    check_same_scale,
    checked,
    choice,
    longest_side,
    real_array,
    weight_shares,
    whole,
)
from riemhuman.errors import ArgumentError, ConvergenceWarning, warn

# A rotation is undetermined if the spread of the points is within rounding of zero: relative to
# the size of the surface, and to the coordinates from which the spread was computed.
_FLAT = 1e-12
_ROUNDING = 100 * np.finfo(np.float64).eps

# Iterations end when the mean moves by less than this share of its size.
_TOLERANCE = 1e-10

_REMEDY = "scale=True scales them, scale=None accepts them unscaled"


_SCALES = (False, True, None)


@checked(scale=choice(*_SCALES))
def procrustes(
    points: ArrayLike,
    to: ArrayLike,
    *,
    scale: bool | None = False,
    weights: ArrayLike | None = None,
) -> Array:
    """Align surfaces in known correspondence with a reference.

    Each surface x is moved to s R x + b, with the rotation R (never a reflection), the translation
    b and, with `scale`, the factor s > 0 that minimise sum_v w_v ‖s R x_v + b - y_v‖² [1]_ [2]_.

    Parameters
    ----------
    points : array_like, shape (..., V, 3), in metres
    to : array_like, shape (V, 3)
        The reference y.
    scale : bool or None
        Whether surfaces are also scaled. With False, surfaces that are clearly in another unit
        raise an error; None accepts them unscaled.
    weights : array_like, shape (V,), optional
        Weights w of the vertices, for example ``template.vertex_areas``; equal by default.

    References
    ----------
    .. [1] Kabsch, "A solution for the best rotation to relate two sets of vectors",
       Acta Crystallographica A32, 1976.
    .. [2] Umeyama, "Least-squares estimation of transformation parameters between two point
       patterns", IEEE PAMI 13(4), 1991, equations 39 to 42.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> moved = bodies[0] + [0.0, 0.0, 2.0]
    >>> bool(abs(rh.procrustes(moved, to=bodies[0]) - bodies[0]).max() < 1e-12)
    True
    """
    surfaces = real_array(points, "points", ("n_vertices", 3))
    check_resolution(surfaces, "points", getattr(points, "dtype", None))
    reference = real_array(to, "to", ("n_vertices", 3), batched=False)
    if surfaces.shape[-2] != len(reference):
        raise ArgumentError(
            f"points has {surfaces.shape[-2]} vertices per surface (shape {surfaces.shape}); "
            f"to has {len(reference)}"
        )
    aligned = _align(surfaces, reference, _shares(weights, len(reference)), bool(scale))
    if scale is False:
        check_same_scale(surfaces, longest_side(reference), "points", "to", remedy=_REMEDY)
    return aligned


@checked(scale=choice(*_SCALES), max_iter=whole(minimum=1))
def generalized_procrustes(
    points: ArrayLike,
    *,
    scale: bool | None = False,
    weights: ArrayLike | None = None,
    max_iter: int = 200,
) -> tuple[Array, Array]:
    """Align surfaces in known correspondence with each other, and return their mean.

    In turn, surfaces are aligned with their mean and the mean is recomputed; every step lowers
    sum_i sum_v w_v ‖s_i R_i x_iv + b_i - m_v‖² [1]_. With `scale`, the mean m keeps the root mean
    square of the centroid sizes of the surfaces. Finally, the mean is aligned with the first
    surface, and all surfaces are aligned with the mean. Do not use it as a template: its limbs
    shrink where poses differ.

    Parameters
    ----------
    points : array_like, shape (..., V, 3)
        Surfaces, in metres, with at least one leading axis; the mean is over all leading axes.
    scale, weights : optional
        As for `procrustes`.
    max_iter : int
        Number of steps after which the iteration stops with a `ConvergenceWarning`.

    Returns
    -------
    aligned : array, shape (..., V, 3)
    mean : array, shape (V, 3)

    References
    ----------
    .. [1] Gower, "Generalized Procrustes analysis", Psychometrika 40(1), 1975.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> aligned, mean = rh.generalized_procrustes(bodies.points[::10])
    >>> aligned.shape, mean.shape
    ((10, 1202, 3), (1202, 3))
    """
    surfaces = real_array(points, "points", ("n_surfaces", "n_vertices", 3))
    check_resolution(surfaces, "points", getattr(points, "dtype", None))
    if surfaces.size == 0:
        raise ArgumentError(f"points must hold at least one surface; found shape {surfaces.shape}")
    shares = _shares(weights, surfaces.shape[-2])
    first = surfaces.reshape(-1, *surfaces.shape[-2:])[0]
    if scale is False:
        check_same_scale(surfaces, longest_side(first), "points", "the first", remedy=_REMEDY)
    size = np.sqrt(_squared_size(_center(surfaces, shares), shares).mean())
    leading_axes = tuple(range(surfaces.ndim - 2))

    mean = first
    for _ in range(max_iter):
        previous = mean
        mean = _align(surfaces, previous, shares, bool(scale)).mean(axis=leading_axes)
        if scale:
            centred = _center(mean, shares)
            mean = mean + (size / np.sqrt(_squared_size(centred, shares)) - 1.0) * centred
        movement = _center(mean - previous, shares)
        if _squared_size(movement, shares) <= (_TOLERANCE * size) ** 2:
            break
    else:
        warn(
            f"generalized_procrustes stopped after {max_iter} iterations, before it converged",
            ConvergenceWarning,
        )
    mean = _align(mean, first, shares, scale=False)
    return _align(surfaces, mean, shares, bool(scale)), mean


def _shares(weights: ArrayLike | None, n_vertices: int) -> Array:
    """Return vertex weights that sum to one."""
    if n_vertices == 0:
        raise ArgumentError("points must have vertices to align; found none")
    return weight_shares(weights, n_vertices)


def _align(surfaces: Points, to: Array, shares: Array, scale: bool) -> Array:
    """Move each surface onto the reference `to`."""
    source, target = _center(surfaces, shares), _center(to, shares)
    left, spread, right = np.linalg.svd(target.T @ (shares[:, np.newaxis] * source))
    # Reversing the weakest axis turns a reflection into a rotation at the least cost.
    sign = np.sign(np.linalg.det(left) * np.linalg.det(right))
    spread[..., 2] *= sign
    right[..., 2, :] *= sign[..., np.newaxis]

    squared_size = _squared_size(source, shares)
    noise = _ROUNDING * np.abs(surfaces).max(axis=(-1, -2))
    target_size = np.sqrt(_squared_size(target, shares))
    target_noise = _ROUNDING * np.abs(to).max()
    ambiguous = spread[..., 1] + spread[..., 2] <= (
        np.sqrt(squared_size) * (_FLAT * target_size + target_noise) + noise * target_size
    )
    if ambiguous.any():
        index = ", ".join(str(i) for i in np.argwhere(ambiguous)[0])
        name = f"points[{index}]" if index else "points"
        raise ArgumentError(
            f"{name} has no single best alignment: it or its "
            "reference lies on a line or in a point, or the two are mirror images"
        )
    rotation: Array = left @ right
    if scale:
        rotation *= (spread.sum(axis=-1) / squared_size)[..., np.newaxis, np.newaxis]
    aligned: Array = source @ np.swapaxes(rotation, -1, -2) + shares @ to
    return aligned


def _center(surfaces: Points, shares: Array) -> Array:
    """Move the weighted centre of each surface to the origin."""
    return surfaces - (shares @ surfaces)[..., np.newaxis, :]


def _squared_size(centred: Array, shares: Array) -> Array:
    """Return the weighted mean squared distance of vertices from the origin."""
    squared_size: Array = np.sum(centred**2, axis=-1) @ shares
    return squared_size


# Rotations to y up by the axis that points up, about the third axis.
_ROTATIONS = {
    "x": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-x": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]],
    "-y": [[-1, 0, 0], [0, -1, 0], [0, 0, 1]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}
AXES = tuple(_ROTATIONS)
"""Names of the axes that may point up."""


@checked(unit=choice(*UNITS), up=choice(*AXES))
def make_upright(points: Points, unit: str | None = None, up: str | None = None) -> Array:
    """Return surfaces in metres, rotated so that y points up, shape (..., 3).

    Parameters
    ----------
    points : array, shape (..., 3)
    unit : {"metres", "centimetres", "millimetres", "inches"}, optional
        Unit of the coordinates; by default surfaces are not scaled.
    up : {"x", "y", "z", "-x", "-y", "-z"}, optional
        Axis that points up; by default surfaces are not rotated.

    Examples
    --------
    >>> rh.surfaces.make_upright(np.array([[0.0, 0.0, 1700.0]]), "millimetres", up="z").tolist()
    [[0.0, 1.7, 0.0]]
    """
    points = real_array(points, "points", (3,), finite=False)
    if unit is not None:
        points = points / UNITS[unit]
    return points if up is None else points @ np.array(_ROTATIONS[up], dtype=float).T
