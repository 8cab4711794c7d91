"""Functions of matrices and points act on each by itself: a stack gives the stack of results."""

import numpy as np
from ebin_matrices import matrices

from riemhuman.terms import (
    ebin_geodesics,
    ebin_matrices,
    ebin_tangent,
)

LAM = 0.4
RNG = np.random.default_rng(0)
G, OTHER = (matrices(6, 2.0, RNG).reshape(2, 3, 2, 2) for _ in range(2))
TANGENT, VECTOR = (
    0.2 * ebin_tangent.symmetric_part(RNG.standard_normal((2, 3, 2, 2))) for _ in range(2)
)
NUMBERS = RNG.uniform(0.2, 2.0, (3, 2, 3))

OF_MATRICES = {
    "trace": lambda g: ebin_tangent.trace(g),
    "traceless": lambda g: ebin_tangent.traceless(g),
    "symmetric part": lambda g: ebin_tangent.symmetric_part(g),
    "size": lambda g: ebin_tangent.size(ebin_tangent.traceless(g)),
    "traceless exponential": lambda g: ebin_geodesics.traceless_exp(
        ebin_tangent.traceless(g), g[..., 0, 0]
    ),
    "determinants": ebin_matrices.determinants,
    "degenerate": ebin_matrices.is_degenerate,
    "shapeless": ebin_matrices.has_lost_its_shape,
    "coordinates": ebin_matrices.coordinates,
}
OF_PAIRS = {
    "angle": lambda g, other: ebin_matrices.angle(g, other, LAM),
    "log": lambda g, other: ebin_geodesics.log(g, other, LAM),
    "traceless log": ebin_geodesics.traceless_log,
    "geodesic": lambda g, other: (
        ebin_geodesics.geodesic(g, other, 0.1 + 0.5 * g[..., 0, 0] / g[..., 0, 0].max(), LAM)
        if g.ndim < 3
        else ebin_geodesics.geodesic(g, other, 0.6 + 0.0 * g[..., 0, 0], LAM)
    ),
}
