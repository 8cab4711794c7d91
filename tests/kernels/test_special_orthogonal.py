"""Rotations, against SciPy's."""

import autograd
import autograd.numpy as anp
import numpy as np
import pytest
from oracles import taylor_slope
from scipy.spatial.transform import Rotation

from riemhuman.kernels import rotations as so3
from riemhuman.kernels.rotations import cross_product_matrix

ANGLES = [0.0, 1e-12, 1e-6, 0.3, 2.0, 3.1, np.pi - 1e-9, np.pi]


def turns(angle, n=50):
    axes = np.random.default_rng(1).standard_normal((n, 3))
    axes = np.concatenate([axes, np.eye(3), -np.eye(3)])
    return angle * axes / np.linalg.norm(axes, axis=1, keepdims=True)


def random_rotations(n=40, seed=0):
    return Rotation.random(n, rng=np.random.default_rng(seed)).as_matrix()


@pytest.mark.parametrize("angle", ANGLES)
def test_quaternions(angle):
    vectors = turns(angle)
    found = so3.quaternions(Rotation.from_rotvec(vectors).as_matrix())
    expected = Rotation.from_rotvec(vectors).as_quat(scalar_first=True)
    expected *= np.sign(np.sum(found * expected, axis=1, keepdims=True))
    np.testing.assert_allclose(found, expected, atol=1e-15)


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


def test_half_turns_are_those_whose_axis_is_rounding_error():
    start, gap = random_rotations(56), 1e-14
    for angle, expected in ((np.pi, True), (np.pi - gap, False)):
        vectors = turns(angle)
        found = so3.log(start, so3.exp(vectors, start))
        lengths = np.linalg.norm(found, axis=1)
        np.testing.assert_array_equal(lengths >= so3.HALF_TURN, expected)


def test_parallel_transport():
    """A field is parallel where its derivative is normal to the rotations, as matrices of R⁹."""
    rng = np.random.default_rng(2)
    start = random_rotations(10)
    omega, vector = rng.standard_normal((2, 10, 3))

    def transported(t):
        moved = so3.parallel_transport(vector, t * omega)
        return so3.exp(t * omega, start) @ cross_product_matrix(moved)

    step, middle = 1e-5, so3.exp(0.7 * omega, start)
    slope = (transported(0.7 + step) - transported(0.7 - step)) / (2 * step)
    np.testing.assert_allclose(so3.axial(so3.transpose(middle) @ slope), 0.0, atol=1e-9)
    lengths = np.linalg.norm(so3.parallel_transport(vector, omega), axis=1)
    np.testing.assert_allclose(lengths, np.linalg.norm(vector, axis=1), rtol=1e-14)
    np.testing.assert_array_equal(so3.parallel_transport(vector, 0 * omega), vector)


VECTORS = np.random.default_rng(7).standard_normal((2, 2, 3, 3))
ROTATIONS = random_rotations(12, seed=8).reshape(2, 2, 3, 3, 3)
MATRICES = np.random.default_rng(9).standard_normal((2, 3, 3, 3))


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
