"""Multiples of metrics."""

import numpy as np
import pytest
from cases import CASES, KINDS, name_of

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import VectorSpace
from riemhuman.geometry.metric import RiemannianMetric, ScalarProductMetric
from riemhuman.solvers import PathStraightening
from riemhuman.testing import check_metric

every_case = pytest.mark.parametrize("case", KINDS, ids=name_of)


@every_case
def test_multiples_of_every_metric(case):
    metric, double = case.metric, 4.0 * case.metric
    (x, y), v, path = case.points[:2], 0.1 * case.tangent_vecs[0], case.points
    w = case.space.to_tangent(case.tangent_vecs[1], x)
    # By which factor the results of each call grow.
    calls = [("inner_product", (v, w, x), 4.0), ("norm", (v, x), 2.0), ("covector", (v, x), 4.0)]
    calls += [("energy", (path,), 4.0), ("length", (path,), 2.0), ("remove_drift", (path,), 1.0)]
    calls += [("gram_matrix", (case.tangent_vecs[:2], x), 4.0)]
    if metric.has_target_metric:
        calls += [("map", (x,), 1.0), ("differential", (v, x), 1.0)]
    if metric.has_closed_form_dist:
        calls += [("dist", (x, y), 2.0), ("dist_pairwise", (path,), 2.0)]
    if "exp" in case.can:
        calls += [("exp", (v, x), 1.0), ("log", (y, x), 1.0), ("injectivity_radius", (x,), 2.0)]
        calls += [("parallel_transport", (w, x, v), 1.0), ("sectional_curvature", (v, w, x), 0.25)]
        np.testing.assert_array_equal(double.geodesic(x, y)(0.3), metric.geodesic(x, y)(0.3))
    for name, arguments, factor in calls:
        found, expected = (getattr(one, name)(*arguments) for one in (double, metric))
        np.testing.assert_allclose(found, factor * expected, rtol=1e-12, err_msg=name)
    gradients = [one.energy_and_gradient(path)[1] for one in (double, metric)]
    np.testing.assert_allclose(gradients[0], 4.0 * gradients[1])
    for name in dir(RiemannianMetric):
        if name.startswith(("is_", "has_")):
            assert getattr(double, name) == getattr(metric, name)
    if metric.has_target_metric:
        squared = double.target_metric.squared_norm(double.differential(v, x), double.map(x))
        np.testing.assert_allclose(squared, double.squared_norm(v, x))


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


def test_texts_name_the_metric():
    metric = VectorSpace((3,)).metric
    assert repr(2.0 * metric) == f"2.0 * {metric!r}"
