"""Cones in closed form: functions, distances, geodesics, against exact arithmetic and others."""

import autograd.numpy as anp
import numpy as np
import oracles
import pytest
from autograd import grad
from oracles import mp

from riemhuman.kernels import surface
from riemhuman.kernels.sphere import sine_cardinal
from riemhuman.terms import EbinTerm, _cone_geodesics, cone
from riemhuman.terms._cone_geodesics import hyperbolic_sine_cardinal, product_minus_square
from riemhuman.terms.cone import inverse_hyperbolic_sine_cardinal

pytestmark = pytest.mark.usefixtures("strict_floats")

LAMBDAS = (1e-4, 0.05, 1.0, 10.0)
N_PAIRS = 10
FAMILIES = (
    *("ordinary", "near-identical", "within π", "anisotropic", "near-degenerate", "thin"),
    "of all sizes",
)


def matrices(n_samples, anisotropy, rng):
    """Return random positive definite matrices with this quotient of eigenvalues."""
    angle = rng.uniform(0, np.pi, n_samples)
    axes = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1)
    axes = axes.reshape(-1, 2, 2)
    g = axes @ np.diag([1.0, 1.0 / anisotropy]) @ np.swapaxes(axes, 1, 2)
    return _cone_geodesics.symmetric_part(g) * np.exp(rng.normal(size=(n_samples, 1, 1)))


def pairs(family, lam=1.0):
    """Return pairs of matrices, shape (2, n, 2, 2)."""
    rng = np.random.default_rng(1)
    first = matrices(N_PAIRS, 3.0, rng)
    if family == "ordinary":
        return np.stack([first, matrices(N_PAIRS, 2.0, rng)])
    if family == "near-identical":
        noise = _cone_geodesics.symmetric_part(rng.normal(size=first.shape))
        return np.stack([first, first + 1e-8 * noise])
    if family == "within π":
        noise = _cone_geodesics.symmetric_part(rng.uniform(-1, 1, first.shape))
        noise *= min(0.5, 4 * np.sqrt(lam))
        factor = np.linalg.cholesky(first)
        scale = np.exp(rng.normal(size=(N_PAIRS, 1, 1)))
        return np.stack([first, scale * factor @ (np.eye(2) + noise) @ np.swapaxes(factor, 1, 2)])
    if family == "anisotropic":
        return np.stack([matrices(N_PAIRS, 1e6, rng), matrices(N_PAIRS, 1e4, rng)])
    if family == "near-degenerate":
        return np.stack([matrices(N_PAIRS, 1e8, rng), matrices(N_PAIRS, 1e8, rng)])
    if family == "thin":
        return np.exp(rng.uniform(-30, 1, (2, N_PAIRS, 2)))[..., None] * np.eye(2)
    scales = np.exp(rng.uniform(-20, 20, (2, N_PAIRS, 1, 1)))  # of all sizes
    return scales * np.stack([first, matrices(N_PAIRS, 2.0, rng)])


def cone_size(g1, g2, lam):
    """Return 4√λ(s₁ + s₂), the largest distance that g₁ and g₂ can have."""
    s1, s2 = (np.linalg.det(g) ** 0.25 for g in (g1, g2))
    return 4 * np.sqrt(lam) * (s1 + s2)


# Closed forms of the Ebin metric of one λ.


def squared_dist(g1, g2, lam):
    return EbinTerm(lam=lam).squared_dist(*map(_cone_geodesics.coordinates, (g1, g2)))


def exp(delta_g, g, lam):
    (end,), met_apex = _cone_geodesics.exp((delta_g,), (g,), EbinTerm(lam=lam))
    return end, met_apex


def log(g1, g2, lam):
    return _cone_geodesics.log((g1,), (g2,), EbinTerm(lam=lam))[0][0]


def geodesic(g1, g2, t, lam):
    return _cone_geodesics.geodesic((g1,), (g2,), t, EbinTerm(lam=lam))[0]


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize(("family", "tolerance"), [("within π", 1e-12), ("near-identical", 1e-14)])
def test_log_and_exp_are_exact(family, tolerance, lam):
    g1, g2 = pairs(family, lam)
    velocity = log(g1, g2, lam)
    exact = [oracles.exact_log(a, b, lam) for a, b in zip(g1, g2, strict=True)]
    np.testing.assert_allclose(velocity, exact, rtol=0, atol=tolerance * np.abs(g2).max() * 10)
    end, met_apex = exp(velocity, g1, lam)
    assert not met_apex.any()
    exact = [oracles.exact_exp(v, g, lam) for v, g in zip(velocity, g1, strict=True)]
    np.testing.assert_allclose(end, exact, rtol=0, atol=tolerance * np.abs(g2).max())
    np.testing.assert_allclose(end, g2, rtol=0, atol=tolerance * np.abs(g2).max())


