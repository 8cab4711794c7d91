"""What makes two arrays a mesh, and where two triangulations differ."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.surfaces.mesh_arrays import face_difference, mesh_arrays


def test_flat_and_folded_triangles_are_a_mesh():
    vertices, faces = mesh_arrays([[0, 0, 0], [1, 1, 1]], [[0, 1, 1], [0.0, 0.0, 0.0]])
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    np.testing.assert_array_equal(faces, [[0, 1, 1], [0, 0, 0]])


def test_arguments_go_by_the_names_given():
    with pytest.raises(ArgumentError, match=r"f\[1\] = \(0, 0, 9\) \(and 1 more\).*v holds 2"):
        mesh_arrays(np.zeros((2, 3)), [[0, 0, 1], [0, 0, 9], [-1, 0, 0]], names=("v", "f"))


def test_face_difference():
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    assert face_difference(faces, faces.copy()) is None
    assert face_difference(faces[:1], faces) == "1 triangles found, 2 expected"
    assert face_difference(faces[:, [1, 2, 0]] * [[1], [0]] + faces * [[0], [1]], faces) == (
        "1 of 2 triangles differ, the first at index 0: (1, 2, 0) found, (0, 1, 2) expected"
    )
