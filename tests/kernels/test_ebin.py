"""Theorem 1 (corrected) on single matrices, against exact arithmetic, SciPy, ODEs and pyRiemann."""

import autograd.numpy as anp
import numpy as np
import oracles
import pytest
from autograd import grad, jacobian
from hypothesis import given
from hypothesis import strategies as st
from pyriemann.geometry.distance import distance_riemann
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize

from riemhuman.kernels import ebin

LAMBDAS = (1e-4, 0.05, 1.0, 10.0)
N_PAIRS = 25


@pytest.fixture(autouse=True)
def _strict_floats():
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


def matrices(n_samples, anisotropy, rng):
    """Return random positive definite matrices with this quotient of eigenvalues."""
    angle = rng.uniform(0, np.pi, n_samples)
    axes = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1)
    axes = axes.reshape(-1, 2, 2)
    g = axes @ np.diag([1.0, 1.0 / anisotropy]) @ np.swapaxes(axes, 1, 2)
    return ebin.symmetric_part(g) * np.exp(rng.normal(size=(n_samples, 1, 1)))


def pairs(family, lam=1.0):
    """Return pairs of matrices, shape (2, n, 2, 2)."""
    rng = np.random.default_rng(1)
    first = matrices(N_PAIRS, 3.0, rng)
    if family == "ordinary":
        return np.stack([first, matrices(N_PAIRS, 2.0, rng)])
    if family == "near-identical":
        noise = ebin.symmetric_part(rng.normal(size=first.shape))
        return np.stack([first, first + 1e-8 * noise])
    if family == "within π":
        noise = min(0.5, 4 * np.sqrt(lam)) * ebin.symmetric_part(rng.uniform(-1, 1, first.shape))
        factor = np.linalg.cholesky(first)
        scale = np.exp(rng.normal(size=(N_PAIRS, 1, 1)))
        return np.stack([first, scale * factor @ (np.eye(2) + noise) @ np.swapaxes(factor, 1, 2)])
    if family == "anisotropic":
        return np.stack([matrices(N_PAIRS, 1e6, rng), matrices(N_PAIRS, 1e4, rng)])
    if family == "near-degenerate":
        return np.stack([matrices(N_PAIRS, 1e8, rng), matrices(N_PAIRS, 1e8, rng)])
    if family == "thin":
        thin = np.exp(rng.uniform(-30, 1, (2, N_PAIRS, 2)))
        return thin[..., None] * np.eye(2)
    if family == "of all sizes":
        scales = np.exp(rng.uniform(-20, 20, (2, N_PAIRS, 1, 1)))
        return scales * np.stack([first, matrices(N_PAIRS, 2.0, rng)])
    raise ValueError(family)


FAMILIES = (
    "ordinary",
    "near-identical",
    "within π",
    "anisotropic",
    "near-degenerate",
    "thin",
    "of all sizes",
)


def cone_size(g1, g2, lam):
    """Return 4√λ(s₁ + s₂), the largest distance that g₁ and g₂ can have."""
    s1, s2 = (np.linalg.det(g) ** 0.25 for g in (g1, g2))
    return 4 * np.sqrt(lam) * (s1 + s2)


def check_squared_dist(squared_dist, g1, g2, lam, rtol=1e-10):
    exact = np.array(
        [
            oracles.mp.sqrt(oracles.exact_squared_dist(a, b, lam))
            for a, b in zip(g1, g2, strict=True)
        ]
    ).astype(float)
    found = np.sqrt(squared_dist(g1, g2, lam))
    np.testing.assert_array_less(np.abs(found - exact), rtol * cone_size(g1, g2, lam))


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES)
def test_squared_dist_is_exact(family, lam):
    check_squared_dist(ebin.squared_dist, *pairs(family, lam), lam)


