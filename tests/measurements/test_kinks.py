"""Least squares of functions with kinks."""

import numpy as np

from riemhuman.measurements._kinks import _weights_of_least_gain, least_squares_with_kinks


def test_weights_of_gradients_are_the_best():
    """Also of gradients that depend on each other, and of two that are the same."""
    rng = np.random.default_rng(0)
    for size, rank in [(2, 32), (20, 32), (20, 3), (12, 1), (15, 6)]:
        gradients = rng.standard_normal((rank, size)) + 2.0 * rng.standard_normal((rank, 1))
        gradients[:, 1] = gradients[:, 0]
        products, errors = gradients.T @ gradients, rng.exponential(size=size)
        weights = _weights_of_least_gain(products, errors)
        assert weights.min() >= 0.0
        assert abs(weights.sum() - 1.0) < 1e-12
        # By the conditions of Karush, Kuhn and Tucker, the slope is least where a weight is used.
        slopes = products @ weights + errors
        assert (slopes - slopes.min()) @ weights < 1e-9 * np.abs(products).max()


def test_steps_that_raise_the_sum_are_not_taken():
    """Of z / √(1 + z²), steps of Gauss and Newton lead from z to -z³."""

    def linearisation(z):
        root = np.sqrt(1.0 + z @ z)
        return z / root, np.array([[root**-3]])

    _, cost, converged = least_squares_with_kinks(linearisation, np.array([2.0]), 60)
    assert converged
    assert cost < 1e-4


def test_kinks_are_followed():
    """The least of (3 |x| + x/5 + y - 1)² + (y - 2)²/4 is at (0, 1.2), on the kink."""

    def linearisation(z):
        x, y = z
        values = np.array([3.0 * abs(x) + y + 0.2 * x - 1.0, 0.5 * (y - 2.0)])
        return values, np.array([[3.0 * (1.0 if x > 0 else -1.0) + 0.2, 1.0], [0.0, 0.5]])

    for start in ([0.3, 0.1], [-2.0, 4.0], [1e-7, 1.5]):
        z, cost, converged = least_squares_with_kinks(linearisation, np.array(start), 60)
        assert converged
        assert abs(z[0]) < 1e-3
        assert abs(z[1] - 1.2) < 0.03
        assert abs(cost - 0.1) < 1e-3
