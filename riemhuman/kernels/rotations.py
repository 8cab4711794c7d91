r"""The rotations SO(3), point by point: exponential, logarithm, transport, projection.

With the metric :math:`\langle RA, RB\rangle = \tfrac12 \mathrm{tr}(A^T B)` of skew A and B, the
distance of two rotations is the angle of the rotation between them. A rotation is ± a unit
quaternion, and the angle is twice that between the quaternions, up to sign.
"""

from __future__ import annotations

import math

import autograd.numpy as np
import numpy as onp
from autograd.extend import defvjp, primitive

from riemhuman.arrays import Array, ArrayLike, Booleans, TangentVectors
from riemhuman.checks import real_array, values_of
from riemhuman.kernels.compilation import compiled
from riemhuman.kernels.surface import dot, square_root

# Below this squared angle the power series is exact to double precision and, unlike the
# quotients, has derivatives of every order at zero.
_SERIES_BELOW = 1e-3

# Cubes of angles stay within double precision; larger ones have lost their direction.
_LARGEST_ANGLE = 1e9

# Below this share of its trace cubed, the determinant of tr(S) I − S is zero but for rounding: the
# nearest rotation is not unique.
_LEAST_DETERMINANT = 1e-30


def rotation_matrix(axis_angle: ArrayLike) -> Array:
    """Return the rotation matrices of axis-angle vectors, shape (..., 3, 3).

    Rodrigues' formula: R = I + (sin θ / θ) K + ((1 − cos θ) / θ²) K², with θ = ‖ω‖ and K the
    cross-product matrix of ω. Differentiable with autograd everywhere, θ = 0 included.

    Parameters
    ----------
    axis_angle : array_like, shape (..., 3)
        Rotation vectors ω in radians: direction is the axis, length the angle.

    Examples
    --------
    >>> rh.bodies.rotation_matrix(np.array([0.0, 0.0, np.pi / 2])).round(6).astype(int).tolist()
    [[0, -1, 0], [1, 0, 0], [0, 0, 1]]
    """
    cross, small, x, angle, cosine_quotient = _parts(axis_angle)
    sine_quotient = np.where(
        small, 1.0 - x / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0)), np.sin(angle) / angle
    )
    return np.eye(3) + sine_quotient * cross + cosine_quotient * np.matmul(cross, cross)


def rotation_derivative(axis_angle: ArrayLike) -> Array:
    """Return the left Jacobians J of the rotation group, shape (..., 3, 3).

    With R(ω) the rotation, R(ω + dω) = R(J dω) R(ω) to first order, where
    J = I + ((1 − cos θ) / θ²) K + ((θ − sin θ) / θ³) K².
    """
    cross, small, x, angle, cosine_quotient = _parts(axis_angle)
    third_quotient = np.where(
        small,
        1.0 / 6.0 * (1.0 - x / 20.0 * (1.0 - x / 42.0 * (1.0 - x / 72.0))),
        (angle - np.sin(angle)) / angle**3,
    )
    return np.eye(3) + cosine_quotient * cross + third_quotient * np.matmul(cross, cross)


def _parts(axis_angle: ArrayLike) -> tuple[Array, Booleans, Array, Array, Array]:
    """Return K, whether θ is small, θ² where it is, θ where it is not, and (1 − cos θ)/θ²."""
    vector = real_array(axis_angle, "axis_angle", (3,), maximum=_LARGEST_ANGLE)
    squared_angle = np.sum(vector * vector, axis=-1)[..., None, None]
    small = squared_angle < _SERIES_BELOW
    x = np.where(small, squared_angle, 0.0)
    angle = np.sqrt(np.where(small, 1.0, squared_angle))
    cosine_quotient = np.where(
        small,
        0.5 * (1.0 - x / 12.0 * (1.0 - x / 30.0 * (1.0 - x / 56.0))),
        2.0 * (np.sin(0.5 * angle) / angle) ** 2,  # ½ (sin(θ/2)/(θ/2))²: no cancellation
    )
    return cross_product_matrix(vector), small, x, angle, cosine_quotient


def cross_product_matrix(vector: Array) -> Array:
    """Return the matrices of the cross products with vectors, shape (..., 3, 3)."""
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    zero = np.zeros(np.shape(x))
    entries = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    return np.reshape(entries, (*np.shape(x), 3, 3))


def transpose(matrices: Array) -> Array:
    """Return the transposed matrices, shape (..., 3, 3)."""
    return np.swapaxes(matrices, -1, -2)


