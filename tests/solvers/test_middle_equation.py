"""The discrete geodesic equation, against closed forms and its own definition."""

import numpy as np
import pytest
from cases import CASES, cases_that, name_of
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError
from riemhuman.solvers.middle_equation import MiddleEquation, degeneration, vanishing

FIELDS = [case for case in cases_that("dist", "exp") if "product" not in case.name]
OTHERS = [CASES[name] for name in ("mixed sphere", "all open", "srnf open", "half-plane, distance")]


def near(case):
    """Return a point and one not far from it."""
    point, other = case.points[:2]
    return point, case.space.regularize(point + 0.1 * (other - point))


def stationarity(metric, points):
    """Return the gradient of the energy by the middle point, tangent part."""
    _, gradient = metric.energy_and_gradient(points)
    return metric.space.to_tangent(gradient[1], points[1])


@pytest.mark.parametrize("case", FIELDS + OTHERS, ids=name_of)
def test_all_three_solve_the_equation(case):
    equation = MiddleEquation(case.metric, tolerance=1e-10)
    point, other = near(case)
    step = case.space.to_tangent(other - point, point)
    found = [
        equation.next_point(point, other),
        equation.both_sides(point, step),
        equation.middle_point(point, other),
    ]
    size = np.abs(case.metric.energy_and_gradient(np.stack([point, other]))[1]).max()
    for triple in found:
        assert triple.converged
        assert triple.error <= 1e-10
        assert np.all(case.space.belongs(triple.points))
        assert np.abs(stationarity(case.metric, triple.points)).max() < 1e-6 * size


@pytest.mark.parametrize("case", FIELDS + OTHERS, ids=name_of)
def test_the_derivative_is_nearly_the_identity(case):
    """In preconditioned variables one step takes away all but a few hundredths of the error."""
    point, other = case.points[:2]
    other = case.space.regularize(point + 0.02 * (other - point))
    step = case.space.to_tangent(other - point, point)
    for method, arguments in (
        ("next_point", (point, other)),
        ("both_sides", (point, step)),
        ("middle_point", (point, other)),
    ):
        before, after = (
            getattr(MiddleEquation(case.metric, tolerance=1e-14, max_iterations=count), method)(
                *arguments
            ).error
            for count in (0, 1)
        )
        assert after <= 0.03 * before + 1e-12


@pytest.mark.parametrize("case", FIELDS + OTHERS, ids=name_of)
def test_the_points_found_are_those_asked_for(case):
    equation = MiddleEquation(case.metric, tolerance=1e-10)
    point, other = case.points[:2]
    other = case.space.regularize(point + 0.02 * (other - point))
    step = case.space.to_tangent(other - point, point)
    size = np.abs(step).max()
    ahead = equation.next_point(point, other).points
    np.testing.assert_array_equal(ahead[:2], [point, other])
    np.testing.assert_allclose(ahead[2] - other, other - point, atol=0.1 * size)
    sides = equation.both_sides(point, step).points
    np.testing.assert_array_equal(sides[1], point)
    np.testing.assert_allclose(0.5 * (sides[2] - sides[0]), step, atol=0.01 * size)
    between = equation.middle_point(point, other).points
    np.testing.assert_array_equal(between[[0, 2]], [point, other])
    np.testing.assert_allclose(between[1], 0.5 * (point + other), atol=0.05 * size)


@pytest.mark.parametrize("case", FIELDS, ids=name_of)
def test_follows_closed_form_geodesics(case):
    """On a geodesic every point is halfway between its neighbours, at any distance."""
    start, end = case.points[:2]
    path = case.metric.geodesic(start, end_point=end)(np.linspace(0, 1, 5))
    equation = MiddleEquation(case.metric, tolerance=1e-10)
    size = np.abs(path[2] - path[1]).max()
    after = equation.next_point(path[1], path[2]).points[2]
    np.testing.assert_allclose(after, path[3], atol=1e-6 * size)
    middle = equation.middle_point(path[1], path[3]).points[1]
    np.testing.assert_allclose(middle, path[2], atol=1e-6 * size)


def test_unseen_displacements_cost_nothing():
    case = CASES["mixed sphere"]
    shift = np.array([0.3, 0.0, -0.1]) + np.zeros(case.space.shape)
    equation = MiddleEquation(case.metric)
    triple = equation.both_sides(case.points[0], shift)
    assert triple.converged
    np.testing.assert_allclose(triple.points[2] - triple.points[1], shift, atol=1e-6)
    resting = equation.next_point(case.points[0], case.points[0])
    assert resting.converged
    np.testing.assert_allclose(resting.points[2], case.points[0], atol=1e-9)


def test_basis_must_fit():
    class Basis:
        flat = np.eye(4)

    case = CASES["mixed sphere"]
    with pytest.raises(ArgumentError, match="basis must hold vectors of 126 numbers"):
        MiddleEquation(case.metric, Basis()).next_point(*near(case))


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


def test_vanishing_triangles_are_told():
    case = CASES["all sphere"]
    point = case.points[0]
    assert vanishing(case.metric, point, 0.9 * point) == ""
    told = vanishing(case.metric, point, 0.4 * point)
    assert "degenerates: one step left 16% of its area" in told
    assert vanishing(CASES["ebin 1 sphere"].metric, point, point) == ""


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


def test_the_triangle_that_vanishes_is_named():
    case = CASES["mixed open"]
    point = case.points[0]
    triangle, (one, _, three) = corner_triangle(case.space.template)
    for share, told in ((0.51, ""), (0.49, f"triangle {triangle} degenerates: one step left 49%")):
        shrunk = point.copy()
        shrunk[three] = point[one] + share * (point[three] - point[one])
        found = vanishing(case.metric, point, shrunk)
        assert found.startswith(told)
        assert bool(found) == bool(told)
