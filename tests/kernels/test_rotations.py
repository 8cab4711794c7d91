"""Rotations, against those of SciPy: vectors, quaternions, logarithms and projections."""

import autograd
import autograd.numpy as anp
import mpmath
import numpy as np
import pytest
from oracles import taylor_slope
from scipy.spatial.transform import Rotation

from riemhuman.kernels import rotations as so3
from riemhuman.kernels.rotations import (
    cross_product_matrix,
    rotation_derivative,
    rotation_matrix,
)

# Across zero, the switch to the power series (at about 0.0316), π and several turns.
ANGLES = [0.0, 1e-12, 1e-8, 1e-4, 0.0316, 0.0317, 1.0, 3.0, np.pi - 1e-9, np.pi, 3.2, 6.28, 40.0]


def axes(n, rng=0):
    vectors = np.random.default_rng(rng).normal(size=(n, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


@pytest.mark.parametrize("angle", ANGLES)
def test_agrees_with_scipy(angle):
    vectors = angle * np.concatenate([axes(20), np.eye(3), -np.eye(3)])
    expected = Rotation.from_rotvec(vectors).as_matrix()
    np.testing.assert_allclose(rotation_matrix(vectors), expected, rtol=0, atol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.03, 0.032, 2.0, np.pi, 7.0])
def test_gradient(angle):
    rng = np.random.default_rng(2)
    coefficients, direction = rng.normal(size=(4, 3, 3)), rng.normal(size=(4, 3))

    def function(vectors):
        return anp.sum(coefficients * rotation_matrix(vectors))

    vectors = angle * axes(4)
    gradient = autograd.grad(function)(vectors)
    assert np.isfinite(gradient).all()
    assert taylor_slope(function, vectors, direction, gradient) > 1.9


def test_second_derivative_at_zero_is_finite():
    hessian = autograd.hessian(lambda vector: anp.trace(rotation_matrix(vector)))(np.zeros(3))
    # The trace is 1 + 2 cos θ = 3 − θ² + …
    np.testing.assert_allclose(hessian, -2 * np.eye(3), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.0316, 0.0317, 1.0, 3.0, np.pi, 5.0])
def test_turns_for_changes_of_the_vector(angle):
    """R(ω + dω) R(ω)⁻¹ = I + [J dω]×, by autograd."""
    vector = angle * axes(1, rng=7)[0]
    changes = autograd.jacobian(rotation_matrix)(vector)
    turns = np.einsum("xyc,zy->xzc", changes, rotation_matrix(vector))
    found = rotation_derivative(vector)
    np.testing.assert_allclose(turns[2, 1], found[0], atol=1e-9)
    np.testing.assert_allclose(turns[0, 2], found[1], atol=1e-9)
    np.testing.assert_allclose(turns[1, 0], found[2], atol=1e-9)
    np.testing.assert_allclose(turns, -turns.transpose(1, 0, 2), atol=1e-9)


@pytest.mark.parametrize("angle", [1e-3, 0.0316, 0.0317, 1.0])
def test_turns_to_the_last_digits(angle):
    with mpmath.workdps(40):
        exact = mpmath.mpf(angle)
        quotients = ((1 - mpmath.cos(exact)) / exact**2, (exact - mpmath.sin(exact)) / exact**3)
    vector = np.array([0.0, 0.0, angle])
    first, second = (float(quotient) for quotient in quotients)
    upper = np.array(
        [[1 - second * angle**2, -first * angle], [first * angle, 1 - second * angle**2]]
    )
    found = rotation_derivative(vector)
    np.testing.assert_allclose(found[:2, :2], upper, rtol=0, atol=2e-16)
    np.testing.assert_array_equal(found[2], [0.0, 0.0, 1.0])


def turns(angle, n=50):
    axes = np.random.default_rng(1).standard_normal((n, 3))
    axes = np.concatenate([axes, np.eye(3), -np.eye(3)])
    return angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)


def random_rotations(n=40, seed=0):
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix()


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, 3.1, np.pi - 1e-9, np.pi])
def test_filled_quaternions(angle):
    axes = np.random.default_rng(41).normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    r = rotation_matrix(angle * np.concatenate([axes, np.eye(3), -np.eye(3)]))
    found = np.empty((len(r), 4))
    so3.fill_quaternions(r, found)
    expected = so3.quaternions(r)
    same_sign = np.sign(np.sum(found * expected, axis=-1, keepdims=True))
    np.testing.assert_allclose(found, same_sign * expected, rtol=0, atol=4e-16)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.3, 2.0, 3.1, np.pi - 1e-9, np.pi])
def test_quaternions(angle):
    vectors = turns(angle)
    found = so3.quaternions(Rotation.from_rotvec(vectors).as_matrix())
    expected = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
    expected *= np.sign(np.sum(found * expected, axis=1, keepdims=True))
    np.testing.assert_allclose(found, expected, atol=1e-15)


