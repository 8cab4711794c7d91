"""Rotation matrices against SciPy's, and their smoothness at the zero angle."""

import autograd
import autograd.numpy as anp
import mpmath
import numpy as np
import pytest
from oracles import taylor_slope
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.kernels.rotations import rotation_derivative, rotation_matrix

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


@pytest.mark.parametrize("angle", [1e-12, 1e-8, 1e-5])
def test_small_turns_keep_their_digits(angle):
    x, y, z = vector = angle * axes(1)[0]
    found = rotation_matrix(vector)
    skew = 0.5 * (found - found.T)
    np.testing.assert_allclose(skew, [[0, -z, y], [z, 0, -x], [-y, x, 0]], rtol=1e-9, atol=0)


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


def test_gradient_at_zero_is_the_cross_product_matrix():
    jacobian = autograd.jacobian(rotation_matrix)(np.zeros(3))
    for axis in range(3):
        expected = np.cross(np.eye(3)[axis], np.eye(3)).T
        np.testing.assert_allclose(jacobian[..., axis], expected, atol=1e-15)


def test_second_derivative_at_zero_is_finite():
    hessian = autograd.hessian(lambda vector: anp.trace(rotation_matrix(vector)))(np.zeros(3))
    # The trace is 1 + 2 cos θ = 3 − θ² + …
    np.testing.assert_allclose(hessian, -2 * np.eye(3), atol=1e-14)


def test_refusals():
    with pytest.raises(ArgumentError, match=r"axis_angle must have shape \(\.\.\., 3\)"):
        rotation_matrix(np.zeros((3, 4)))
    with pytest.raises(ArgumentError, match="axis_angle holds 1 NaN"):
        rotation_matrix([0.0, np.nan, 0.0])
    with pytest.raises(ArgumentTypeError, match="axis_angle must be an array of real numbers"):
        rotation_matrix(["x", "y", "z"])


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
