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

from riemhuman.kernels import surface, triangles
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.threads import sums_in_chunks
from riemhuman.kernels.triangles import (
    add_to_corners,
    derivatives_in_frame,
    frame_of,
    is_worth_threads,
)
from riemhuman.terms.quadratic import QuadraticTerm, Slopes


class FirstOrderWeights(NamedTuple):
    """Weights of the parts of the first-order change."""

    a1: float = 0.0
    b1: float = 0.0
    c1: float = 0.0
    d1: float = 0.0
    bend: float = 0.0

    def forms(self) -> tuple[ndarray, ndarray]:
        """Return the quadratic forms of `surface.frame_components`, by area of both surfaces."""
        a1, b1, c1, d1, bend = self
        moving = onp.zeros((6, 6))
        moving[[0, 3], [0, 3]], moving[[0, 3], [3, 0]] = 0.5 * (b1 + a1), 0.5 * (b1 - a1)
        moving[[1, 2], [1, 2]], moving[[1, 2], [2, 1]] = 0.5 * (a1 + d1), 0.5 * (a1 - d1)
        moving[[4, 5], [4, 5]] = c1
        still = onp.zeros((6, 6))
        still[[4, 5], [4, 5]] = bend
        return moving, still

    @classmethod
    def from_forms(cls, moving: ndarray, still: ndarray) -> FirstOrderWeights | None:
        """Return the weights that have these forms, or None if there are none."""
        found = cls(
            a1=moving[0, 0] - moving[0, 3],
            b1=moving[0, 0] + moving[0, 3],
            c1=moving[4, 4],
            d1=moving[1, 1] - moving[1, 2],
            bend=still[4, 4],
        )
        size = onp.abs(moving).max() + onp.abs(still).max()
        for one, other in zip(found.forms(), (moving, still), strict=True):
            if onp.abs(one - other).max() > 1e-12 * size:
                return None
        return found


class FirstOrderTerm(QuadraticTerm):
    """The weighted sum of the parts, integrated."""

    def __init__(self, template: Any, weights: FirstOrderWeights) -> None:
        self.template, self.weights = template, weights
        self.is_stretch_invariant = weights.a1 == 0.0 and weights.b1 == 0.0

    def inner_product(self, h: ndarray, k: ndarray, f: ndarray) -> ndarray:
        operator = self.template.differential_operator
        first = surface.derivatives(f, operator)
        parts_h = _parts(first, h, operator)
        parts_k = parts_h if k is h else _parts(first, k, operator)
        a1, b1, c1, d1, bend = self.weights
        costs = (
            a1 * first.areas,
            b1 * first.areas,
            c1 * first.areas + bend,
            d1 * first.areas,
        )
        density: Any = 0.0
        for cost, one, other in zip(costs, parts_h, parts_k, strict=True):
            density = density + cost * np.sum(one * other, axis=-1)
        return np.sum(density * self.template.face_areas, axis=-1)

    def matrix(self, f: ndarray) -> csr_array:
        template = self.template
        first = surface.derivatives(f, template.differential_operator)
        moving, still = template.face_areas * first.areas, template.face_areas
        moving_form, still_form = self.weights.forms()
        forms = moving[:, None, None] * moving_form + still[:, None, None] * still_form
        blocks = onp.zeros((template.n_faces, 9, 9))
        triangles.add_blocks(blocks, f, template.faces, forms)
        return template.assembler.assemble(blocks)

    def squared_norms_and_slopes(self, vectors: ndarray, surfaces: ndarray) -> Slopes:
        faces, areas = self.template.faces, self.template.face_areas

        def run(first: int, last: int) -> tuple[float, ndarray, ndarray]:
            slopes = onp.zeros(surfaces.shape), onp.zeros(surfaces.shape)
            value = _squared_norms(
                vectors, surfaces, faces, areas, first, last, tuple(self.weights), *slopes
            )
            return value, *slopes

        return sums_in_chunks(run, len(faces), threaded=is_worth_threads(surfaces, faces))


def _parts(first: surface.Derivatives, h: ndarray, operator: csr_array) -> tuple[ndarray, ...]:
    """Return dh_m, dh_+, dh_⊥ and dh_0, as vectors whose squared lengths are those of the parts."""
    m = surface.frame_components(first, *surface.partial_derivatives(h, operator))
    m11, m12, m21, m22 = (m[..., k] for k in range(4))
    root = np.sqrt(0.5)
    return (
        root * np.stack([m11 - m22, m12 + m21], axis=-1),
        root * (m11 + m22)[..., None],
        m[..., 4:],
        root * (m12 - m21)[..., None],
    )


@compiled
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