@pytest.mark.parametrize("lam", LAMBDAS)
def test_near_identical_to_relative_precision(lam):
    g1, g2 = pairs("near-identical")
    exact = [float(oracles.exact_squared_dist(a, b, lam)) for a, b in zip(g1, g2, strict=True)]
    # The difference of matrices 1e-8 apart holds eight digits.
    np.testing.assert_allclose(ebin.squared_dist(g1, g2, lam), exact, rtol=1e-6)


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", ["ordinary", "within π"])
def test_squared_dist_agrees_with_matrix_functions(family, lam):
    g1, g2 = pairs(family, lam)
    expected = [oracles.matrix_squared_dist(a, b, lam) for a, b in zip(g1, g2, strict=True)]
    np.testing.assert_allclose(ebin.squared_dist(g1, g2, lam), expected, rtol=1e-10, atol=1e-13)


# Slips that a reader of the paper could make (house rule 9).


def squared_dist_from(theta, g1, g2, lam):
    s1, s2 = np.linalg.det(g1) ** 0.25, np.linalg.det(g2) ** 0.25
    cosine = np.cos(np.minimum(np.pi, theta))
    return 16 * lam * (s1**2 - 2 * s1 * s2 * cosine + s2**2)


def slip(variant):
    def squared_dist(g1, g2, lam):
        k = g1 @ np.array([oracles.matrix_log(q) for q in np.linalg.solve(g1, g2)])
        trace = np.trace(np.linalg.solve(g1, k), axis1=1, axis2=2)[:, None, None]
        k0 = k - (1.0 if variant == "full trace" else 0.5) * trace * g1
        shear = k0 if variant == "no inverse" else np.linalg.solve(g1, k0)
        squared = np.trace(shear @ shear, axis1=1, axis2=2)
        theta = np.sqrt(squared * lam if variant == "misplaced" else squared / lam) / 4
        return squared_dist_from(theta, g1, g2, lam)

    return squared_dist


def test_the_corrected_theorem_passes():
    check_squared_dist(slip("none"), *pairs("ordinary"), 1.0)


@pytest.mark.parametrize("variant", ["full trace", "no inverse", "misplaced"])
def test_slips_of_the_paper_fail(variant):
    with pytest.raises(AssertionError):
        check_squared_dist(slip(variant), *pairs("ordinary"), 0.7)


# Exponential, logarithm, geodesic.


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize(("family", "tolerance"), [("within π", 1e-12), ("near-identical", 1e-14)])
def test_log_and_exp_are_exact(family, tolerance, lam):
    g1, g2 = pairs(family, lam)
    log = ebin.log(g1, g2, lam)
    exact = [oracles.exact_log(a, b, lam) for a, b in zip(g1, g2, strict=True)]
    np.testing.assert_allclose(log, exact, rtol=0, atol=tolerance * np.abs(g2).max() * 10)
    end, met_apex = ebin.exp(log, g1, lam)
    assert not met_apex.any()
    exact = [oracles.exact_exp(v, g, lam) for v, g in zip(log, g1, strict=True)]
    np.testing.assert_allclose(end, exact, rtol=0, atol=tolerance * np.abs(g2).max())
    np.testing.assert_allclose(end, g2, rtol=0, atol=tolerance * np.abs(g2).max())


@pytest.mark.parametrize("anisotropy", [1e2, 1e4, 1e6])
def test_exp_loses_no_more_than_its_conditioning(anisotropy):
    rng = np.random.default_rng(2)
    g1, g2 = matrices(N_PAIRS, anisotropy, rng), matrices(N_PAIRS, 3.0, rng)
    velocity = ebin.log(g1, g2, 10.0)
    end, _ = ebin.exp(velocity, g1, 10.0)
    exact = [oracles.exact_exp(v, g, 10.0) for v, g in zip(velocity, g1, strict=True)]
    np.testing.assert_allclose(end, exact, rtol=0, atol=5e-15 * anisotropy)


