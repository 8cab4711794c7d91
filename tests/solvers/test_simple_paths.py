"""Paths without optimisation, and the checks that all path solvers share."""

import numpy as np
import pytest
from cases import CASES, cases_that, name_of

from riemhuman.errors import ArgumentError, ArgumentTypeError, NotDefinedError
from riemhuman.solvers.paths import (
    ClosedFormGeodesic,
    LinearPath,
    check_end_points,
    check_initial_path,
    linear_path,
    lower_bound,
)


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_linear_path(case):
    start, end = case.points[:2]
    result = LinearPath(n_nodes=5).solve(case.metric, start, end)
    assert result.path.shape == (5, *case.space.shape)
    np.testing.assert_array_equal(result.path[[0, -1]], case.points[:2])
    assert np.all(case.space.belongs(result.path))
    middle = case.space.projection(0.5 * (start + end))
    np.testing.assert_allclose(result.path[2], middle, atol=1e-14)
    assert result.energy == case.metric.energy(result.path)
    np.testing.assert_array_equal(result.energies, [result.energy])
    assert (result.n_iterations, result.n_evaluations, result.converged) == (0, 1, True)


def check_geodesic(solver, case):
    start, end = case.points[:2]
    result = solver.solve(case.metric, start, end)
    np.testing.assert_allclose(result.energy, case.metric.squared_dist(start, end), rtol=1e-10)
    steps = case.metric.dist(result.path[:-1], result.path[1:])
    np.testing.assert_allclose(steps, steps[0], rtol=1e-6)
    np.testing.assert_allclose(result.path[[0, -1]], case.points[:2], atol=1e-12)


@pytest.mark.parametrize("case", cases_that("dist", "geodesic"), ids=name_of)
def test_closed_form_geodesics_have_constant_speed_and_least_energy(case):
    check_geodesic(ClosedFormGeodesic(n_nodes=6), case)


def test_straight_paths_are_no_geodesics():
    with pytest.raises(AssertionError):
        check_geodesic(LinearPath(n_nodes=6), CASES["normals sphere"])


@pytest.mark.parametrize(
    "case", [case for case in CASES.values() if "geodesic" not in case.can], ids=name_of
)
def test_no_closed_form_is_said(case):
    with pytest.raises(NotDefinedError, match="no closed-form geodesics; use BasisPath or Path"):
        ClosedFormGeodesic().solve(case.metric, *case.points[:2])


def test_end_points_are_left_alone():
    case = CASES["mixed open"]
    start, end = case.points[0].copy(), case.points[1].copy()
    LinearPath().solve(case.metric, start, end)
    np.testing.assert_array_equal([start, end], case.points[:2])


def test_end_points_are_checked():
    metric, point = CASES["all triangle"].metric, CASES["all triangle"].points[0]
    start, end = check_end_points(metric, point.astype(np.float32), point.tolist())
    assert start.dtype == end.dtype == np.float64
    with pytest.raises(ArgumentError, match=r"start must have shape \(3, 3\); found \(4, 3\)"):
        check_end_points(metric, np.zeros((4, 3)), point)
    with pytest.raises(ArgumentError, match="end holds 9 NaN"):
        check_end_points(metric, point, np.nan * point)
    with pytest.raises(ArgumentTypeError, match="end must be an array of real numbers"):
        check_end_points(metric, point, "surface")


def test_linear_path_is_exact_at_its_ends():
    start, end = np.random.default_rng(0).standard_normal((2, 4))
    path = linear_path(start, end, 8)
    np.testing.assert_array_equal(path[[0, -1]], [start, end])
    np.testing.assert_allclose(np.diff(path, axis=0), (end - start) / 7 + np.zeros((7, 4)))


def test_initial_paths_are_checked():
    metric, (start, end) = CASES["all triangle"].metric, CASES["all triangle"].points[:2]
    path = linear_path(start, end, 5)
    np.testing.assert_array_equal(check_initial_path(metric, start, end, 5, path), path)
    np.testing.assert_array_equal(check_initial_path(metric, start, end, 5, path.tolist()), path)
    with pytest.raises(ArgumentError, match="n_nodes = 6 times; found 5"):
        check_initial_path(metric, start, end, 6, path)
    with pytest.raises(ArgumentError, match="run from start to end; its ends are off by up to "):
        check_initial_path(metric, start, end, 5, path + 0.5)
    with pytest.raises(ArgumentError, match="initial_path holds 45 NaN"):
        check_initial_path(metric, start, end, 5, np.nan * path)
    with pytest.raises(ArgumentError, match="initial_path must have shape"):
        check_initial_path(metric, start, end, 5, path[0])


@pytest.mark.parametrize("scale", [1e-4, 1e4])
@pytest.mark.parametrize("end_of_path", [0, -1])
def test_ends_of_initial_paths_may_be_off_by_rounding(scale, end_of_path):
    metric, points = CASES["all triangle"].metric, CASES["all triangle"].points
    start, end = scale * points[0], 2.0 * scale * points[1]
    path = linear_path(start, end, 5)
    size = max(np.abs(start).max(), np.abs(end).max())
    for share, legal in ((0.9e-9, True), (-0.9e-9, True), (1.1e-9, False), (-1.1e-9, False)):
        moved = path.copy()
        moved[end_of_path, 1, 2] += share * size
        if legal:
            check_initial_path(metric, start, end, 5, moved)
        else:
            with pytest.raises(ArgumentError, match=r"off by up to [1-9]"):
                check_initial_path(metric, start, end, 5, moved)


def test_the_lower_bound_of_a_path_is_that_of_its_ends():
    case = CASES["all sphere"]
    bent = case.points[[0, 2, 3, 1]]
    assert lower_bound(case.metric, bent) == case.metric.squared_dist(bent[0], bent[3])


def test_without_a_closed_form_the_lower_bound_is_zero():
    case = next(case for case in CASES.values() if not case.metric.has_closed_form_dist)
    assert not case.metric.has_closed_form_dist
    assert lower_bound(case.metric, case.points[:3]) == 0.0
