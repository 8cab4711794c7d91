"""Functions act on each point of a stack by itself: a stack of points gives that of the results."""

import ebin_matrices
import numpy as np
import pytest
from ebin_matrices import matrices

from riemhuman.kernels import surface
from riemhuman.terms import EbinTerm, NormalTerm, RootNormalTerm, RotationTerm, _cone_geodesics

LAM = 0.4
RNG = np.random.default_rng(0)
G, OTHER = (matrices(6, 2.0, RNG).reshape(2, 3, 2, 2) for _ in range(2))
A, B = (0.2 * _cone_geodesics.symmetric_part(RNG.standard_normal(G.shape)) for _ in range(2))
TIMES = RNG.uniform(0.1, 0.9, G.shape[:2])
# Two stacks of three triangles.
DERIVATIVES = RNG.standard_normal((2, 2, 3, 3))

FUNCTIONS = {
    "trace": (_cone_geodesics.trace, G),
    "traceless": (_cone_geodesics.traceless, G),
    "symmetric part": (_cone_geodesics.symmetric_part, G),
    "size": (_cone_geodesics.size, _cone_geodesics.traceless(A)),
    "inner product": (lambda *some: ebin_matrices.inner_product(*some, LAM), A, B, G),
    "whitened": (_cone_geodesics.whiten, A, G),
    "unwhitened": (_cone_geodesics.unwhiten, A, G),
    "exp": (lambda *some: ebin_matrices.exp(*some, LAM), A, G),
    "log": (lambda *some: ebin_matrices.log(*some, LAM), G, OTHER),
    "traceless exp": (_cone_geodesics.traceless_exp, _cone_geodesics.traceless(A), TIMES),
    "traceless log": (_cone_geodesics.traceless_log, G, OTHER),
    "geodesic": (lambda *some: ebin_matrices.geodesic(*some, LAM), G, OTHER, TIMES),
    "transport": (lambda *some: ebin_matrices.parallel_transport(*some, LAM), A, G, B),
    "determinants": (_cone_geodesics.determinants, G),
    "degenerate": (_cone_geodesics.is_degenerate, G),
    "shapeless": (_cone_geodesics.has_lost_its_shape, G),
    "coordinates": (_cone_geodesics.coordinates, G),
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