def test_signs_of_quaternions_do_not_jump():
    angles = np.linspace(0.0, 3.0 * np.pi, 40)
    about_x = Rotation.from_rotvec(angles[:, np.newaxis] * [1.0, 0.0, 0.0]).as_quat()
    about_y = Rotation.from_rotvec(angles[:, np.newaxis] * [0.0, 1.0, 0.0]).as_quat()
    quaternions = np.stack([about_x, about_y], axis=1)
    quaternions[7, 0] *= -1.0
    continuous = so3.with_continuous_signs(quaternions)
    assert np.abs(np.diff(quaternions, axis=0)).max() > 1.0
    assert np.abs(np.diff(continuous, axis=0)).max() < 0.2
    np.testing.assert_array_equal(np.abs(continuous), np.abs(quaternions))


@pytest.mark.parametrize("angle", [1e-12, 1e-6, 0.3, 2.0, 3.1])
def test_logarithm_and_exponential(angle):
    start, vectors = random_rotations(56), turns(angle)
    end = so3.exp(vectors, start)
    expected = Rotation.from_matrix(start) * Rotation.from_rotvec(vectors)
    np.testing.assert_allclose(end, expected.as_matrix(), atol=1e-15)
    np.testing.assert_allclose(so3.log(start, end), vectors, atol=2e-15)


def test_the_logarithm_of_no_turn_has_a_derivative():
    for rotation in random_rotations(3):
        slopes = autograd.jacobian(lambda end, start=rotation: so3.log(start, end))(rotation)
        turned = rotation @ cross_product_matrix(np.eye(3))
        np.testing.assert_allclose(
            np.tensordot(turned, slopes, [[1, 2], [1, 2]]), np.eye(3), atol=1e-14
        )


def test_logarithm_of_half_turns_has_length_pi():
    start, vectors = random_rotations(56), turns(np.pi)
    found = so3.log(start, so3.exp(vectors, start))
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), np.pi, rtol=1e-15)
    np.testing.assert_array_equal(so3.log(start, start), 0.0)


def test_nearest_rotations_of_stretches_and_mirror_images():
    rotations = random_rotations()
    roots = np.random.default_rng(3).uniform(-1, 1, (40, 3, 3))
    stretches = roots @ so3.transpose(roots) + 0.1 * np.eye(3)
    found = so3.nearest_rotations(rotations @ stretches)
    np.testing.assert_allclose(found, rotations, atol=1e-13)
    # SciPy finds the rotation that fits vectors best: here the rows of the matrices.
    for matrix in np.random.default_rng(4).standard_normal((20, 3, 3)):
        expected = Rotation.align_vectors(matrix.T, np.eye(3))[0].as_matrix()
        kept = matrix.copy()
        np.testing.assert_allclose(so3.nearest_rotations(matrix), expected, atol=1e-12)
        np.testing.assert_array_equal(matrix, kept)


@pytest.mark.parametrize("seed", range(3))
def test_derivative_of_nearest_rotations(seed):
    rng = np.random.default_rng(seed)
    matrices, step, weights = rng.standard_normal((3, 2, 2, 3, 3))

    def value(x):
        return anp.sum(weights * so3.nearest_rotations(x))

    gradient = autograd.grad(value)(matrices)
    assert taylor_slope(value, matrices, step, gradient) == pytest.approx(2, abs=0.1)

    def slope_along_step(x):
        return anp.sum(autograd.grad(value)(x) * step)

    twice = autograd.grad(slope_along_step)(matrices)
    slope = taylor_slope(slope_along_step, matrices, weights, twice, rounding=1e-11)
    assert slope == pytest.approx(2, abs=0.1)


def test_derivative_where_several_rotations_are_nearest():
    matrices = np.stack([np.zeros((3, 3)), np.diag([1.0, 0.0, 0.0]), np.diag([1.0, 1.0, -1.0])])
    found = so3.nearest_rotations(matrices)
    np.testing.assert_allclose(np.linalg.det(found), 1.0)
    slope = autograd.grad(lambda x: anp.sum(so3.nearest_rotations(x)))(matrices)
    np.testing.assert_array_equal(slope, 0.0)


def test_shortest_rotations_lead_from_one_vector_to_another():
    """By the angle between them; by about half a turn between opposite ones."""
    start, end = axes(20), axes(20, rng=1)
    end[0] = -start[0]
    found = so3.shortest_rotations(start, end)
    ends = (found @ start[:, :, None])[:, :, 0]
    np.testing.assert_allclose(ends[1:], end[1:], atol=1e-12)
    np.testing.assert_allclose(ends[0], end[0], atol=0.05)
    np.testing.assert_allclose(np.linalg.det(found), 1.0, rtol=1e-12)
    traces = np.trace(found, axis1=1, axis2=2)
    cosines = np.sum(start * end, axis=1)
    np.testing.assert_allclose(traces[1:], 1.0 + 2.0 * cosines[1:], atol=1e-12)