def axial(matrices: Array) -> Array:
    """Return the vectors of the skew parts, ½ (M − Mᵀ) = [v]×."""
    return 0.5 * np.stack(
        [
            matrices[..., 2, 1] - matrices[..., 1, 2],
            matrices[..., 0, 2] - matrices[..., 2, 0],
            matrices[..., 1, 0] - matrices[..., 0, 1],
        ],
        axis=-1,
    )


def quaternions(rotations: Array) -> Array:
    """Return unit quaternions of rotations, of either sign; the scalar part comes first.

    Of the columns of q qᵀ, all of them multiples of q, the longest is scaled to unit length, so
    that no digits are lost (after Shepperd, "Quaternion from rotation matrix", Journal of Guidance
    and Control 1(3), 1978).
    """
    diagonal = [rotations[..., i, i] for i in range(3)]
    vector = 2.0 * axial(rotations)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    xy = rotations[..., 0, 1] + rotations[..., 1, 0]
    xz = rotations[..., 0, 2] + rotations[..., 2, 0]
    yz = rotations[..., 1, 2] + rotations[..., 2, 1]
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
    # Column k where its square is the largest, 0 elsewhere; autograd cannot assign to entries.
    entries = [sum(np.where(largest == k, columns[k][i], 0.0) for k in range(4)) for i in range(4)]
    column = np.stack(entries, axis=-1)
    return column / np.sqrt(dot(column, column))[..., None]


def with_continuous_signs(quaternions: Array) -> Array:
    """Return the same rotations over time, shape (n_times, ..., 4), by quaternions without jumps.

    The sign of each is the one nearer to the quaternion before, so that values between two times
    are those of rotations between them.
    """
    products = onp.sum(quaternions[1:] * quaternions[:-1], axis=-1)
    signs = onp.cumprod(onp.where(products < 0.0, -1.0, 1.0), axis=0)
    return onp.concatenate([quaternions[:1], signs[..., onp.newaxis] * quaternions[1:]])


@compiled
def fill_quaternions(rotations: Array, quaternions: Array) -> None:
    """Fill `quaternions` of rotations, shape (n, 3, 3)."""
    # Each number is read by itself: views of single matrices take longer to make than to use.
    for t in range(len(rotations)):
        r00, r01, r02 = rotations[t, 0, 0], rotations[t, 0, 1], rotations[t, 0, 2]
        r10, r11, r12 = rotations[t, 1, 0], rotations[t, 1, 1], rotations[t, 1, 2]
        r20, r21, r22 = rotations[t, 2, 0], rotations[t, 2, 1], rotations[t, 2, 2]
        trace = r00 + r11 + r22
        x, y, z = r21 - r12, r02 - r20, r10 - r01
        xy, xz, yz = r01 + r10, r02 + r20, r12 + r21
        # The component whose column of 4 q qᵀ is taken has the largest square.
        largest = 1.0 + trace
        q0, q1, q2, q3 = largest, x, y, z
        square = 1.0 + 2.0 * r00 - trace
        if square > largest:
            largest = square
            q0, q1, q2, q3 = x, square, xy, xz
        square = 1.0 + 2.0 * r11 - trace
        if square > largest:
            largest = square
            q0, q1, q2, q3 = y, xy, square, yz
        square = 1.0 + 2.0 * r22 - trace
        if square > largest:
            q0, q1, q2, q3 = z, xz, yz, square
        length = math.sqrt(q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3)
        quaternions[t, 0], quaternions[t, 1] = q0 / length, q1 / length
        quaternions[t, 2], quaternions[t, 3] = q2 / length, q3 / length


def log(r1: Array, r2: Array) -> Array:
    """Return the vector ω, of length at most π, of the shortest rotation: r₂ = r₁ exp [ω]×."""
    q = quaternions(np.matmul(transpose(r1), r2))
    q = q * np.where(q[..., :1] < 0, -1.0, 1.0)
    vector = q[..., 1:]
    sine = square_root(dot(vector, vector))
    safe = np.where(sine > 0, sine, 1.0)
    scale = np.where(sine > 0, 2.0 * np.arctan2(safe, q[..., 0]) / safe, 2.0)
    return scale[..., None] * vector


def exp(omega: Array, r: Array) -> Array:
    """Return r exp [ω]×."""
    return np.matmul(r, rotation_matrix(omega))


