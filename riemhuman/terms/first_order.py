r"""The four parts of the first-order change of a surface, each with a weight.

A deformation h of a surface f changes g by δg and n by δn. With A = g⁻¹δg, its traceless part A₀
and ξ = dfᵀdh − dhᵀdf,

.. math:: |dh_m|^2 = \tfrac14 \operatorname{tr} A_0^2, \quad
          |dh_+|^2 = \tfrac18 (\operatorname{tr} A)^2, \quad
          |dh_\perp|^2 = |\delta n|^2, \quad
          |dh_0|^2 = \tfrac14 \operatorname{tr}(g^{-1}\xi g^{-1}\xi^\top)

add up to |dh|², the Dirichlet energy (Su, Bauer, Preston, Laga, Klassen, "Shape analysis of
surfaces using general elastic metrics", Journal of Mathematical Imaging and Vision 62, 2020). In an
orthonormal frame e₁, e₂, n of a triangle, with M_kj = e_k·∂_j h, they are

.. math:: \tfrac12((M_{11} - M_{22})^2 + (M_{12} + M_{21})^2), \quad
          \tfrac12(M_{11} + M_{22})^2, \quad M_{31}^2 + M_{32}^2, \quad
          \tfrac12(M_{12} - M_{21})^2.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import autograd.numpy as np
import numpy as onp
from numpy import ndarray
from scipy.sparse import csr_array

from riemhuman.kernels import surface
from riemhuman.kernels.compilation import njit
from riemhuman.kernels.moving_frames import (
    add_to_corners,
    derivatives_in_frame,
    frame_of,
    is_worth_threads,
    sums_in_chunks,
)
from riemhuman.kernels.sums import integrate
from riemhuman.kernels.threads import in_chunks


class FirstOrderWeights(NamedTuple):
    """What each part of the first-order change costs.

    Attributes
    ----------
    a1, b1, c1, d1 : float
        Weights of |dh_m|², |dh_+|², |dh_⊥|² and |dh_0|², with areas of the moving surface.
    bend : float
        Weight of |dh_⊥|² with areas of the template, as the paper's family has it.
    """

    a1: float = 0.0
    b1: float = 0.0
    c1: float = 0.0
    d1: float = 0.0
    bend: float = 0.0


def inner_product(
    h: ndarray,
    k: ndarray,
    f: ndarray,
    weights: FirstOrderWeights,
    operator: csr_array,
    areas: ndarray,
) -> ndarray:
    """Return the weighted sum of the parts, integrated: the definition.

    Parameters
    ----------
    h, k : array, shape (..., V, 3)
        Deformations.
    f : array, shape (..., V, 3)
        Surfaces whose triangles have an area.
    weights : FirstOrderWeights
        Weights of the parts.
    operator : csr_array, shape (2F, V)
        The template's differential operator.
    areas : array, shape (F,)
        Template areas w_t.

    Returns
    -------
    array, shape (...)
    """
    derivatives = surface.partial_derivatives(f, operator)
    parts_h = _parts(derivatives, surface.partial_derivatives(h, operator))
    parts_k = parts_h if k is h else _parts(derivatives, surface.partial_derivatives(k, operator))
    area_vectors = surface.cross(*derivatives)
    ratio = np.sqrt(surface.dot(area_vectors, area_vectors))
    a1, b1, c1, d1, bend = weights
    density: Any = 0.0
    factors = (a1 * ratio, b1 * ratio, c1 * ratio + bend, d1 * ratio)
    for factor, part_h, part_k in zip(factors, parts_h, parts_k, strict=True):
        density = density + factor * np.sum(part_h * part_k, axis=-1)
    return integrate(density, areas)


def _parts(
    derivatives: tuple[ndarray, ndarray], change: tuple[ndarray, ndarray]
) -> tuple[ndarray, ...]:
    """Return dh_m, dh_+, dh_⊥ and dh_0, as vectors whose squared lengths are those of the parts."""
    (f_u, f_v), (h_u, h_v) = derivatives, change
    # e₁, e₂ from f_u = p e₁, f_v = q e₁ + r e₂.
    p = np.sqrt(surface.dot(f_u, f_u))[..., None]
    e1 = f_u / p
    n = surface.unit_normals(f_u, f_v)
    e2 = surface.cross(n, e1)
    q, r = surface.dot(f_v, e1)[..., None], surface.dot(f_v, e2)[..., None]
    along1 = h_u / p
    along2 = (h_v - q * along1) / r
    m11, m12, m21, m22 = (surface.dot(e, along) for e in (e1, e2) for along in (along1, along2))
    root = np.sqrt(0.5)
    return (
        root * np.stack([m11 - m22, m12 + m21], axis=-1),
        root * (m11 + m22)[..., None],
        np.stack([surface.dot(n, along1), surface.dot(n, along2)], axis=-1),
        root * (m12 - m21)[..., None],
    )


@njit(nogil=True, error_model="numpy")
def _add_blocks(
    points: ndarray,
    faces: ndarray,
    areas: ndarray,
    first: int,
    last: int,
    weights: tuple[float, ...],
    blocks: ndarray,
) -> None:
    a1, b1, c1, d1, bend = weights
    forms, costs = onp.empty((6, 9)), onp.empty(6)
    along, across = onp.zeros(3), onp.empty(3)
    for t in range(first, last):
        frame = frame_of(points, faces[t], 0)
        area, over_p, over_r, skew = frame[:4]
        axes = (frame[4:7], frame[7:10], frame[10:])
        # Gradients of the three barycentric coordinates along e₁ and e₂.
        along[0], along[1] = -over_p, over_p
        across[0], across[1], across[2] = skew - over_r, -skew, over_r
        costs[0] = costs[1] = 0.5 * a1 * area
        costs[2], costs[3] = 0.5 * b1 * area, 0.5 * d1 * area
        costs[4] = costs[5] = c1 * area + bend * areas[t]
        for corner in range(3):
            one, two = along[corner], across[corner]
            for d in range(3):
                column = 3 * corner + d
                e1, e2, n = axes[0][d], axes[1][d], axes[2][d]
                forms[0, column], forms[1, column] = one * e1 - two * e2, two * e1 + one * e2
                forms[2, column], forms[3, column] = one * e1 + two * e2, two * e1 - one * e2
                forms[4, column], forms[5, column] = one * n, two * n
        for row in range(6):
            if costs[row] > 0.0:
                for i in range(9):
                    for j in range(9):
                        blocks[t, i, j] += costs[row] * forms[row, i] * forms[row, j]


def add_blocks(
    blocks: ndarray, f: ndarray, faces: ndarray, areas: ndarray, weights: FirstOrderWeights
) -> None:
    """Add the 9 × 9 matrices of `inner_product` at a surface, one a triangle.

    Parameters
    ----------
    blocks : array, shape (F, 9, 9)
        Added to; rows and columns run over the coordinates of the first, second, third corner.
    f : array, shape (V, 3)
        Surface whose triangles have an area.
    faces : array of int, shape (F, 3)
        Triangles.
    areas : array, shape (F,)
        Template areas w_t.
    weights : FirstOrderWeights
        Weights of the parts.
    """
    points = np.ascontiguousarray(f[:, None])

    def run(first: int, last: int) -> None:
        _add_blocks(points, faces, areas, first, last, tuple(weights), blocks)

    in_chunks(run, len(faces), threaded=is_worth_threads(points, faces))


@njit(nogil=True, error_model="numpy")
def _squared_norms(
    vectors: ndarray,
    surfaces: ndarray,
    faces: ndarray,
    areas: ndarray,
    first: int,
    last: int,
    weights: tuple[float, ...],
    vector_slopes: ndarray,
    surface_slopes: ndarray,
) -> float:
    a1, b1, c1, d1, bend = weights
    total = 0.0
    for t in range(first, last):
        for i in range(surfaces.shape[1]):
            frame = frame_of(surfaces, faces[t], i)
            area = frame[0]
            if area == 0.0:
                total = math.inf
                continue
            m11, m12, m21, m22, m31, m32 = derivatives_in_frame(vectors, faces[t], i, frame)
            across, along = m11 - m22, m12 + m21
            trace, turn = m11 + m22, m12 - m21
            tilt = m31 * m31 + m32 * m32
            density = 0.5 * (a1 * (across * across + along * along) + b1 * trace * trace)
            moving = area * (density + 0.5 * d1 * turn * turn + c1 * tilt)
            total += moving + bend * areas[t] * tilt
            # Slopes K in M.
            k11, k22 = area * (b1 * trace + a1 * across), area * (b1 * trace - a1 * across)
            k12, k21 = area * (a1 * along + d1 * turn), area * (a1 * along - d1 * turn)
            bending = 2.0 * (c1 * area + bend * areas[t])
            k31, k32 = bending * m31, bending * m32
            slopes = (k11, k12, k21, k22, k31, k32)
            add_to_corners(vector_slopes, faces[t], i, frame, slopes)
            # Of the surface's own derivatives in the frame, the symmetric part stretches the
            # triangle, the antisymmetric part turns the frame, and the last row tilts it.
            shear = m11 * k12 + m12 * k11 + m21 * k22 + m22 * k21 + m31 * k32 + m32 * k31
            spin = m11 * k21 + m12 * k22 - m21 * k11 - m22 * k12
            slopes = (
                moving - m11 * k11 - m21 * k21 - m31 * k31,
                0.5 * (spin - shear),
                -0.5 * (spin + shear),
                moving - m12 * k12 - m22 * k22 - m32 * k32,
                k11 * m31 + k12 * m32 - k31 * m11 - k32 * m12,
                k21 * m31 + k22 * m32 - k31 * m21 - k32 * m22,
            )
            add_to_corners(surface_slopes, faces[t], i, frame, slopes)
    return total


def squared_norms_and_slopes(
    vectors: ndarray,
    surfaces: ndarray,
    faces: ndarray,
    areas: ndarray,
    weights: FirstOrderWeights,
) -> tuple[float, ndarray, ndarray]:
    """Return the sum of the squared norms of deformations, each at its surface, and its slopes.

    Parameters
    ----------
    vectors, surfaces : array, shape (V, n, 3)
        Deformations and surfaces, vertex by vertex.
    faces : array of int, shape (F, 3)
        Triangles.
    areas : array, shape (F,)
        Template areas w_t.
    weights : FirstOrderWeights
        Weights of the parts.

    Returns
    -------
    value : float
        Infinite where a triangle has no area.
    vector_slopes, surface_slopes : array, shape (V, n, 3)
        Slopes in the deformations and in the surfaces.
    """

    def run(first: int, last: int) -> tuple[float, ndarray, ndarray]:
        slopes = np.zeros(surfaces.shape), np.zeros(surfaces.shape)
        value = _squared_norms(
            vectors, surfaces, faces, areas, first, last, tuple(weights), *slopes
        )
        return value, *slopes

    return sums_in_chunks(run, len(faces), threaded=is_worth_threads(surfaces, faces))
