"""Points that come as rows of numbers are the points, over the whole registry."""

import numpy as np
import pytest
from cases import CASES, KINDS, name_of

from riemhuman.errors import ArgumentError

WITH_ROWS = [case for case in KINDS if "dist" in case.can and len(case.space.shape) > 1]


@pytest.mark.parametrize("case", WITH_ROWS, ids=name_of)
def test_distances_of_rows(case):
    metric, points = case.metric, case.points
    rows = points.reshape(len(points), -1)
    np.testing.assert_array_equal(
        metric.dist(rows[0], rows[1:]), metric.dist(points[0], points[1:])
    )
    np.testing.assert_array_equal(metric.dist_pairwise(rows), metric.dist_pairwise(points))
    assert case.space.check_point(rows).shape == points.shape


def test_one_triangle_has_no_rows():
    """Three numbers may be a field of one normal, or a point that lacks an axis."""
    case = CASES["normals triangle"]
    with pytest.raises(ArgumentError, match=r"must have shape \(\.\.\., 1, 3\)"):
        case.space.check_point(case.points[:, 0])


def test_rows_of_another_length():
    case = CASES["mixed sphere"]
    with pytest.raises(
        ArgumentError, match=r"point must have shape \(\.\.\., 42, 3\); found \(2, 9\)"
    ):
        case.space.check_point(np.zeros((2, 9)))
