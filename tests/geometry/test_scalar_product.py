"""Multiples of metrics."""

import numpy as np
import pytest
from cases import CASES, KINDS, name_of

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry.metric import RiemannianMetric, ScalarProductMetric
from riemhuman.solvers import PathStraightening
from riemhuman.testing import check_metric

every_case = pytest.mark.parametrize("case", KINDS, ids=name_of)


@every_case
def test_multiples_of_every_metric(case):
    metric, double = case.metric, 4.0 * case.metric
    (x, y), v, w = case.points[:2], case.tangent_vecs[0], case.tangent_vecs[1]
    w = case.space.to_tangent(w, x)
    np.testing.assert_allclose(double.inner_product(v, w, x), 4.0 * metric.inner_product(v, w, x))
    np.testing.assert_allclose(double.norm(v, x), 2.0 * metric.norm(v, x))
    np.testing.assert_allclose(double.covector(v, x), 4.0 * metric.covector(v, x))
    path = case.points
    np.testing.assert_allclose(double.energy(path), 4.0 * metric.energy(path))
    np.testing.assert_allclose(double.length(path), 2.0 * metric.length(path))
    for found, expected in zip(
        double.energy_and_gradient(path), metric.energy_and_gradient(path), strict=True
    ):
        np.testing.assert_allclose(found, 4.0 * np.asarray(expected))
    gram = metric.gram_matrix(case.tangent_vecs[:2], x)
    np.testing.assert_allclose(double.gram_matrix(case.tangent_vecs[:2], x), 4.0 * gram)
    np.testing.assert_array_equal(double.remove_drift(path), metric.remove_drift(path))
    for name in ("dist", "geodesic", "transport"):
        assert getattr(double, f"has_closed_form_{name}") == (
            getattr(metric, f"has_closed_form_{name}")
        )
    for name in [name for name in dir(RiemannianMetric) if name.startswith("is_")]:
        assert getattr(double, name) == getattr(metric, name)
    assert double.has_inner_product == metric.has_inner_product
    assert double.has_target_metric == metric.has_target_metric
    if metric.has_target_metric:
        image, change = double.map(x), double.differential(v, x)
        np.testing.assert_array_equal(image, metric.map(x))
        squared = double.target_metric.squared_norm(change, image)
        np.testing.assert_allclose(squared, double.squared_norm(v, x))
    if metric.has_closed_form_dist:
        np.testing.assert_allclose(double.dist(x, y), 2.0 * metric.dist(x, y))
        np.testing.assert_allclose(
            double.dist_pairwise(path, precision="double"),
            2.0 * metric.dist_pairwise(path, precision="double"),
            rtol=1e-12,
        )
    if "exp" in case.can:
        v = 0.1 * v
        np.testing.assert_array_equal(double.exp(v, x), metric.exp(v, x))
        np.testing.assert_array_equal(double.log(y, x), metric.log(y, x))
        np.testing.assert_array_equal(double.geodesic(x, y)(0.3), metric.geodesic(x, y)(0.3))
        carried = double.parallel_transport(v, x, end_point=y)
        np.testing.assert_array_equal(carried, metric.parallel_transport(v, x, end_point=y))
        if case.name.startswith("rotations"):
            return
        curvature = metric.sectional_curvature(v, w, x)
        np.testing.assert_allclose(double.sectional_curvature(v, w, x), curvature / 4.0)
        radius = metric.injectivity_radius(x)
        np.testing.assert_allclose(double.injectivity_radius(x), 2.0 * radius)


@pytest.mark.parametrize("name", ["mixed triangle", "half-plane, inner product"])
def test_solvers_find_the_same_paths(name):
    case = CASES[name]
    solver = PathStraightening(5, tolerance=1e-9)
    path = solver.solve(case.metric, *case.points[:2])
    scaled = solver.solve(0.25 * case.metric, *case.points[:2])
    assert scaled.energy == pytest.approx(0.25 * path.energy, rel=1e-7)
    assert check_metric(case.metric * 3.0, case.points, case.tangent_vecs).passed


def test_multiples_of_multiples_and_bad_numbers():
    metric = CASES["mixed sphere"].metric
    multiple = 2.0 * metric * 3
    assert isinstance(multiple, ScalarProductMetric)
    x, y = CASES["mixed sphere"].points[:2]
    assert multiple.squared_dist(x, y) == pytest.approx(6.0 * float(metric.squared_dist(x, y)))
    for scale, error in ((0.0, ArgumentError), (-1.0, ArgumentError), ("two", ArgumentTypeError)):
        with pytest.raises(error, match="scale must be"):
            ScalarProductMetric(metric, scale)
