"""What makes two arrays a mesh, and where two triangulations differ."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import check_mesh, face_difference, split_polygons


def test_flat_and_folded_triangles_are_a_mesh():
    vertices, faces = check_mesh([[0, 0, 0], [1, 1, 1]], [[0, 1, 1], [0.0, 0.0, 0.0]])
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    np.testing.assert_array_equal(faces, [[0, 1, 1], [0, 0, 0]])


def test_arguments_go_by_the_names_given():
    with pytest.raises(ArgumentError, match=r"f\[1\] = \(0, 0, 9\) \(and 1 more\).*v holds 2"):
        check_mesh(np.zeros((2, 3)), [[0, 0, 1], [0, 0, 9], [-1, 0, 0]], names=("v", "f"))


FACES = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]])


@pytest.mark.parametrize(
    ("found", "difference"),
    [
        (FACES[:1], "1 triangles found, 3 expected"),
        (FACES[[0, 1, 1]], "1 of 3 triangles differ, the first at index 2: (2, 1, 3) found"),
        (FACES[:, [1, 2, 0]], "the corners of all triangles begin at another vertex, the first"),
        (FACES[:, ::-1], "all triangles are flipped, inside out, the first at index 0: (2, 1, 0)"),
        (
            np.concatenate([FACES[:1], FACES[1:, [0, 2, 1]]]),
            "2 of 3 triangles are flipped, inside out, the first at index 1: (2, 3, 1) found",
        ),
        (FACES[[2, 1, 0]], "the triangles are the same in another order, the first at index 0"),
    ],
)
def test_where_triangulations_differ(found, difference):
    assert face_difference(FACES, FACES.copy()) is None
    assert face_difference(found, FACES).startswith(difference)


def test_polygons_are_split_by_the_order_of_their_corners():
    corners = np.array([4, 5, 6, 7, 2, 1, 0, 0, 1, 2, 3, 4])
    assert split_polygons(corners, np.array([4, 3, 5])).tolist() == [
        [4, 5, 6], [4, 6, 7], [2, 1, 0], [0, 1, 2], [0, 2, 3], [0, 3, 4],
    ]  # fmt: skip
    assert split_polygons(corners[:0], corners[:0]).shape == (0, 3)
    for few in ([3, 2, 7], [3, 0, 9]):
        with pytest.raises(ArgumentError, match=f"1 of 3 have fewer, .*index 1 with {few[1]}"):
            split_polygons(corners, np.array(few))
