"""Functions act on each point of a stack by itself: a stack of points gives that of the results."""

import numpy as np
import pytest
from ebin_matrices import matrices

from riemhuman.kernels import surface
from riemhuman.terms import (
    EbinTerm,
    NormalTerm,
    RootNormalTerm,
    RotationTerm,
    ebin_geodesics,
    ebin_matrices,
    ebin_tangent,
    ebin_transport,
)

LAM = 0.4
RNG = np.random.default_rng(0)
G, OTHER = (matrices(6, 2.0, RNG).reshape(2, 3, 2, 2) for _ in range(2))
A, B = (0.2 * ebin_tangent.symmetric_part(RNG.standard_normal(G.shape)) for _ in range(2))
TIMES = RNG.uniform(0.1, 0.9, G.shape[:2])
# Two stacks of three triangles.
DERIVATIVES = RNG.standard_normal((2, 2, 3, 3))

FUNCTIONS = {
    "trace": (ebin_tangent.trace, G),
    "traceless": (ebin_tangent.traceless, G),
    "symmetric part": (ebin_tangent.symmetric_part, G),
    "size": (ebin_tangent.size, ebin_tangent.traceless(A)),
    "inner product": (lambda *some: ebin_tangent.inner_product(*some, LAM), A, B, G),
    "whitened": (ebin_tangent.whiten, A, G),
    "unwhitened": (ebin_tangent.unwhiten, A, G),
    "exp": (lambda *some: ebin_geodesics.exp(*some, LAM), A, G),
    "log": (lambda *some: ebin_geodesics.log(*some, LAM), G, OTHER),
    "traceless exp": (ebin_geodesics.traceless_exp, ebin_tangent.traceless(A), TIMES),
    "traceless log": (ebin_geodesics.traceless_log, G, OTHER),
    "geodesic": (lambda *some: ebin_geodesics.geodesic(*some, LAM), G, OTHER, TIMES),
    "transport": (lambda *some: ebin_transport.parallel_transport(*some, LAM), A, G, B),
    "determinants": (ebin_matrices.determinants, G),
    "degenerate": (ebin_matrices.is_degenerate, G),
    "shapeless": (ebin_matrices.has_lost_its_shape, G),
    "coordinates": (ebin_matrices.coordinates, G),
    "angle": (lambda *some: ebin_matrices.angle(*some, LAM), G, OTHER),
}
TERMS = [EbinTerm(1.0, 0.3), NormalTerm(), RootNormalTerm(), RotationTerm()]


def check(function, *stacks):
    def results(*arguments):
        found = function(*arguments)
        return found if isinstance(found, tuple) else (found,)

    together = results(*stacks)
    for place in np.ndindex(2, 3):
        alone = results(*(stack[place] for stack in stacks))
        for one, whole in zip(alone, together, strict=True):
            np.testing.assert_allclose(whole[place], one, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_matrices(name):
    check(*FUNCTIONS[name])


@pytest.mark.parametrize("term", TERMS, ids=repr)
def test_terms(term):
    def fields(f_u, f_v):
        return term.fields(surface.follow_up(f_u, f_v))

    one, other = (fields(*some) for some in (DERIVATIVES, DERIVATIVES[::-1]))
    n = len(one)
    check(fields, *DERIVATIVES)
    check(lambda *both: term.squared_dist(both[:n], both[n:]), *one, *other)
    check(
        lambda *some: term.inner_product(some[:n], some[n : 2 * n], some[2 * n :]),
        *(*one, *other, *one),
    )
    if term.chart(one) is not None:
        check(lambda *some: term.chart(some), *one)