def shortest_rotations(start: Array, end: Array) -> Array:
    """Return the shortest rotations between unit vectors, shape (..., 3, 3)."""
    start, end = onp.broadcast_arrays(start, end)
    a, b, c = onp.moveaxis(start, -1, 0)
    p, q, r = onp.moveaxis(end, -1, 0)
    # Between opposite vectors it is half a turn about any axis across them.
    x = b * r - c * q + 1e-14 * (0.8 * b - 0.48 * c)
    y = c * p - a * r + 1e-14 * (0.36 * c - 0.8 * a)
    z = a * q - b * p + 1e-14 * (0.48 * a - 0.36 * b)
    w = 1.0 + a * p + b * q + c * r
    length = onp.sqrt(x * x + y * y + z * z + w * w)
    x, y, z, w = x / length, y / length, z / length, w / length
    entries = [
        *(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        *(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        *(2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    ]
    rotations: Array = onp.stack(entries, axis=-1).reshape(*start.shape, 3)
    return rotations


def parallel_transport(vector: TangentVectors, omega: Array) -> Array:
    """Transport along t ↦ r exp(t [ω]×), for unit time, in the body's axes.

    The tangent vector r [v]× becomes r exp([ω]×) [w]×, with w = exp(−½ [ω]×) v.
    """
    return np.matmul(rotation_matrix(-0.5 * omega), vector[..., None])[..., 0]


@primitive
def nearest_rotations(matrices: Array) -> Array:
    """Return the rotations R nearest to matrices, which make tr(Rᵀ M) largest.

    Where several are as near, which is where the singular values σ₂ and σ₃ of M are equal and
    det M < 0, or σ₂ = σ₃ = 0, one of them is returned, and its derivative is 0.
    """
    matrices = onp.asarray(matrices, dtype=onp.float64)
    flat = onp.ascontiguousarray(matrices.reshape(-1, 3, 3))
    # A rotation has squares 3 and determinant 1; nearer to a singular matrix the limit loses digits
    # and may be another rotation. Where squares are small, so are determinants.
    squares = onp.einsum("tij,tij->t", flat, flat)
    nearest, near = flat.copy(), (squares > 1.0) & (squares < 6.0)
    if near.any():  # not of covariances in metres: compilation takes longer than a fit
        _by_newton(nearest, onp.empty((3, 3)), near)
    left, _, right = onp.linalg.svd(flat[~near])
    left[..., 2] *= onp.sign(onp.linalg.det(left) * onp.linalg.det(right))[..., None]
    nearest[~near] = left @ right
    return nearest.reshape(matrices.shape)


@compiled
def _by_newton(nearest: Array, cofactors: Array, near: Array) -> None:
    """Replace matrices that are near enough by their limits of X ← ½ (X + X⁻ᵀ)."""
    # Faster than singular values and as exact (Higham, "Computing the polar decomposition", 1986).
    for t in range(len(nearest)):
        for step in range(11):
            determinant = 0.0
            for i in range(3):
                a, b = (i + 1) % 3, (i + 2) % 3
                for j in range(3):
                    c, d = (j + 1) % 3, (j + 2) % 3
                    cofactors[i, j] = (
                        nearest[t, a, c] * nearest[t, b, d] - nearest[t, a, d] * nearest[t, b, c]
                    )
            for j in range(3):
                determinant += nearest[t, 0, j] * cofactors[0, j]
            near[t] = near[t] and (step > 0 or determinant > 0.2)
            if not near[t]:
                break
            largest = 0.0
            for i in range(3):
                for j in range(3):
                    change = 0.5 * (cofactors[i, j] / determinant - nearest[t, i, j])
                    nearest[t, i, j] += change
                    largest = max(largest, abs(change))
            if largest < 1e-9:  # the next change is its square: the rest is rounding
                break


def _turned_back(answer: Array, matrices: Array, upstream: Array) -> Array:
    """Return the transposed derivative of `nearest_rotations`."""
    # With S = Rᵀ M, dR = R [a]×, where (tr(S) I − S) a is twice the axial vector of Rᵀ dM.
    stretch = np.matmul(transpose(answer), matrices)
    trace = (stretch[..., 0, 0] + stretch[..., 1, 1] + stretch[..., 2, 2])[..., None, None]
    system = trace * np.eye(3) - 0.5 * (stretch + transpose(stretch))
    x, y, z = system[..., 0], system[..., 1], system[..., 2]
    determinant = dot(x, np.cross(y, z))
    unique = values_of(determinant) > _LEAST_DETERMINANT * values_of(trace)[..., 0, 0] ** 3
    right = 2.0 * axial(np.matmul(transpose(answer), upstream))
    # Cramer's rule.
    turned = np.stack(
        [dot(right, np.cross(y, z)), dot(right, np.cross(z, x)), dot(right, np.cross(x, y))],
        axis=-1,
    )
    scale = np.where(unique, 1.0, 0.0) / np.where(unique, determinant, 1.0)
    turned = scale[..., None] * turned
    return np.matmul(answer, cross_product_matrix(turned))


defvjp(
    nearest_rotations,
    lambda answer, matrices: lambda upstream: _turned_back(answer, matrices, upstream),
)
