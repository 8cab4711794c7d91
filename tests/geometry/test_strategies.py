"""What a strategy for the exponential has to say."""

from types import SimpleNamespace

import autograd.numpy as anp
import numpy as np
import pytest
from autograd import grad

from riemhuman.errors import NotDefinedError, OutsideManifoldError
from riemhuman.geometry.metric import solve_geodesic

X, V = np.random.default_rng(0).standard_normal((2, 4, 3))


def solver(**said):
    """Return a strategy that goes straight ahead, and says no more than this."""
    return SimpleNamespace(solve=lambda metric, v, x: SimpleNamespace(end=x + v, **said))


@pytest.mark.parametrize("said", [{}, {"complete": True}])
def test_the_end_is_enough(said):
    np.testing.assert_array_equal(solve_geodesic(V, X, None, solver(**said)), (X + V)[None])


@pytest.mark.parametrize(
    ("said", "where"), [({}, "a point on the way"), ({"message": "time 0.3"}, "time 0.3")]
)
def test_a_geodesic_that_leaves_is_refused(said, where):
    with pytest.raises(OutsideManifoldError, match=f"SimpleNamespace can .* stopped at {where}"):
        solve_geodesic(V, X, None, solver(complete=False, **said))


def test_derivatives_are_those_of_the_strategy():
    def total(v, some):
        return anp.sum(anp.sin(solve_geodesic(v, X, None, some)))

    with pytest.raises(NotDefinedError, match="SimpleNamespace has no derivatives of exp"):
        grad(total)(V, solver())
    some = SimpleNamespace(
        solve=lambda metric, v, x: SimpleNamespace(path=np.stack([x, x + v])),
        derivatives=lambda metric, path, v, covectors: (covectors[1], covectors.sum(axis=0)),
    )
    np.testing.assert_array_equal(solve_geodesic(V, X, None, some), [X, X + V])
    np.testing.assert_allclose(grad(total)(V, some), np.cos(X + V), rtol=1e-15)