@pytest.mark.parametrize("lam", LAMBDAS)
def test_exp_agrees_with_matrix_exponential(lam):
    rng = np.random.default_rng(3)
    g = matrices(N_PAIRS, 3.0, rng)
    for size in (1e-3, 0.5, 3.0):
        velocity = size * ebin.symmetric_part(rng.normal(size=g.shape))
        end, met_apex = ebin.exp(velocity, g, lam)
        assert not met_apex.any()
        expected = [oracles.matrix_exp(v, m, lam) for v, m in zip(velocity, g, strict=True)]
        np.testing.assert_allclose(end, expected, rtol=1e-10, atol=1e-10)
        np.testing.assert_array_equal(end, np.swapaxes(end, 1, 2))


@pytest.mark.parametrize("lam", LAMBDAS)
def test_norm_of_log_is_dist(lam):
    g1, g2 = pairs("within π", lam)
    log = ebin.log(g1, g2, lam)
    np.testing.assert_allclose(
        ebin.inner_product(log, log, g1, lam), ebin.squared_dist(g1, g2, lam), rtol=1e-11
    )


def test_pure_scaling_and_standing_still():
    g = matrices(N_PAIRS, 3.0, np.random.default_rng(4))
    np.testing.assert_allclose(ebin.log(g, g, 0.3), 0.0, atol=1e-14)
    np.testing.assert_allclose(ebin.exp(0 * g, g, 0.3)[0], g, rtol=1e-14)
    # s grows linearly: δg = 2 g gives s(1) = 2 s, as A = 2I has δs = s.
    np.testing.assert_allclose(ebin.exp(4 * g, g, 0.3)[0], 9 * g, rtol=1e-13)
    np.testing.assert_allclose(ebin.log(g, 9 * g, 0.3), 4 * g, rtol=1e-13)


def metric_tensor(q, lam):
    """Return equation 2 (corrected) in the coordinates E, M, G, written for autograd."""
    g = anp.array([[q[0], q[1]], [q[1], q[2]]])
    inverse = anp.linalg.inv(g)
    basis = np.array([[[1.0, 0], [0, 0]], [[0, 1.0], [1.0, 0]], [[0, 0], [0, 1.0]]])
    a = [inverse @ b for b in basis]
    a0 = [b - 0.5 * anp.trace(b) * np.eye(2) for b in a]
    entries = [
        [anp.trace(a0[i] @ a0[j]) + lam * anp.trace(a[i]) * anp.trace(a[j]) for j in range(3)]
        for i in range(3)
    ]
    return anp.sqrt(anp.linalg.det(g)) * anp.array(entries)


def follow_geodesic_equation(velocity, g, lam, times):
    """Integrate q̈ᵏ = −Γᵏᵢⱼ q̇ⁱ q̇ʲ numerically."""
    slopes = jacobian(metric_tensor)

    def rate(_, state):
        q, p = state[:3], state[3:]
        slope = slopes(q, lam)
        force = np.einsum("kij,i,j->k", slope, p, p) - 0.5 * np.einsum("ijk,i,j->k", slope, p, p)
        return np.concatenate([p, -np.linalg.solve(metric_tensor(q, lam), force)])

    start = np.concatenate([m[[0, 0, 1], [0, 1, 1]] for m in (g, velocity)])
    solution = solve_ivp(rate, (0, 1), start, "DOP853", times, rtol=1e-11, atol=1e-12)
    return solution.y.T[:, [0, 1, 1, 2]].reshape(-1, 2, 2)


@pytest.mark.parametrize("lam", LAMBDAS)
def test_geodesics_solve_the_geodesic_equation(lam):
    times = np.linspace(0, 1, 6)
    g1, g2 = (g[:1] for g in pairs("within π", lam))
    for start, end in zip(g1, g2, strict=True):
        velocity = ebin.log(start, end, lam)
        expected = follow_geodesic_equation(velocity, start, lam, times)
        found = ebin.geodesic(start, end, times, lam)
        np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7)
        shot = ebin.exp(times[:, None, None] * velocity, start, lam)[0]
        np.testing.assert_allclose(shot, found, rtol=1e-12, atol=1e-14)


