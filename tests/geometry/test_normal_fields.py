"""C^∞(T, S²): weighted sums of spheres, transport, and what is refused."""

import numpy as np
import pytest
from autograd import grad
from cases import sphere_template

from riemhuman.errors import ArgumentError, OutsideManifoldError
from riemhuman.geometry import NormalFields

SPACE = NormalFields(sphere_template())
METRIC = SPACE.metric
AREAS = SPACE.template.face_areas


def test_antipodal_normals():
    n = SPACE.random_point(rng=4)
    opposite = n.copy()
    opposite[[6, 8]] *= -1
    expected = np.pi * np.sqrt(AREAS[[6, 8]].sum())
    np.testing.assert_allclose(METRIC.dist(n, opposite), expected, rtol=1e-14)
    with np.errstate(all="raise"):
        for argument in (0, 1):
            assert np.all(np.isfinite(grad(METRIC.squared_dist, argument)(n, opposite)))
            assert np.all(np.isfinite(grad(METRIC.dist, argument)(n, opposite)))
    message = "point must hold no normal antipodal .*triangle 6, the first of 2 such triangles"
    for call in (
        lambda: METRIC.log(opposite, n),
        lambda: METRIC.geodesic(n, opposite),
        lambda: METRIC.parallel_transport(n, n, end_point=opposite),
    ):
        with pytest.raises(OutsideManifoldError, match=message):
            call()
    rounded = np.where(opposite == -n, opposite * (1 + 2e-16), opposite)
    with pytest.raises(OutsideManifoldError, match="triangle 6"):
        METRIC.log(rounded, n)


def test_refusals():
    n = SPACE.random_point(rng=5)
    long = n.copy()
    long[4] *= 1.001
    assert not SPACE.belongs(long)
    with pytest.raises(ArgumentError, match=r"point_a must hold unit vectors; .* at triangle 4$"):
        METRIC.dist(long, n)
    with pytest.raises(ArgumentError, match="base_point must hold unit vectors"):
        METRIC.exp(n, long)
    with pytest.raises(ArgumentError, match="end_point must hold unit vectors"):
        METRIC.geodesic(n, long)
    with pytest.raises(ArgumentError, match="needs direction or end_point, and not both"):
        METRIC.parallel_transport(n, n, direction=n, end_point=n)
    with pytest.raises(ArgumentError, match="direction must have shape"):
        METRIC.parallel_transport(n, n, direction=n[:3])
    with pytest.raises(ArgumentError, match="tangent_vec must have shape"):
        METRIC.parallel_transport(n[:3], n, direction=n)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_lengths_are_one_to_a_tolerance(sign):
    n = SPACE.random_point(rng=6)
    for off, legal in ((0.9e-6, True), (1.1e-6, False)):
        scaled = n.copy()
        scaled[7] *= 1.0 + sign * off
        if legal:
            np.testing.assert_array_equal(SPACE.check_point(scaled), scaled)
        else:
            with pytest.raises(ArgumentError, match="unit vectors.* at triangle 7$"):
                SPACE.check_point(scaled)
        assert not SPACE.belongs(scaled)
        assert SPACE.belongs(scaled, atol=1.1 * off)
        assert not SPACE.belongs(scaled, atol=0.9 * off)
    scaled[7] = n[7] * (1.0 + 1e-10 * sign)
    assert SPACE.belongs(scaled)
    assert SPACE.belongs(np.tile([0.0, sign, 0.0], (80, 1)), atol=0.0)
