"""Distances of Theorem 1 (corrected) on single matrices, against exact arithmetic."""

import numpy as np
import oracles
import pytest
from autograd import grad
from ebin_matrices import FAMILIES, LAMBDAS, cone_size, matrices, pairs, squared_dist

from riemhuman.kernels import surface
from riemhuman.terms import _cone_geodesics, cone


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES)
def test_squared_dist_is_exact(family, lam):
    g1, g2 = pairs(family, lam)
    squares = [oracles.exact_squared_dist(a, b, lam) for a, b in zip(g1, g2, strict=True)]
    exact = np.array([float(oracles.mp.sqrt(square)) for square in squares])
    found = np.sqrt(squared_dist(g1, g2, lam))
    np.testing.assert_array_less(np.abs(found - exact), 1e-10 * cone_size(g1, g2, lam))


@pytest.mark.parametrize("lam", LAMBDAS)
def test_near_identical_to_relative_precision(lam):
    g1, g2 = pairs("near-identical")
    exact = [float(oracles.exact_squared_dist(a, b, lam)) for a, b in zip(g1, g2, strict=True)]
    # The difference of matrices 1e-8 apart holds eight digits.
    np.testing.assert_allclose(squared_dist(g1, g2, lam), exact, rtol=1e-6)


# Coordinates of surfaces.


def coordinates_of(f_u, f_v):
    return cone.EbinTerm().fields(surface.follow_up(f_u, f_v))


def derivatives_of(g):
    """Return vectors f_u, f_v of R³ with these inner products, turned out of any plane."""
    factor = np.linalg.cholesky(g)
    flat = np.concatenate([factor, np.zeros((len(g), 2, 1))], axis=-1)
    turned = flat @ np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
    return turned[:, 0], turned[:, 1]


@pytest.mark.parametrize("family", ["ordinary", "of all sizes"])
def test_coordinates_of_derivatives_are_those_of_the_first_fundamental_form(family):
    g = pairs(family)[0]
    found = coordinates_of(*derivatives_of(g))
    np.testing.assert_allclose(found, _cone_geodesics.coordinates(g), rtol=1e-13)


def test_coordinates_of_slivers_keep_the_digits_that_matrices_lose():
    height = 10.0 ** -np.arange(1, 8)
    f_u = np.stack([0.6 + 0 * height, 0 * height, 0.8 + 0 * height], axis=1)
    f_v = 0.7 * f_u
    f_v[:, 1] = height
    exact = np.array([np.full(7, 0.7), height, np.sqrt(height)])
    found = coordinates_of(f_u, f_v)
    np.testing.assert_allclose(found, exact, rtol=1e-15)
    of_matrices = _cone_geodesics.coordinates(surface.first_fundamental_form(f_u, f_v))
    assert np.abs(of_matrices[2] / exact[2] - 1).max() > 1e-6


@pytest.mark.parametrize("size", [1e-30, 1.0, 1e30])
def test_coordinates_of_triangles_without_area_are_the_apex(size):
    lines = np.array([[1.0, 2.0, 3.0], [0.1, 0.3, 0.7], [0.0, 0.0, 0.0]])
    for f_u in lines:
        for f_v in (f_u, -3.0 * f_u, 0.0 * f_u):
            assert coordinates_of(size * f_u, size * f_v) == (0.0, 1.0, 0.0)
    tilted = lines[0] + [3e-7, 0.0, 0.0]
    assert coordinates_of(size * lines[0], size * tilted)[2] > 0
    # An angle decides, and no length.
    short, across = np.array([0.0, 0.0, size]), np.array([1e-10 * size, 0.0, 0.0])
    for sides in ((short, across), (across, short)):
        found = coordinates_of(*sides)
        np.testing.assert_allclose(found[2], 1e-5 * size, rtol=1e-15)


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1e8, 1e8), (1e-8, 1e-8), (1e6, 1e-3)])
def test_matrices_that_have_lost_their_shape(sizes):
    """1 − cos² of the angle is ε times 1e5 where det g has five digits left."""
    e, g = sizes
    for share, lost in ((3e4, True), (3e5, False)):
        m = np.sqrt(e * g * (1.0 - share * np.finfo(float).eps))
        assert _cone_geodesics.has_lost_its_shape(np.array([[e, m], [m, g]])) == lost
    assert _cone_geodesics.has_lost_its_shape(np.zeros((2, 2)))


# Relations.


@pytest.mark.parametrize("lam", LAMBDAS)
def test_frames_do_not_matter(lam):
    """d²(AᵀgA) = |det A| d²(g): what makes the integral independent of the template."""
    rng = np.random.default_rng(3)
    g1, g2 = matrices(50, 3.0, rng), matrices(50, 2.0, rng)
    frames = np.eye(2) + rng.uniform(-0.6, 0.6, (50, 2, 2))
    areas = np.abs(np.linalg.det(frames))
    assert areas.min() > 0.05
    turned = (np.swapaxes(frames, 1, 2) @ g @ frames for g in (g1, g2))
    np.testing.assert_allclose(
        squared_dist(*turned, lam), areas * squared_dist(g1, g2, lam), rtol=1e-9
    )


# Derivatives of the custom primitives.


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES)
def test_gradients_of_squared_dist(family, lam):
    g1, g2 = (g[0] for g in pairs(family, lam))
    factor = np.linalg.cholesky(g1)
    direction = factor @ np.array([[0.3, 0.5], [0.5, -0.8]]) @ factor.T
    gradient = grad(squared_dist)(g1, g2, lam)
    # Exact arithmetic, because g₁ + εh itself is rounded too much where g₁ is nearly degenerate.
    g1_exact, direction_exact = (oracles.mp.matrix(m.tolist()) for m in (g1, direction))
    expected = oracles.mp.diff(
        lambda t: oracles.exact_squared_dist(g1_exact + t * direction_exact, g2, lam), 0
    )
    scale = 1e-9 * np.sqrt(np.linalg.det(g1)) * lam + 1e-8 * abs(float(expected))
    np.testing.assert_allclose(np.sum(gradient * direction), float(expected), atol=scale)
    np.testing.assert_array_equal(gradient, grad(squared_dist, 1)(g2, g1, lam))
    np.testing.assert_array_equal(grad(squared_dist)(g1, g1, lam), 0.0)
    if family in ("ordinary", "within π"):
        value = lambda g: squared_dist(g, g2, lam)  # noqa: E731
        assert oracles.taylor_slope(value, g1, direction, gradient) >= 1.9
