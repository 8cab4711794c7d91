r"""The rotations SO(3), point by point: exponential, logarithm, transport, projection.

With the metric :math:`\langle RA, RB\rangle = \tfrac12 \mathrm{tr}(A^T B)` of skew A and B, the
distance of two rotations is the angle of the rotation between them. A rotation is ± a unit
quaternion, and the angle is twice that between the quaternions, up to sign.
"""

from __future__ import annotations

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, primitive
from numpy import ndarray

from riemhuman.checks import values_of
from riemhuman.kernels.compiled import compiled
from riemhuman.kernels.rotations import cross_product_matrix, rotation_matrix
from riemhuman.kernels.scalars import square_root
from riemhuman.kernels.surface import dot

HALF_TURN = np.pi - 8 * np.finfo(float).eps
"""From this angle on, the axis of the rotation between two rotations is rounding error alone."""


def transpose(matrices: ndarray) -> ndarray:
    """Return the transposed matrices, shape (..., 3, 3).

    Parameters
    ----------
    matrices : array, shape (..., 3, 3)
        Matrices.

    Returns
    -------
    array, shape (..., 3, 3)
    """
    return np.swapaxes(matrices, -1, -2)


def axial(matrices: ndarray) -> ndarray:
    """Return the vectors of the skew parts, ½ (M − Mᵀ) = [v]×.

    Parameters
    ----------
    matrices : array, shape (..., 3, 3)
        Matrices M.

    Returns
    -------
    array, shape (..., 3)
    """
    return 0.5 * np.stack(
        [
            matrices[..., 2, 1] - matrices[..., 1, 2],
            matrices[..., 0, 2] - matrices[..., 2, 0],
            matrices[..., 1, 0] - matrices[..., 0, 1],
        ],
        axis=-1,
    )