@pytest.mark.parametrize("anisotropy", [1e2, 1e4, 1e6])
def test_exp_loses_no_more_than_its_conditioning(anisotropy):
    rng = np.random.default_rng(2)
    g1, g2 = matrices(N_PAIRS, anisotropy, rng), matrices(N_PAIRS, 3.0, rng)
    velocity = log(g1, g2, 10.0)
    end, _ = exp(velocity, g1, 10.0)
    exact = [oracles.exact_exp(v, g, 10.0) for v, g in zip(velocity, g1, strict=True)]
    np.testing.assert_allclose(end, exact, rtol=0, atol=5e-15 * anisotropy)


def test_squared_norms_of_anisotropic_matrices_are_not_negative():
    rng = np.random.default_rng(9)
    g = matrices(500, 1e12, rng)
    a = _cone_geodesics.symmetric_part(rng.normal(size=g.shape))
    assert np.all(_cone_geodesics.inner_product((a,), (a,), (g,), EbinTerm(lam=1e-4)) > 0)


# Through the apex.


def test_far_matrices_meet_at_the_apex():
    lam = 1e-4
    g1, g2 = pairs("ordinary")
    assert np.all(_cone_geodesics.angle((g1,), (g2,), EbinTerm(lam=lam)) > np.pi)
    np.testing.assert_allclose(
        np.sqrt(squared_dist(g1, g2, lam)), cone_size(g1, g2, lam), rtol=1e-12
    )
    s1, s2 = (np.linalg.det(g) ** 0.25 for g in (g1, g2))
    at_apex = geodesic(g1, g2, s1 / (s1 + s2), lam)
    np.testing.assert_allclose(at_apex, 0.0, atol=1e-30)
    before, after = (geodesic(g1, g2, t * np.ones(N_PAIRS), lam) for t in (0.1, 0.95))
    for g, origin in ((before, g1), (after, g2)):
        quotient = g / origin
        np.testing.assert_allclose(quotient, quotient[:, :1, :1] * np.ones((2, 2)), rtol=1e-11)


DEGENERATE = {
    "zero": np.zeros((2, 2)),
    "no u": np.diag([0.0, 3.0]),
    "no v": np.diag([3.0, 0.0]),
    "rank one": np.outer([1.0, 2.0], [1.0, 2.0]),
    "rank one, rounded": np.outer([0.1, 0.3], [0.1, 0.3]),
}


