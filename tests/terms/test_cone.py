"""The cone of the general elastic metric: numerical geodesics, limits, and hard triangles."""

from itertools import pairwise

import numpy as np
import pytest
from autograd import grad
from cases import open_template, sphere_template, surfaces

from riemhuman.errors import NotDefinedError
from riemhuman.geometry import AlignedSurfaces, GeneralElasticMetric
from riemhuman.kernels import surface
from riemhuman.terms import (
    ConeTerm,
    _cone_geodesics,
)

WEIGHTS = [(1.0, 1.0, 1.0), (1.0, 1e-3, 0.01), (0.0, 0.3, 1.0), (2.0, 0.05, 3.0)]


def fields_of(triangle, term):
    """Return the fields of a triangle, given by f_u and f_v."""
    return term.fields(surface.follow_up(*triangle[:, None]))


def squared_dist(one, other, *weights):
    term = ConeTerm(1.0, *weights)
    return term.squared_dist(fields_of(one, term), fields_of(other, term))[0]


def rotation_about_x(angle):
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0], [0, cosine, -sine], [0, sine, cosine]])


def random_triangles(n, rng):
    return np.eye(2, 3) + 0.35 * rng.standard_normal((n, 2, 2, 3))


@pytest.mark.parametrize("weights", WEIGHTS)
def test_equal_antipodal_and_degenerate_triangles(weights):
    one = np.array([[1.0, 0.2, 0.1], [0.3, 1.0, -0.2]])
    assert squared_dist(one, one, *weights) == 0.0
    slope = grad(lambda f: squared_dist(one, f, *weights))
    np.testing.assert_array_equal(slope(one), 0.0)
    antipodal, far = one[::-1].copy(), np.diag([1.0, 1e9]) @ one @ rotation_about_x(3.0)
    flat = np.array([one[0], 2 * one[0]])
    for other in (antipodal, far, flat):
        assert np.isfinite(squared_dist(one, other, *weights))
        assert np.isfinite(slope(other)).all()
    # Through the apex: ψ ≥ π, or no area at all.
    b, area = weights[1], np.linalg.norm(np.cross(*one))
    assert squared_dist(one, flat, *weights) == pytest.approx(16 * b * area)
    if weights[0] > 0:
        through = 16 * b * (np.sqrt(area) + np.sqrt(np.linalg.norm(np.cross(*far)))) ** 2
        assert squared_dist(one, far, *weights) == pytest.approx(through)


@pytest.mark.parametrize("weights", WEIGHTS)
def test_minimal_paths_of_fields(weights):
    """Exponential, logarithm and geodesic."""
    term, rng = ConeTerm(1.0, *weights), np.random.default_rng(9)
    pairs = random_triangles(50, rng)
    pairs[:, 1] = pairs[:, 0] + (pairs[:, 1] - pairs[:, 0]) / max(1.0, 30 * weights[0])
    firsts = [surface.follow_up(*np.swapaxes(pairs[:, k], 0, 1)) for k in (0, 1)]
    (g1, n1), (g2, n2) = (
        (surface.first_fundamental_form(d.f_u, d.f_v), surface.unit_normals(d.f_u, d.f_v))
        for d in firsts
    )
    velocity, psi = _cone_geodesics.log((g1, n1), (g2, n2), term)
    inside = psi < np.pi
    assert inside.sum() > 5
    (g, n), met_apex = _cone_geodesics.exp(velocity, (g1, n1), term)
    assert not met_apex[inside].any()
    np.testing.assert_allclose(g[inside], g2[inside], rtol=1e-9, atol=1e-11)
    np.testing.assert_allclose(n[inside], n2[inside], atol=1e-11)
    squared = term.squared_dist(term.fields(firsts[0]), term.fields(firsts[1]))

    def energy(paths):
        fields = [(*_cone_geodesics.coordinates(g), n) for g, n in paths]
        parts = [term.squared_dist(*pair) for pair in pairwise(fields)]
        return (len(paths) - 1) * sum(parts)

    for n_segments in (2, 5):
        times = np.linspace(0, 1, n_segments + 1)
        path = [_cone_geodesics.geodesic((g1, n1), (g2, n2), np.array(t), term) for t in times]
        np.testing.assert_allclose(energy(path), squared, rtol=1e-8, atol=1e-12)


CHARTED = [*WEIGHTS, (1.0, 0.01, 0.0)]


@pytest.mark.parametrize("weights", CHARTED)
def test_the_chart_never_lengthens(weights):
    term, rng = ConeTerm(1.0, *weights), np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-5.0, 0.0, 200)
    first, second = rng.uniform(-3.0, 3.0, (2, 6, 200))

    def fields(numbers):
        x, log_y, log_s = numbers[:3]
        n = numbers[3:].T + [0.1, 0.0, 5e-8]
        return x, np.exp(log_y), np.exp(log_s), n / np.linalg.norm(n, axis=1, keepdims=True)

    pair = fields(first), fields(first + sizes * second)
    charts = [term.chart(one) for one in pair]
    rounding = 1e-11 * sum(np.linalg.norm(chart, axis=1) for chart in charts)
    exact = np.sqrt(term.squared_dist(*pair))
    gaps = np.linalg.norm(charts[0] - charts[1], axis=1)
    assert np.all(gaps <= exact * (1 + 1e-12) + rounding)


@pytest.mark.parametrize("weights", [*WEIGHTS, (0.0, 1.0, 0.0), (1.0, 1.0, 0.0)])
def test_the_chart_is_tight_for_near_surfaces(weights):
    template, term = sphere_template(), ConeTerm(1.0, *weights)
    f = template.vertices + 1e-4 * surfaces(template, 2, rng=1)
    near = [term.fields(surface.derivatives(one, template.differential_operator)) for one in f]
    exact = np.sum(term.squared_dist(*near))
    bound = np.sum((term.chart(near[0]) - term.chart(near[1])) ** 2)
    assert 0.99 * exact < bound <= exact


def test_which_cones_have_a_space_of_fields():
    """Without normals and stretching, areas alone are left, which make no manifold with exp."""
    space = AlignedSurfaces(open_template())
    for weights in ((1.0, 1.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 1.0)):
        assert GeneralElasticMetric(space, *weights).has_target_metric
    metric = GeneralElasticMetric(space, 0.0, 1.0, 0.0)
    assert not metric.has_target_metric
    with pytest.raises(NotDefinedError, match="the fields of ConeTerm have no manifold"):
        _ = metric.target_metric