def test_the_least_energy_of_discrete_paths_is_the_squared_distance():
    """Minimise the energy of equation 2 over paths of matrices, knowing no closed form."""
    lam = 0.5
    g1, g2 = (g[0] for g in pairs("ordinary"))
    ends = [m[[0, 0, 1], [0, 1, 1]] for m in (g1, g2)]

    def energy(inner, n):
        path = anp.concatenate([ends[0][None], anp.reshape(inner, (n - 1, 3)), ends[1][None]])
        middle, step = 0.5 * (path[1:] + path[:-1]), path[1:] - path[:-1]
        terms = [step[i] @ metric_tensor(middle[i], lam) @ step[i] for i in range(n)]
        return n * sum(terms)

    least = {}
    for n in (4, 8):
        t = np.linspace(0, 1, n + 1)[1:-1, None]
        start = ((1 - t) * ends[0] + t * ends[1]).ravel()
        options = {"hess_inv0": 0.02 / n * np.eye(start.size)}
        least[n] = minimize(energy, start, (n,), "BFGS", grad(energy), options=options).fun
    extrapolated = (4 * least[8] - least[4]) / 3
    np.testing.assert_allclose(extrapolated, ebin.squared_dist(g1, g2, lam), rtol=5e-3)


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES[:4])
def test_geodesic_has_constant_speed(family, lam):
    g1, g2 = pairs(family, lam)
    times = np.linspace(0, 1, 8)
    path = ebin.geodesic(g1, g2, times[:, None] * np.ones(N_PAIRS), lam)
    steps = np.sqrt(ebin.squared_dist(path[:-1], path[1:], lam))
    dist = np.sqrt(ebin.squared_dist(g1, g2, lam))
    # Points on the way are rounded to matrices, in which the steps are small or ill determined.
    tolerance = {"near-identical": 1e-5, "anisotropic": 1e-5}.get(family, 1e-9)
    np.testing.assert_allclose(steps, np.tile(dist / 7, (7, 1)), rtol=tolerance)
    np.testing.assert_allclose(steps.sum(axis=0), dist, rtol=tolerance)


# Through the apex.


def test_far_matrices_meet_at_the_apex():
    lam = 1e-4
    g1, g2 = pairs("ordinary")
    assert np.all(ebin.angle(g1, g2, lam) > np.pi)
    np.testing.assert_allclose(
        np.sqrt(ebin.squared_dist(g1, g2, lam)), cone_size(g1, g2, lam), rtol=1e-12
    )
    s1, s2 = (np.linalg.det(g) ** 0.25 for g in (g1, g2))
    at_apex = ebin.geodesic(g1, g2, s1 / (s1 + s2), lam)
    np.testing.assert_allclose(at_apex, 0.0, atol=1e-30)
    before, after = (ebin.geodesic(g1, g2, t * np.ones(N_PAIRS), lam) for t in (0.1, 0.95))
    for g, origin in ((before, g1), (after, g2)):
        quotient = g / origin
        np.testing.assert_allclose(quotient, quotient[:, :1, :1] * np.ones((2, 2)), rtol=1e-11)


