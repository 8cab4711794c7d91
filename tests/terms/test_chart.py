"""The chart of the Ebin term: Euclidean distances that are at most those of the cone."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from riemhuman.terms import EbinTerm, cone


def cone_chart(x, y, s, lam):
    return EbinTerm(lam=lam).chart((x, y, s))


def squared_dist(one, other, lam):
    return EbinTerm(lam=lam).squared_dist(one, other)


def coordinates_of(numbers):
    """Return half-plane coordinates and radius from three numbers of any size and sign."""
    x, log_y, log_s = numbers
    return np.array([x]), np.exp([log_y]), np.exp([log_s])


@given(
    first=st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3),
    change=st.lists(st.floats(-4.0, 4.0), min_size=3, max_size=3),
    log_size=st.floats(-6.0, 0.0),
    log_lam=st.floats(-5.0, 1.0),
)
def test_cone_chart_never_lengthens(first, change, log_size, log_lam):
    second = np.add(first, 10.0**log_size * np.array(change))
    lam = 10.0**log_lam
    points = [coordinates_of(first), coordinates_of(second)]
    exact = squared_dist(*points, lam)[0]
    charts = [cone_chart(*point, lam) for point in points]
    # The rounding of the angles, which grow as 1/√λ, moves the chart by a share of its radius.
    rounding = 1e-12 * sum(np.linalg.norm(chart) for chart in charts) / min(1.0, np.sqrt(lam))
    assert np.linalg.norm(charts[0] - charts[1]) <= np.sqrt(exact) * (1 + 1e-12) + rounding


def test_cone_chart_is_tight_near_the_identity():
    rng = np.random.default_rng(0)
    x, log_y, s = 1e-4 * rng.standard_normal((3, 50, 2))
    points = [(x[:, k], np.exp(log_y[:, k]), 1 + s[:, k]) for k in (0, 1)]
    exact = squared_dist(*points, 0.5)
    charts = [cone_chart(*point, 0.5) for point in points]
    bound = np.sum((charts[0] - charts[1]) ** 2, axis=-1)
    np.testing.assert_allclose(bound, exact, rtol=1e-3)


def test_cone_chart_winds_logarithms_as_long_as_the_distance_from_the_identity():
    rng = np.random.default_rng(5)
    lam, s = 50.0, rng.uniform(0.5, 2.0, 40)
    x, y = rng.uniform(-4.0, 4.0, 40), np.exp(rng.uniform(-3.0, 3.0, 40))
    x[0], y[0] = 0.0, 1.0
    first, second = np.split(cone_chart(x, y, s, lam), 2, axis=-1)
    radii = 4.0 * np.sqrt(0.5 * lam) * s
    np.testing.assert_allclose(np.hypot(first, second), radii[:, None] * [1.0, 1.0], rtol=1e-13)
    lengths = np.linalg.norm(np.arctan2(second, first), axis=-1)
    distances = cone.hyperbolic_distance(cone.excess(x, y, 0.0, 1.0))
    expected = np.sqrt(2.0) * 0.5 / np.sqrt(2.0 * lam) * distances
    np.testing.assert_allclose(lengths, expected, rtol=1e-12, atol=1e-15)


def test_cone_chart_sees_the_apex():
    apex = cone_chart(np.zeros(1), np.ones(1), np.zeros(1), 0.3)
    other = cone_chart(np.array([0.4]), np.array([2.0]), np.array([1.7]), 0.3)
    np.testing.assert_allclose(np.sum((apex - other) ** 2), 16 * 0.3 * 1.7**2)


def test_a_steeper_chart_is_no_bound():
    # The frequency √2 κ is the largest that Jensen's inequality allows.
    first = tuple(np.array([value]) for value in (0.0, 1.0, 1.0))
    second = tuple(np.array([value]) for value in (0.3, 1.3, 1.0))
    exact = squared_dist(first, second, 0.5)
    # The same radius, and angles 1.1 times as large.
    charts = [1.1 * cone_chart(*point, 0.5 / 1.1**2) for point in (first, second)]
    assert np.sum((charts[0] - charts[1]) ** 2) > exact