def quaternions(rotations: ndarray) -> ndarray:
    """Return unit quaternions of rotations, of either sign; the scalar part comes first.

    Of the columns of q qᵀ, all of them multiples of q, the longest is scaled to unit length, so
    that no digits are lost (after Shepperd, "Quaternion from rotation matrix", Journal of Guidance
    and Control 1(3), 1978).

    Parameters
    ----------
    rotations : array, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    array, shape (..., 4)
    """
    diagonal = [rotations[..., i, i] for i in range(3)]
    x, y, z = (2.0 * part for part in np.moveaxis(axial(rotations), -1, 0))
    xy, xz, yz = (rotations[..., i, j] + rotations[..., j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    # 4 q qᵀ, whose k-th column is q times four times its k-th component.
    squares = [1.0 + diagonal[0] + diagonal[1] + diagonal[2]] + [
        1.0 + 2.0 * diagonal[i] - (diagonal[0] + diagonal[1] + diagonal[2]) for i in range(3)
    ]
    columns = (
        (squares[0], x, y, z),
        (x, squares[1], xy, xz),
        (y, xy, squares[2], yz),
        (z, xz, yz, squares[3]),
    )
    largest = onp.argmax(onp.stack([values_of(square) for square in squares]), axis=0)
    chosen = [sum(np.where(largest == k, columns[k][i], 0.0) for k in range(4)) for i in range(4)]
    column = np.stack(chosen, axis=-1)
    return column / np.sqrt(dot(column, column))[..., None]


def log(r1: ndarray, r2: ndarray) -> ndarray:
    """Return the vector ω, of length at most π, of the shortest rotation: r₂ = r₁ exp [ω]×.

    Parameters
    ----------
    r1, r2 : array, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    array, shape (..., 3)
    """
    q = quaternions(np.matmul(transpose(r1), r2))
    q = q * np.where(q[..., :1] < 0, -1.0, 1.0)
    vector = q[..., 1:]
    sine = square_root(dot(vector, vector))
    safe = np.where(sine > 0, sine, 1.0)
    scale = np.where(sine > 0, 2.0 * np.arctan2(safe, q[..., 0]) / safe, 2.0)
    return scale[..., None] * vector


def exp(omega: ndarray, r: ndarray) -> ndarray:
    """Return r exp [ω]×.

    Parameters
    ----------
    omega : array, shape (..., 3)
        Rotation vectors.
    r : array, shape (..., 3, 3)
        Rotations.

    Returns
    -------
    array, shape (..., 3, 3)
    """
    return np.matmul(r, rotation_matrix(omega))


def parallel_transport(vector: ndarray, omega: ndarray) -> ndarray:
    """Transport along t ↦ r exp(t [ω]×), for unit time, in the body's axes.

    The tangent vector r [v]× becomes r exp([ω]×) [w]×, with w = exp(−½ [ω]×) v.

    Parameters
    ----------
    vector : array, shape (..., 3)
        Vectors v.
    omega : array, shape (..., 3)
        Rotation vectors ω, the direction of transport.

    Returns
    -------
    array, shape (..., 3)
        Vectors w.
    """
    return np.matmul(rotation_matrix(-0.5 * omega), vector[..., None])[..., 0]


@primitive
def nearest_rotations(matrices: ndarray) -> ndarray:
    """Return the rotations R nearest to matrices, which make tr(Rᵀ M) largest.

    Where several are as near, which is where the singular values σ₂ and σ₃ of M are equal and
    det M < 0, or σ₂ = σ₃ = 0, one of them is returned, and its derivative is 0.

    Parameters
    ----------
    matrices : array, shape (..., 3, 3)
        Matrices.

    Returns
    -------
    array, shape (..., 3, 3)
    """
    matrices = onp.asarray(matrices, dtype=onp.float64)
    flat = onp.ascontiguousarray(matrices.reshape(-1, 3, 3))
    found, near = onp.empty(flat.shape), onp.empty(len(flat), dtype=bool)
    _by_newton(flat, found, near)
    left, _, right = onp.linalg.svd(flat[~near])
    left[..., 2] *= onp.sign(onp.linalg.det(left) * onp.linalg.det(right))[..., None]
    found[~near] = left @ right
    return found.reshape(matrices.shape)


@compiled
def _by_newton(matrices: ndarray, found: ndarray, near: ndarray) -> None:
    """Fill the limits of X ← ½ (X + X⁻ᵀ), and which of the matrices are near enough for it.

    Faster than singular values and as exact, for means of rotations not too far apart (Higham,
    "Computing the polar decomposition", SIAM Journal on Scientific and Statistical Computing 7(4),
    1986).
    """
    x, cofactors = onp.empty((3, 3)), onp.empty((3, 3))
    for t in range(len(matrices)):
        squares = 0.0
        for i in range(3):
            for j in range(3):
                x[i, j] = matrices[t, i, j]
                squares += x[i, j] ** 2
        near[t] = squares < 6.0 and _fill_cofactors(x, cofactors) > 0.2
        if not near[t]:
            continue
        for _ in range(10):
            determinant = _fill_cofactors(x, cofactors)
            largest = 0.0
            for i in range(3):
                for j in range(3):
                    change = 0.5 * (cofactors[i, j] / determinant - x[i, j])
                    x[i, j] += change
                    largest = max(largest, abs(change))
            if largest < 1e-9:  # quadratic: the rest is rounding
                break
        for i in range(3):
            for j in range(3):
                found[t, i, j] = x[i, j]


@compiled
def _fill_cofactors(x: ndarray, cofactors: ndarray) -> float:
    """Fill the cofactors of a matrix; return its determinant."""
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            c, d = (j + 1) % 3, (j + 2) % 3
            cofactors[i, j] = x[a, c] * x[b, d] - x[a, d] * x[b, c]
    return x[0, 0] * cofactors[0, 0] + x[0, 1] * cofactors[0, 1] + x[0, 2] * cofactors[0, 2]


def _turned_back(answer: ndarray, matrices: ndarray, upstream: ndarray) -> ndarray:
    """Return the transposed derivative of `nearest_rotations`.

    With S = Rᵀ M, dR = R [a]×, where (tr(S) I − S) a is twice the axial vector of Rᵀ dM.
    """
    stretch = np.matmul(transpose(answer), matrices)
    trace = (stretch[..., 0, 0] + stretch[..., 1, 1] + stretch[..., 2, 2])[..., None, None]
    system = trace * np.eye(3) - 0.5 * (stretch + transpose(stretch))
    x, y, z = system[..., 0], system[..., 1], system[..., 2]
    determinant = dot(x, np.cross(y, z))
    unique = values_of(determinant) > 1e-30 * values_of(trace)[..., 0, 0] ** 3
    right = 2.0 * axial(np.matmul(transpose(answer), upstream))
    turned = np.stack([dot(right, np.cross(a, b)) for a, b in ((y, z), (z, x), (x, y))], axis=-1)
    scale = np.where(unique, 1.0, 0.0) / np.where(unique, determinant, 1.0)
    turned = scale[..., None] * turned
    return np.matmul(answer, cross_product_matrix(turned))


defvjp(
    nearest_rotations,
    lambda answer, matrices: lambda upstream: _turned_back(answer, matrices, upstream),
)
