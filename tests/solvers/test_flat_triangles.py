"""Flat triangles: an inverse Hessian that freezes them is the one of the motions that are left."""

import numpy as np
import pytest
from scipy import linalg

from riemhuman.geometry import AlignedSurfaces
from riemhuman.solvers import path_straightening
from riemhuman.solvers.path_straightening import freeze_flat_triangles, lift_flat_triangles
from riemhuman.surfaces.template import Template

FACES = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4], [4, 1, 0]])


def nodes(*flat, height=1e-8):
    """Return three surfaces of four triangles; the tip of some is moved onto their longest edge.

    Of a pair (node, triangle) the second corner of the triangle is the tip.
    """
    points = np.random.default_rng(5).normal(size=(3, 5, 3))
    for node, triangle in flat:
        first, tip, last = FACES[triangle]
        ends = points[node, [first, last]]
        away = np.cross(ends[1] - ends[0], [0.0, 0.0, 1.0])
        points[node, tip] = 0.3 * ends[0] + 0.7 * ends[1] + height * away
    return points


def operator(size=45, seed=6):
    """Return a symmetric positive operator on all coordinates, and its matrix."""
    root = np.random.default_rng(seed).normal(size=(size, size))
    matrix = root @ root.T + np.eye(size)
    return (lambda slope: matrix @ slope), matrix


def flatness(points, node, triangle):
    """Return the shortest height of a triangle."""
    one, two, three = points[node, FACES[triangle]]
    area = np.linalg.norm(np.cross(two - one, three - one))
    return area / max(
        np.linalg.norm(one - two), np.linalg.norm(two - three), np.linalg.norm(three - one)
    )


def test_where_no_triangle_is_flat_nothing_is_frozen():
    inverse, _ = operator()
    points = nodes()
    assert freeze_flat_triangles(inverse, points, FACES) is inverse
    # Small triangles of good shape are not flat.
    assert freeze_flat_triangles(inverse, 1e-9 * points, FACES) is inverse


@pytest.mark.parametrize("flat", [[(0, 1)], [(2, 3)], [(0, 0), (1, 2), (2, 1)]])
def test_the_operator_is_the_inverse_of_the_hessian_on_the_motions_left(flat):
    inverse, matrix = operator()
    points = nodes(*flat)
    frozen = freeze_flat_triangles(inverse, points, FACES)
    found = np.column_stack([frozen(slope) for slope in np.eye(45)])
    rows = []
    for node, triangle in flat:
        first, tip, last = FACES[triangle]
        for axis in range(3):
            row = np.zeros(points.shape)
            row[node, [tip, first, last], axis] = 1.0, -0.3, -0.7
            rows.append(row.ravel())
    left = linalg.null_space(np.array(rows))
    expected = left @ np.linalg.inv(left.T @ np.linalg.inv(matrix) @ left) @ left.T
    np.testing.assert_allclose(found, expected, atol=1e-6 * np.abs(expected).max())
    # Such motions leave the heights, and change the area to second order alone.
    motion = frozen(np.random.default_rng(7).normal(size=45)).reshape(points.shape)
    moved = points + 1e-3 * motion / np.abs(motion).max()
    for node, triangle in flat:
        assert flatness(moved, node, triangle) == pytest.approx(
            flatness(points, node, triangle), rel=1e-2
        )


def test_conditions_that_depend_on_each_other_are_frozen_together():
    """Both triangles at an edge are flat, all four corners on one line."""
    inverse, _ = operator()
    points = nodes()
    points[1, 1] = 0.4 * points[1, 0] + 0.6 * points[1, 2]
    points[1, 3] = 0.5 * points[1, 1] + 0.5 * points[1, 2]
    points[1, 4] = 0.5 * points[1, 1] + 0.5 * points[1, 3]
    frozen = freeze_flat_triangles(inverse, points, FACES)
    motion = frozen(np.random.default_rng(8).normal(size=45)).reshape(points.shape)[1]
    np.testing.assert_allclose(motion[1], 0.4 * motion[0] + 0.6 * motion[2], atol=1e-9)
    np.testing.assert_allclose(motion[3], 0.5 * motion[1] + 0.5 * motion[2], atol=1e-9)
    assert np.abs(motion[0] - motion[2]).max() > 1e-3


def test_the_flattest_are_frozen_first(monkeypatch):
    monkeypatch.setattr(path_straightening, "_MOST_FROZEN", 1)
    inverse, _ = operator()
    points = nodes((0, 1), (2, 3), height=1e-8)
    less_flat = nodes((2, 3), height=1e-7)[2]
    points[2] = less_flat
    motion = freeze_flat_triangles(inverse, points, FACES)(np.random.default_rng(9).normal(size=45))
    motion = motion.reshape(points.shape)
    first, tip, last = FACES[1]
    left = motion[0, tip] - 0.3 * motion[0, first] - 0.7 * motion[0, last]
    assert np.abs(left).max() < 1e-6 * np.abs(motion).max()
    first, tip, last = FACES[3]
    left = motion[2, tip] - 0.3 * motion[2, first] - 0.7 * motion[2, last]
    assert np.abs(left).max() > 1e-3 * np.abs(motion).max()


@pytest.mark.parametrize("share", [1e-7, 1e-4, 1e-3])
def test_triangles_without_area_are_lifted_and_others_stay(share):
    """However far below the bound rounding has taken them."""
    template = Template(nodes()[0], FACES)
    space = AlignedSurfaces(template, equip=False)
    points = nodes((0, 1), (2, 3), height=1e-3)
    for node, triangle in ((0, 1), (2, 3)):
        first, tip, last = FACES[triangle]
        foot = 0.3 * points[node, first] + 0.7 * points[node, last]
        over = points[node, tip] - foot
        high, low = 1.0, 0.0
        for _ in range(80):  # to the bound by halving
            middle = 0.5 * (high + low)
            points[node, tip] = foot + middle * over
            high, low = (middle, low) if space.belongs(points)[node] else (high, middle)
        points[node, tip] = foot + (1.0 - share) * high * over
    np.testing.assert_array_equal(space.belongs(points), [False, True, False])
    higher = lift_flat_triangles(points, template)
    assert np.all(space.belongs(higher))
    np.testing.assert_array_equal(higher[1], points[1])
    assert np.count_nonzero(np.any(higher != points, axis=-1)) == 2
    assert np.abs(higher - points).max() < 1e-9
    np.testing.assert_array_equal(lift_flat_triangles(higher, template), higher)
