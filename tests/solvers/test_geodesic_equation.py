"""The discrete geodesic equation, against closed forms and its own definition."""

from __future__ import annotations

import numpy as np
import pytest
from cases import CASES, cases_that, name_of
from scipy.spatial.transform import Rotation

from riemhuman.geometry import ElasticMetric
from riemhuman.solvers._geodesic_equation import (
    GeodesicEquation,
    degeneration,
    find_root,
    has_long_step,
)

FIELDS = [case for case in cases_that("dist", "exp") if "product" not in case.name]
OTHERS = [CASES[name] for name in ("mixed sphere", "all open", "srnf open", "half-plane, distance")]


def near(case):
    """Return a point and one not far from it."""
    point, other = case.points[:2]
    return point, case.space.projection(point + 0.1 * (other - point))


def stationarity(metric, points):
    """Return the gradient of the energy by the middle point, tangent part."""
    _, gradient = metric.energy_and_gradient(points)
    return metric.space.to_tangent(gradient[1], points[1])


@pytest.mark.everyday(
    "ebin 0.0001 sphere",
    "normals triangle",
    "rotations triangle",
    "all open",
    "half-plane, distance",
)
@pytest.mark.parametrize("case", FIELDS + OTHERS, ids=name_of)
def test_all_three_solve_the_equation(case):
    equation = GeodesicEquation(case.metric, tolerance=1e-10)
    point, other = near(case)
    step = case.space.to_tangent(other - point, point)
    found = [
        equation.next_point(point, other),
        equation.both_sides(point, step),
        equation.middle_point(point, other),
    ]
    size = np.abs(case.metric.energy_and_gradient(np.stack([point, other]))[1]).max()
    for triple in found:
        assert triple.error <= 1e-10
        assert np.all(case.space.belongs(triple.points))
        assert np.abs(stationarity(case.metric, triple.points)).max() < 1e-6 * size


@pytest.mark.everyday("ebin 0.05 sphere", "normals sphere", "rotations sphere", "flat")
@pytest.mark.parametrize("case", FIELDS, ids=name_of)
def test_follows_closed_form_geodesics(case):
    """On a geodesic every point is halfway between its neighbours, at any distance."""
    start, end = case.points[:2]
    path = case.metric.geodesic(start, end_point=end)(np.linspace(0, 1, 5))
    equation = GeodesicEquation(case.metric, tolerance=1e-10)
    size = np.abs(path[2] - path[1]).max()
    after = equation.next_point(path[1], path[2]).points[2]
    np.testing.assert_allclose(after, path[3], atol=1e-6 * size)
    middle = equation.middle_point(path[1], path[3]).points[1]
    np.testing.assert_allclose(middle, path[2], atol=1e-6 * size)


def test_degenerate_points_are_told():
    case = CASES["mixed open"]
    point = case.points[0]
    assert degeneration(case.metric, point, case.points[0]) == ""
    assert "not finite" in degeneration(case.metric, point, np.nan * point)
    flat = point.copy()
    flat[case.space.template.faces[3]] = flat[case.space.template.faces[3, 0]]
    assert "every triangle" in degeneration(case.metric, point, flat)
    mirrored = point * [-1.0, 1.0, 1.0]
    assert "its normal has turned over" in degeneration(case.metric, point, mirrored)
    fields = CASES["ebin 1 sphere"]
    assert "positive semidefinite" in degeneration(
        fields.metric, fields.points[0], -fields.points[0]
    )
    plane = CASES["half-plane, distance"]
    assert "leaves the manifold" in degeneration(
        plane.metric, plane.points[0], np.array([0.0, -1.0])
    )


def corner_triangle(template):
    """Return a triangle whose last corner is in no other, and its corners in that order."""
    counts = np.bincount(template.faces.ravel())
    triangle = int(np.flatnonzero((counts[template.faces] == 1).any(axis=1))[-1])
    corners = template.faces[triangle]
    first = int(np.argmin(counts[corners]))
    return triangle, np.roll(corners, 2 - first)


def test_the_triangle_that_turns_over_is_named():
    case = CASES["mixed open"]
    point = case.points[0]
    triangle, (one, two, three) = corner_triangle(case.space.template)
    assert triangle > 0
    axis = (point[two] - point[one]) / np.linalg.norm(point[two] - point[one])
    for degrees, told in ((119.0, ""), (121.0, f"triangle {triangle} degenerates")):
        folded = point.copy()
        turn = Rotation.from_rotvec(np.radians(degrees) * axis)
        folded[three] = point[one] + turn.apply(point[three] - point[one])
        found = degeneration(case.metric, point, folded)
        assert found.startswith(told)
        assert bool(found) == bool(told)


def test_rotations_by_more_than_60_degrees_within_one_step_are_long():
    case = CASES["mixed triangle"]
    metric, point = ElasticMetric(case.space, 0.0, 0.0, 1.0), case.points[0]
    axis = point[1] - point[0]
    axis /= np.linalg.norm(axis)

    def path(*degrees):
        rotations = Rotation.from_rotvec(np.radians(degrees)[:, None] * axis).as_matrix()
        return point @ np.swapaxes(rotations, -1, -2)

    assert not has_long_step(metric, path(0, 59, 118), all_coordinates=True)
    assert has_long_step(metric, path(0, 59, 120), all_coordinates=True)
    assert not has_long_step(metric, path(0, 59, 120), all_coordinates=False)
    others = CASES["half-plane, distance"].metric
    assert not has_long_step(others, np.ones((2, 2)), all_coordinates=True)


def test_steps_whose_distance_saturates_are_long():
    """At λ = 1e-4 that is where a triangle is stretched by more than some twelve per cent."""
    case = CASES["mixed triangle"]
    metric, point = ElasticMetric(case.space, 1.0, 1e-4, 0.0), case.points[0]
    for stretch, is_long in ((1.02, False), (1.3, True)):
        path = np.stack([point, point * [stretch, 1.0, 1.0 / stretch]])
        assert has_long_step(metric, path, all_coordinates=False) == is_long


def euclidean(function):
    """Return a function with its values twice: lengths by the identity."""

    def both(x):
        value = function(x)
        return None if value is None else (value, value)

    return both


def test_steps_that_leave_the_domain_or_enlarge_the_residual_are_halved():
    inside = euclidean(lambda x: None if abs(x[0]) > 1.0 else 3.0 * (x - 0.9))
    result = find_root(inside, np.zeros(1), tolerance=1e-9, max_iter=50)
    np.testing.assert_allclose(result.x, 0.9, rtol=1e-8)
    assert find_root(inside, np.full(1, 2.0), tolerance=1e-9, max_iter=5) == (2.0, np.inf, 0, 1)
    at_start = euclidean(lambda x: np.ones(1) if x[0] == 0.0 else None)
    result = find_root(at_start, np.zeros(1), tolerance=1e-9, max_iter=9)
    assert result == (0.0, 1.0, 0, 9)
    # From 0 a whole step leads to the slope, where the residual is slope − 1 times that at 0.
    for slope, halved in ((2.9, False), (3.1, True)):
        xs = []
        function = euclidean(lambda x: xs.append(x[0]) or slope * (x - 1.0))  # noqa: B023
        find_root(function, np.zeros(1), tolerance=1e-9, max_iter=1)
        np.testing.assert_allclose(xs, [0.0, slope, 0.5 * slope] if halved else [0.0, slope])
