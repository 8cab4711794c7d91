"""Closed-form transport on the cone: an isometry that keeps geodesics, and ladders' limit."""

import autograd.numpy as anp
import ebin_matrices
import numpy as np
import pytest
from autograd import grad
from ebin_matrices import parallel_transport
from oracles import taylor_slope

from riemhuman.terms import _cone_geodesics

LAMBDAS = [1e-4, 0.05, 0.5, 10.0]


def samples(lam, n=40):
    """Return matrices, velocities whose geodesics stay, and two tangent vectors each."""
    rng = np.random.default_rng(1)
    factor = np.eye(2) + 0.4 * rng.standard_normal((n, 2, 2))
    g = factor @ np.swapaxes(factor, -1, -2) + 0.1 * np.eye(2)
    vectors = _cone_geodesics.symmetric_part(rng.standard_normal((3, n, 2, 2)))
    vectors = factor @ vectors @ np.swapaxes(factor, -1, -2)
    return g, min(1.0, np.sqrt(lam)) * 0.5 * vectors[0], vectors[1], vectors[2]


@pytest.mark.parametrize("lam", LAMBDAS)
def test_keeps_inner_products(lam):
    g, velocity, a, b = samples(lam)
    end, met_apex = ebin_matrices.exp(velocity, g, lam)
    assert not met_apex.any()
    carried_a, carried_b = (parallel_transport(w, g, velocity, lam) for w in (a, b))
    np.testing.assert_allclose(
        ebin_matrices.inner_product(carried_a, carried_b, end, lam),
        ebin_matrices.inner_product(a, b, g, lam),
        rtol=1e-9,
        atol=1e-11 * max(1.0, lam),
    )


def test_satisfies_the_geodesic_equations_derivative():
    """Transport for a short time is w − Γ(v, w) t, with Γ from the second order of exp."""
    lam, t = 0.5, 1e-4
    g, v, w, _ = samples(lam)

    def second_order(u):
        ends = [ebin_matrices.exp(s * t * u, g, lam)[0] for s in (1.0, -1.0)]
        return (ends[0] - 2 * g + ends[1]) / t**2

    christoffel = -0.25 * (second_order(v + w) - second_order(v - w))
    rate = (parallel_transport(w, g, t * v, lam) - parallel_transport(w, g, -t * v, lam)) / (2 * t)
    np.testing.assert_allclose(rate, -christoffel, rtol=1e-4, atol=1e-5)


def test_gradient():
    g, velocity, a, b = samples(0.5, n=3)

    def value(x):
        return anp.sum(b * parallel_transport(a, g, _cone_geodesics.symmetric_part(x), 0.5))

    assert taylor_slope(value, velocity, 0.1 * a, grad(value)(velocity)) > 1.9
