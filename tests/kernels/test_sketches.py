"""Coordinates bound distances from below: the cone, fields over patches, and the metrics."""

import numpy as np
import pytest
from cases import TEMPLATES, sphere_template, surfaces
from hypothesis import given
from hypothesis import strategies as st

from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.srnf import SRNFMetric
from riemhuman.kernels import ebin
from riemhuman.kernels.sketches import cone_chart, patch_coordinates, triangle_patches

WEIGHTS = [(0.0, 0.0, 1.0), (1.0, 1e-4, 0.0), (1.0, 1.0, 0.0), (2.0, 0.05, 0.3)]


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
    exact = ebin.squared_dist_of_coordinates(*points, lam)[0]
    charts = [cone_chart(*point, lam) for point in points]
    # The rounding of the angles, which grow as 1/√λ, moves the chart by a share of its radius.
    rounding = 1e-12 * sum(np.linalg.norm(chart) for chart in charts) / min(1.0, np.sqrt(lam))
    assert np.linalg.norm(charts[0] - charts[1]) <= np.sqrt(exact) * (1 + 1e-12) + rounding


def test_cone_chart_is_tight_near_the_identity():
    rng = np.random.default_rng(0)
    x, log_y, s = 1e-4 * rng.standard_normal((3, 50, 2))
    points = [(x[:, k], np.exp(log_y[:, k]), 1 + s[:, k]) for k in (0, 1)]
    exact = ebin.squared_dist_of_coordinates(*points, 0.5)
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
    distances = ebin.hyperbolic_distance(ebin.excess(x, y, 0.0, 1.0))
    expected = np.sqrt(2.0) * ebin.angle_per_distance(lam) * distances
    np.testing.assert_allclose(lengths, expected, rtol=1e-12, atol=1e-15)


def test_cone_chart_sees_the_apex():
    apex = cone_chart(np.zeros(1), np.ones(1), np.zeros(1), 0.3)
    other = cone_chart(np.array([0.4]), np.array([2.0]), np.array([1.7]), 0.3)
    np.testing.assert_allclose(np.sum((apex - other) ** 2), 16 * 0.3 * 1.7**2)


def test_a_steeper_chart_is_no_bound():
    # The frequency √2 κ is the largest that Jensen's inequality allows.
    first = tuple(np.array([value]) for value in (0.0, 1.0, 1.0))
    second = tuple(np.array([value]) for value in (0.3, 1.3, 1.0))
    exact = ebin.squared_dist_of_coordinates(first, second, 0.5)
    # The same radius, and angles 1.1 times as large.
    charts = [1.1 * cone_chart(*point, 0.5 / 1.1**2) for point in (first, second)]
    assert np.sum((charts[0] - charts[1]) ** 2) > exact


@pytest.mark.parametrize("n_patches", [None, 1, 3, 7, 10_000])
def test_patches_bound_the_distance_of_fields(n_patches):
    template = sphere_template()
    patches = None
    if n_patches is not None:
        patches = triangle_patches(template.vertices, template.faces, n_patches)
    fields = np.random.default_rng(1).standard_normal((2, 5, template.n_faces, 3))
    fields[1, 0] = fields[0, 0]
    exact = np.sum((fields[0] - fields[1]) ** 2, axis=-1) @ template.face_areas
    first, second = patch_coordinates(fields, template.face_areas, patches)
    bound = np.sum((first - second) ** 2, axis=-1)
    assert np.all(bound <= exact * (1 + 1e-12))
    if n_patches is None or n_patches >= template.n_faces:
        np.testing.assert_allclose(bound, exact, rtol=1e-12)


def test_patches_by_hand():
    values = np.array([[1.0], [3.0], [10.0]])
    areas, patches = np.array([1.0, 3.0, 4.0]), np.array([1, 1, 0])
    # The patch of one triangle first; then mean 2.5 and rest sqrt(1 · 1.5² + 3 · 0.5²) = √3.
    expected = [2.0 * 10.0, 0.0, 2.0 * 2.5, np.sqrt(3.0)]
    np.testing.assert_allclose(patch_coordinates(values, areas, patches), expected)


def test_patches_may_have_any_numbers():
    values = np.random.default_rng(4).standard_normal((6, 3))
    areas, patches = np.arange(1.0, 7.0), np.array([0, 1, 0, 2, 2, 1])
    expected = patch_coordinates(values, areas, patches)
    for numbers in (patches + 1, patches + 2, 3 * patches + 4):
        np.testing.assert_array_equal(patch_coordinates(values, areas, numbers), expected)


def test_triangle_patches_are_even_and_in_one_piece():
    template = sphere_template(2)
    patches = triangle_patches(template.vertices, template.faces, 16)
    counts = np.bincount(patches)
    assert len(counts) == 16
    assert counts.max() <= counts.min() + 1
    centers = template.vertices[template.faces].mean(axis=1)
    spread = [np.ptp(centers[patches == patch], axis=0).max() for patch in range(16)]
    assert max(spread) < np.ptp(centers, axis=0).max()


def metrics():
    """Return metrics on surfaces over every template, by name."""
    found = {}
    for name, make_template in TEMPLATES.items():
        space = AlignedSurfaces(make_template(), equip=False)
        for weights in WEIGHTS:
            found[f"{name} {weights}"] = ElasticMetric(space, *weights)
        found[f"{name} srnf"] = SRNFMetric(space)
    return found


@pytest.mark.parametrize("n_patches", [None, 4])
@pytest.mark.parametrize("metric", metrics().values(), ids=metrics().keys())
def test_coordinates_bound_the_metric(metric, n_patches):
    template = metric.space.template
    points = np.concatenate([surfaces(template, 6, rng=3, size=size) for size in (0.01, 0.3, 0.8)])
    coordinates = metric.lower_bound_coordinates(points, n_patches)
    bound = np.linalg.norm(coordinates[:, None] - coordinates, axis=-1)
    exact = metric.dist_pairwise(points, precision="double")
    assert np.all(bound <= exact * (1 + 1e-9) + 1e-12)
    assert np.all(bound[~np.eye(len(points), dtype=bool)] > 0)
    np.testing.assert_array_equal(
        coordinates[2], metric.lower_bound_coordinates(points[2], n_patches)
    )
