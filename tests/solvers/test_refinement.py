"""Refinement in time."""

import numpy as np

from riemhuman.solvers.refinement import interpolate_in_time


def test_keeps_parabolas():
    t = np.linspace(0, 1, 11)[1:-1, None]
    parabola = t * (1 - t) * np.array([[1.0, -2.0]])
    np.testing.assert_allclose(interpolate_in_time(parabola[[4]], 10), parabola, atol=1e-14)
    np.testing.assert_allclose(interpolate_in_time(parabola, 5), parabola[1::2], atol=1e-14)


def test_of_nothing_is_nothing():
    np.testing.assert_array_equal(interpolate_in_time(np.zeros((1, 2)), 10), np.zeros((9, 2)))
