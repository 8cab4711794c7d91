"""Angles between normals and between rotations: the pair function that all loops call."""

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad
from numba import njit

from riemhuman.terms import NormalTerm, RotationTerm, normals
from riemhuman.terms._polynomial_fits import NO, YES


@njit
def pair(a, b, either_sign, double):
    """Return the result for vectors of R⁴, given as tuples."""
    return normals.arc_pair(a, b, either_sign, double)


def pairs_at(angle, n_components):
    """Return pairs of unit vectors at an angle."""
    a = np.random.default_rng(5).standard_normal((20, n_components))
    across = np.random.default_rng(6).standard_normal((20, n_components))
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    across -= np.sum(a * across, axis=1, keepdims=True) * a
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return a, np.cos(angle) * a + np.sin(angle) * across


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 0.7, 1.5, 1.6, 2.9, np.pi - 1e-4])
@pytest.mark.parametrize(
    ("term", "n_components", "factor"), [(NormalTerm(), 3, 1.0), (RotationTerm(), 4, 4.0)]
)
def test_the_pair_function_is_the_definition(term, n_components, factor, angle):
    """Values, and slopes along the sphere, which alone have an effect."""
    either_sign = YES if n_components == 4 else NO
    first, second = pairs_at(angle, n_components)

    def definition(a, b):
        return anp.sum(term.squared_dist((a,), (b,)))

    by_first, by_second = (grad(definition, k)(first, second) for k in (0, 1))
    for k, (a, b) in enumerate(zip(first, second, strict=True)):
        rest = np.zeros(4 - n_components)
        value, *slopes = pair((*a, *rest), (*b, *rest), either_sign, YES)
        expected = definition(a[None], b[None])
        assert factor * value == pytest.approx(expected, rel=1e-13, abs=1e-300)
        for n, slope, other in ((a, slopes[0], by_first[k]), (b, slopes[1], by_second[k])):
            change = factor * np.array(slope)[:n_components] - other
            np.testing.assert_allclose(change - (change @ n) * n, 0.0, atol=1e-10)


def test_slopes_of_squared_angles_where_vectors_coincide_or_are_opposite():
    """Of p and q, the squared lengths of difference and sum; none in q if that is 0."""
    coincident = [grad(normals.squared_arc, k)(0.0, 4.0) for k in (0, 1)]
    opposite = [grad(normals.squared_arc, k)(4.0, 0.0) for k in (0, 1)]
    assert coincident == [1.0, 0.0]
    assert opposite == [0.0, 0.0]
