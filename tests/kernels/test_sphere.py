"""The sphere, against exact arithmetic, rotations and numerically integrated equations."""

import autograd.numpy as anp
import numpy as np
import oracles
import pytest
from autograd import grad, jacobian
from scipy.spatial.transform import Rotation

from riemhuman.kernels import sphere
from riemhuman.terms.normals import NormalTerm

N_PAIRS = 40


pytestmark = pytest.mark.usefixtures("strict_floats")


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def pairs(angle, rng=0):
    """Return unit vectors at about this angle, and the axes of the rotations between them."""
    rng = np.random.default_rng(rng)
    n1 = unit(rng.normal(size=(N_PAIRS, 3)))
    across = unit(np.cross(n1, rng.normal(size=(N_PAIRS, 3))))
    return n1, unit(np.cos(angle) * n1 + np.sin(angle) * across)


ANGLES = (1e-12, 1e-8, 1e-4, 0.3, 1.5, 2.8, np.pi - 1e-4, np.pi - 1e-8)


def squared_dist(n1, n2):
    return NormalTerm().squared_dist((n1,), (n2,))


def check_squared_dist(function, rtol):
    for angle in ANGLES:
        n1, n2 = pairs(angle)
        exact = np.array([float(oracles.exact_arc(a, b)) for a, b in zip(n1, n2, strict=True)])
        np.testing.assert_allclose(np.sqrt(function(n1, n2)), exact, rtol=rtol, atol=2e-16)


def test_antipodal_are_vectors_whose_direction_is_rounding_error():
    n, across = pairs(np.pi / 2)
    for gap, expected in ((0.0, True), (1e-14, False)):
        end = unit(np.cos(np.pi - gap) * n + np.sin(gap) * across)
        np.testing.assert_array_equal(sphere.angle(n, end) >= sphere.ANTIPODAL, expected)


def test_squared_dist_is_exact():
    check_squared_dist(squared_dist, 1e-10)
    check_squared_dist(lambda a, b: sphere.angle(a, b) ** 2, 1e-10)


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_and_log(angle):
    n1, n2 = pairs(angle)
    velocity = sphere.log(n1, n2)
    np.testing.assert_allclose(np.sum(n1 * velocity, axis=-1), 0.0, atol=1e-14)
    length = np.linalg.norm(velocity, axis=-1)
    np.testing.assert_allclose(length, sphere.angle(n1, n2), rtol=1e-13, atol=2e-16)
    np.testing.assert_allclose(sphere.exp(velocity, n1), n2, atol=1e-14)
    rotation = Rotation.from_rotvec(np.cross(n1, velocity))
    np.testing.assert_allclose(rotation.apply(n1), n2, atol=1e-14)


@pytest.mark.parametrize("gap", [1e-15, 1e-13, 1e-10])
def test_log_near_antipodal_vectors_is_tangent(gap):
    n1, n2 = pairs(np.pi - gap)
    velocity = sphere.log(n1, n2)
    np.testing.assert_allclose(np.sum(n1 * velocity, axis=-1), 0.0, atol=1e-14)
    np.testing.assert_allclose(sphere.exp(velocity, n1), n2, atol=1e-14)


def test_the_logarithm_of_coincident_vectors_has_a_derivative():
    """The projection onto the tangent plane."""
    n = unit(np.random.default_rng(6).normal(size=3))
    slopes = jacobian(lambda end: sphere.log(n, end))(n)
    np.testing.assert_allclose(slopes, np.eye(3) - np.outer(n, n), atol=1e-15)


def test_coincident_and_antipodal_values():
    n = unit(np.random.default_rng(1).normal(size=(N_PAIRS, 3)))
    np.testing.assert_array_equal(squared_dist(n, n), 0.0)
    np.testing.assert_array_equal(sphere.log(n, n), 0.0)
    np.testing.assert_array_equal(sphere.exp(0 * n, n), n)
    np.testing.assert_array_equal(squared_dist(n, -n), np.pi**2)
    np.testing.assert_array_equal(sphere.angle(n, -n), np.pi)
    assert np.all(np.isfinite(sphere.log(n, -n)))
    for argument in (0, 1):
        for function in (squared_dist, sphere.angle):
            slope = grad(lambda a, b: anp.sum(function(a, b)), argument)  # noqa: B023
            np.testing.assert_array_equal(slope(n, n), 0.0)
            assert np.all(np.isfinite(slope(n, -n)))
        for function in (sphere.log, lambda a, b: sphere.exp(a - b, b)):
            slope = grad(lambda a, b: anp.sum(function(a, b)), argument)  # noqa: B023
            assert np.all(np.isfinite(slope(n, n.copy())))


@pytest.mark.parametrize("angle", [1e-8, 0.3, 1.5, 2.8])
def test_gradients(angle):
    n1, n2 = pairs(angle)
    direction = np.random.default_rng(3).normal(size=n1.shape)
    for function in (squared_dist, sphere.angle):
        value = lambda x: anp.sum(function(x / anp.sqrt(anp.sum(x**2, -1))[:, None], n2))  # noqa: E731, B023
        if function is sphere.angle and angle < 1e-6:
            continue
        assert oracles.taylor_slope(value, n1, direction, grad(value)(n1)) >= 1.9
    # grad θ² = −2 log, its tangent part.
    slope = sphere.to_tangent(grad(lambda x: anp.sum(squared_dist(x, n2)))(n1), n1)
    np.testing.assert_allclose(slope, -2 * sphere.log(n1, n2), rtol=1e-6, atol=1e-13)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 0.3, 2.8, np.pi - 1e-8])
def test_parallel_transport_is_the_rotation_along_the_great_circle(angle):
    n, across = pairs(np.pi / 2)
    velocity = angle * sphere.to_tangent(across, n)
    vectors = sphere.to_tangent(np.random.default_rng(5).normal(size=n.shape), n)
    found = sphere.parallel_transport(vectors, n, velocity)
    rotation = Rotation.from_rotvec(np.cross(n, velocity))
    np.testing.assert_allclose(found, rotation.apply(vectors), atol=1e-14)
    # The velocity itself goes to that at the end.
    there = sphere.exp(velocity, n)
    carried = sphere.parallel_transport(velocity, n, velocity)
    np.testing.assert_allclose(sphere.exp(-carried, there), n, atol=1e-14)


def test_unit_vectors_stay_so_over_many_steps():
    """Rounding errors along the vectors do not grow, as in a hundred steps of a median."""
    rng = np.random.default_rng(4)
    points = rng.standard_normal((9, 50, 3))
    points /= np.linalg.norm(points, axis=-1, keepdims=True)
    current = points[-1]
    for _ in range(100):
        current = sphere.exp(sphere.log(current, points[:-1]).mean(axis=0), current)
    np.testing.assert_allclose(np.linalg.norm(current, axis=-1), 1.0, rtol=1e-14)
