"""Pairs of positive definite 2 × 2 matrices, easy and hard, for tests of the Ebin metric."""

import numpy as np

from riemhuman.terms import EbinTerm, _cone_geodesics, cone

LAMBDAS = (1e-4, 0.05, 1.0, 10.0)


N_PAIRS = 10


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
        noise = min(0.5, 4 * np.sqrt(lam)) * _cone_geodesics.symmetric_part(
            rng.uniform(-1, 1, first.shape)
        )
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


def squared_dist(g1, g2, lam):
    """Return the squared distances of matrices by the term."""
    return cone.EbinTerm(lam=lam).squared_dist(
        _cone_geodesics.coordinates(g1), _cone_geodesics.coordinates(g2)
    )


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


# Closed forms of the Ebin metric of one λ.


def exp(delta_g, g, lam):
    (end,), met_apex = _cone_geodesics.exp((delta_g,), (g,), EbinTerm(lam=lam))
    return end, met_apex


def log(g1, g2, lam):
    return _cone_geodesics.log((g1,), (g2,), EbinTerm(lam=lam))[0][0]


def angle(g1, g2, lam):
    return _cone_geodesics.angle((g1,), (g2,), EbinTerm(lam=lam))


def inner_product(a, b, g, lam):
    return _cone_geodesics.inner_product((a,), (b,), (g,), EbinTerm(lam=lam))


def geodesic(g1, g2, t, lam):
    return _cone_geodesics.geodesic((g1,), (g2,), t, EbinTerm(lam=lam))[0]


def parallel_transport(w, g, delta_g, lam):
    term = EbinTerm(lam=lam)
    return _cone_geodesics.parallel_transport((w,), (g,), (delta_g,), term)[0]