@pytest.mark.parametrize("g", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_matrices_are_the_apex(g):
    lam = 0.3
    other = matrices(1, 3.0, np.random.default_rng(5))[0]
    s = np.linalg.det(other) ** 0.25
    assert _cone_geodesics.is_degenerate(g)
    np.testing.assert_array_equal(_cone_geodesics.coordinates(g), [0.0, 1.0, 0.0])
    assert squared_dist(g, g, lam) == 0
    for zero in DEGENERATE.values():
        assert squared_dist(g, zero, lam) == 0
    np.testing.assert_allclose(squared_dist(g, other, lam), 16 * lam * s**2, rtol=1e-13)
    np.testing.assert_allclose(squared_dist(other, g, lam), 16 * lam * s**2, rtol=1e-13)
    times = np.linspace(0, 1, 5)
    path = geodesic(other, g, times, lam)
    expected = (1 - times)[:, None, None] ** 2 * other
    np.testing.assert_allclose(path, expected, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(geodesic(g, other, 1 - times, lam), expected, atol=1e-14)
    for argument in (0, 1):
        for pair in ((g, other), (other, g), (g, g)):
            assert np.all(np.isfinite(grad(squared_dist, argument)(*pair, lam)))


def test_passing_beside_the_apex_is_legal():
    g = np.eye(2)
    shear = np.array([[1.0, 0.0], [0.0, -1.0]])
    for size in (1e-3, 1e-6, 1e-9):
        end, met_apex = exp(-8 * g + size * shear, g, 1.0)
        assert not met_apex
        np.testing.assert_allclose(end, oracles.exact_exp(-8 * g + size * shear, g, 1.0), rtol=1e-4)


@pytest.mark.parametrize("skew", [1.0, 1e2, 1e3, 1e4])
def test_ways_straight_to_the_apex_meet_it_however_skewed(skew):
    """Rounding errors of whitening grow with the square of x/y."""
    y, x = np.random.default_rng(0).uniform(0.5, 1.0, (2, 100)) * [[1.0], [skew]]
    g = surface.symmetric_matrices(1.0 / y, x / y, (x**2 + y**2) / y)
    _, met_apex = exp(-2.0 * g, g, 1.0)
    assert met_apex.all()


# Traceless matrices.


@pytest.mark.parametrize("argument", [0, 1])
@pytest.mark.parametrize("function", [log, lambda v, g, lam: exp(v - g, g, lam)[0]])
def test_log_and_exp_are_differentiable(function, argument):
    weights = np.array([[1.0, -0.4], [-0.4, 2.0]])
    pair = [g[0] for g in pairs("within π")]

    def value(moved):
        arguments = [*pair]
        arguments[argument] = moved
        return anp.sum(weights * function(*arguments, 0.6))

    gradient = grad(value)(pair[argument])
    direction = np.array([[0.2, 0.1], [0.1, -0.3]])
    assert oracles.taylor_slope(value, pair[argument], direction, gradient) >= 1.9
    pair[1 - argument] = pair[argument].copy()
    assert np.all(np.isfinite(grad(value)(pair[argument])))


# Distances of Theorem 1 (corrected) on single matrices, against exact arithmetic.


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES)
def test_squared_dist_is_exact(family, lam):
    g1, g2 = pairs(family, lam)
    squares = [oracles.exact_squared_dist(a, b, lam) for a, b in zip(g1, g2, strict=True)]
    exact = np.array([float(oracles.mp.sqrt(square)) for square in squares])
    found = np.sqrt(squared_dist(g1, g2, lam))
    np.testing.assert_array_less(np.abs(found - exact), 1e-10 * cone_size(g1, g2, lam))


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


# Functions of one number and of matrices in the closed forms of cones, against many digits.

VALUES = (-30.0, -2.0, -1e-3, -1e-9, 0.0, 1e-300, 1e-9, 1e-4, 0.5, 3.0, 50.0)


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (sine_cardinal, lambda x: mp.sin(x) / x if x else mp.mpf(1)),
        (hyperbolic_sine_cardinal, lambda x: mp.sinh(x) / x if x else mp.mpf(1)),
        (
            inverse_hyperbolic_sine_cardinal,
            lambda x: x / mp.sinh(x) if x else mp.mpf(1),
        ),
    ],
)
def test_cardinal_functions(function, exact):
    expected = [float(exact(mp.mpf(x))) for x in VALUES]
    np.testing.assert_allclose([function(x) for x in VALUES], expected, rtol=1e-14)
    np.testing.assert_allclose(function(np.array(VALUES)), expected, rtol=1e-14)
    assert grad(function)(0.0) == 0.0
    for x in (-2.0, 0.5, 3.0):
        slope = float(mp.diff(exact, x))
        np.testing.assert_allclose(grad(function)(x), slope, rtol=1e-12)
    assert abs(grad(function)(1e-9)) < 1e-6


def test_product_minus_square_is_exact():
    rng = np.random.default_rng(0)
    c = rng.normal(size=1000)
    a = np.exp(rng.normal(size=1000))
    for gap in (1.0, 1e-6, 1e-14, 0.0):
        b = c**2 / a * (1 + gap * rng.uniform(size=1000))
        exact = [
            float(mp.mpf(x) * mp.mpf(y) - mp.mpf(z) ** 2) for x, y, z in zip(a, b, c, strict=True)
        ]
        np.testing.assert_allclose(product_minus_square(a, b, c), exact, rtol=1e-15)
        with pytest.raises(AssertionError):
            # What plain arithmetic would give.
            np.testing.assert_allclose(a * b - c**2, exact, rtol=1e-15)
    for argument, expected in ((0, 3.0), (1, 2.0), (2, -10.0)):
        assert grad(product_minus_square, argument)(2.0, 3.0, 5.0) == expected