def test_speed_through_the_apex_by_the_inner_product():
    lam = 1e-4
    g1, g2 = (g[0] for g in pairs("ordinary"))
    dist = np.sqrt(ebin.squared_dist(g1, g2, lam))
    for t in (0.05, 0.2, 0.8, 0.9):
        step = 1e-5
        g = ebin.geodesic(g1, g2, np.array(t), lam)
        change = ebin.geodesic(g1, g2, np.array([t - step, t + step]), lam)
        velocity = (change[1] - change[0]) / (2 * step)
        speed = np.sqrt(oracles.ebin_inner_product(velocity, velocity, g, lam))
        np.testing.assert_allclose(speed, dist, rtol=1e-8)


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
    assert ebin.is_degenerate(g)
    assert ebin.squared_dist(g, g, lam) == 0
    for zero in DEGENERATE.values():
        assert ebin.squared_dist(g, zero, lam) == 0
    np.testing.assert_allclose(ebin.squared_dist(g, other, lam), 16 * lam * s**2, rtol=1e-13)
    np.testing.assert_allclose(ebin.squared_dist(other, g, lam), 16 * lam * s**2, rtol=1e-13)
    times = np.linspace(0, 1, 5)
    path = ebin.geodesic(other, g, times, lam)
    expected = (1 - times)[:, None, None] ** 2 * other
    np.testing.assert_allclose(path, expected, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(ebin.geodesic(g, other, 1 - times, lam), expected, atol=1e-14)
    for argument in (0, 1):
        for pair in ((g, other), (other, g), (g, g)):
            assert np.all(np.isfinite(grad(ebin.squared_dist, argument)(*pair, lam)))


def test_limit_towards_degenerate_matrices():
    """Distances to g + εI tend to the distance to the degenerate g, like √s = ε^(1/4)."""
    lam = 0.3
    other = matrices(1, 3.0, np.random.default_rng(5))[0]
    for g in DEGENERATE.values():
        limit = np.sqrt(ebin.squared_dist(g, other, lam))
        for step in (1e-4, 1e-8, 1e-12, 1e-16):
            dist = np.sqrt(ebin.squared_dist(g + step * np.eye(2), other, lam))
            assert abs(dist - limit) < 20 * np.sqrt(lam) * step**0.25


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("anisotropy", [1.0, 3.0, 1e4])
def test_radial_geodesics_meet_the_apex(lam, anisotropy):
    """The velocity −c g reaches g = 0 if c ≥ 2; rounding must not steer around it."""
    g = matrices(200, anisotropy, np.random.default_rng(6))
    for factor, expected in ((-1.9, False), (-2.0, True), (-2.1, True), (-9.0, True), (4.0, False)):
        met_apex = ebin.exp(factor * g, g, lam)[1]
        np.testing.assert_array_equal(met_apex, expected)


def test_passing_beside_the_apex_is_legal():
    g = np.eye(2)
    shear = np.array([[1.0, 0.0], [0.0, -1.0]])
    for size in (1e-3, 1e-6, 1e-9):
        end, met_apex = ebin.exp(-8 * g + size * shear, g, 1.0)
        assert not met_apex
        np.testing.assert_allclose(end, oracles.exact_exp(-8 * g + size * shear, g, 1.0), rtol=1e-4)


# The inner product.


@pytest.mark.parametrize("lam", LAMBDAS)
def test_inner_product_agrees_with_its_definition(lam):
    rng = np.random.default_rng(7)
    g = matrices(N_PAIRS, 5.0, rng)
    a, b = ebin.symmetric_part(rng.normal(size=(2, *g.shape)))
    expected = [oracles.ebin_inner_product(x, y, m, lam) for x, y, m in zip(a, b, g, strict=True)]
    np.testing.assert_allclose(ebin.inner_product(a, b, g, lam), expected, rtol=1e-10, atol=1e-12)


def test_half_is_the_trace_of_the_square():
    rng = np.random.default_rng(8)
    g = matrices(N_PAIRS, 5.0, rng)
    a = ebin.symmetric_part(rng.normal(size=g.shape))
    velocity = np.linalg.solve(g, a)
    expected = np.trace(velocity @ velocity, axis1=1, axis2=2) * np.sqrt(np.linalg.det(g))
    np.testing.assert_allclose(ebin.inner_product(a, a, g, 0.5), expected, rtol=1e-12)


def test_squared_norms_of_anisotropic_matrices_are_not_negative():
    rng = np.random.default_rng(9)
    g = matrices(500, 1e12, rng)
    a = ebin.symmetric_part(rng.normal(size=g.shape))
    assert np.all(ebin.inner_product(a, a, g, 1e-4) > 0)


# Relations.


@given(
    st.tuples(*[st.floats(-2, 2)] * 4),
    st.integers(0, 2**32 - 1),
    st.sampled_from(LAMBDAS),
)
def test_frames_do_not_matter(entries, seed, lam):
    """d²(AᵀgA) = |det A| d²(g): what makes the integral independent of the template."""
    frame = np.eye(2) + 0.3 * np.reshape(entries, (2, 2))
    if abs(np.linalg.det(frame)) < 0.05:
        return
    rng = np.random.default_rng(seed)
    g1, g2 = matrices(1, 3.0, rng)[0], matrices(1, 2.0, rng)[0]
    seen = ebin.squared_dist(frame.T @ g1 @ frame, frame.T @ g2 @ frame, lam)
    expected = abs(np.linalg.det(frame)) * ebin.squared_dist(g1, g2, lam)
    np.testing.assert_allclose(seen, expected, rtol=1e-9)


def test_trace_of_the_shear_agrees_with_pyriemann():
    g1, g2 = pairs("ordinary")
    shear, length = ebin.traceless_log(g1, g2)
    np.testing.assert_allclose(ebin.trace(shear @ shear), 2 * length**2, rtol=1e-12)
    expected = (
        distance_riemann(g1, g2) ** 2 - 0.5 * np.log(np.linalg.det(g2) / np.linalg.det(g1)) ** 2
    )
    np.testing.assert_allclose(2 * length**2, expected, rtol=1e-11)


def test_whitening():
    rng = np.random.default_rng(10)
    g = matrices(N_PAIRS, 50.0, rng)
    a = ebin.symmetric_part(rng.normal(size=g.shape))
    factor = np.linalg.cholesky(g)
    inverse = np.linalg.inv(factor)
    white = ebin.whiten(a, g)
    np.testing.assert_allclose(
        white, inverse @ a @ np.swapaxes(inverse, 1, 2), rtol=1e-9, atol=1e-10
    )
    np.testing.assert_allclose(ebin.whiten(g, g), np.tile(np.eye(2), (N_PAIRS, 1, 1)), atol=1e-13)
    np.testing.assert_allclose(ebin.unwhiten(white, g), a, atol=1e-12)
    velocity = np.linalg.solve(g, a)
    np.testing.assert_allclose(ebin.trace(white), np.trace(velocity, axis1=1, axis2=2), rtol=1e-9)


def test_traceless_exp_agrees_with_expm():
    rng = np.random.default_rng(11)
    v = ebin.traceless(ebin.symmetric_part(rng.normal(size=(N_PAIRS, 2, 2))))
    v[0] = 0.0
    factor = rng.normal(size=N_PAIRS)
    expected = [expm(f * m) for f, m in zip(factor, v, strict=True)]
    np.testing.assert_allclose(ebin.traceless_exp(v, factor), expected, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("lam", LAMBDAS)
def test_axioms_on_many_triples(lam):
    rng = np.random.default_rng(12)
    n = 10_000
    a, b, c = (matrices(n, 10.0 ** rng.uniform(0, 1), rng) for _ in range(3))
    b[: n // 4] = a[: n // 4] * (1 + 1e-9 * rng.normal(size=(n // 4, 1, 1)))
    c[n // 2 : n // 2 + 500] = 0.0
    c[n // 2 + 500 : n // 2 + 1000] = np.diag([1.0, 0.0])

    def dist(x, y):
        return np.sqrt(ebin.squared_dist(x, y, lam))

    np.testing.assert_array_equal(dist(a, b), dist(b, a))
    np.testing.assert_array_equal(dist(a, a), 0.0)
    assert np.all(dist(a, b) > 0)
    slack = dist(a, b) + dist(b, c) - dist(a, c)
    assert slack.min() >= -1e-13
    assert np.all(dist(a, c) <= cone_size(a, c, lam) * (1 + 1e-12))


# Derivatives of the custom primitives.


@pytest.mark.parametrize("lam", LAMBDAS)
def test_slope_of_the_half_angle(lam):
    cut = np.cosh(np.pi * 2 * np.sqrt(2 * lam)) - 1
    for m in (1e-12, 1e-3 * cut, 0.5 * cut, 0.999 * cut, 1.5 * cut, 100 * cut):
        slope = grad(ebin.half_angle_sine_squared)(m, lam)
        remainders = np.array(
            [
                ebin.half_angle_sine_squared(m * (1 + e), lam)
                - ebin.half_angle_sine_squared(m, lam)
                - m * e * slope
                for e in (1e-3, 1e-4)
            ]
        )
        if np.abs(remainders[1]) > 1e-14:
            assert np.log10(abs(remainders[0] / remainders[1])) >= 1.9
        else:
            assert abs(remainders[0]) < 1e-10
        # Slopes of slopes are needed where an inner product is a second derivative.
        step = 1e-6 * m
        second = grad(grad(ebin.half_angle_sine_squared))(m, lam)
        ahead, behind = (grad(ebin.half_angle_sine_squared)(m + e, lam) for e in (step, -step))
        np.testing.assert_allclose(
            second, (ahead - behind) / (2 * step), rtol=1e-4, atol=1e-4 * (slope / m + 1e-12)
        )


@pytest.mark.parametrize("lam", LAMBDAS)
def test_half_angle_at_its_ends(lam):
    kappa = ebin.angle_per_distance(lam)
    assert ebin.half_angle_sine_squared(0.0, lam) == 0
    np.testing.assert_allclose(grad(ebin.half_angle_sine_squared)(0.0, lam), kappa**2 / 2)
    assert ebin.half_angle_sine_squared(1e12, lam) == 1
    assert grad(ebin.half_angle_sine_squared)(1e12, lam) == 0
    assert np.isfinite(grad(grad(ebin.half_angle_sine_squared))(0.0, lam))


@pytest.mark.parametrize("lam", LAMBDAS)
@pytest.mark.parametrize("family", FAMILIES)
def test_gradients_of_squared_dist(family, lam):
    g1, g2 = (g[0] for g in pairs(family, lam))
    factor = np.linalg.cholesky(g1)
    direction = factor @ np.array([[0.3, 0.5], [0.5, -0.8]]) @ factor.T
    gradient = grad(ebin.squared_dist)(g1, g2, lam)
    # Exact arithmetic, because g₁ + εh itself is rounded too much where g₁ is nearly degenerate.
    g1_exact, direction_exact = (oracles.mp.matrix(m.tolist()) for m in (g1, direction))
    expected = oracles.mp.diff(
        lambda t: oracles.exact_squared_dist(g1_exact + t * direction_exact, g2, lam), 0
    )
    scale = 1e-9 * np.sqrt(np.linalg.det(g1)) * lam + 1e-8 * abs(float(expected))
    np.testing.assert_allclose(np.sum(gradient * direction), float(expected), atol=scale)
    np.testing.assert_array_equal(gradient, grad(ebin.squared_dist, 1)(g2, g1, lam))
    np.testing.assert_array_equal(grad(ebin.squared_dist)(g1, g1, lam), 0.0)
    if family in ("ordinary", "within π"):
        value = lambda g: ebin.squared_dist(g, g2, lam)  # noqa: E731
        assert oracles.taylor_slope(value, g1, direction, gradient) >= 1.9


@pytest.mark.parametrize("argument", [0, 1])
@pytest.mark.parametrize("function", [ebin.log, lambda v, g, lam: ebin.exp(v - g, g, lam)[0]])
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
