"""Checks of triangles, and pairs of numbers."""

import numpy as np
import pytest

from riemhuman.errors import ArgumentError
from riemhuman.io.mesh_arrays import (
    check_mesh,
    distinct_pairs,
    face_difference,
)


def test_checks_of_meshes():
    vertices, faces = check_mesh([[0, 0, 0], [1, 1, 1]], [[0, 1, 1], [0.0, 0.0, 0.0]])
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    with pytest.raises(ArgumentError, match=r"faces\[1\] = \(0, 0, 9\) \(and 1 more\).* holds 2"):
        check_mesh(np.zeros((2, 3)), [[0, 0, 1], [0, 0, 9], [-1, 0, 0]])


def test_distinct_pairs_are_those_of_numpy():
    pairs = np.random.default_rng(0).integers(0, 7, (40, 2))
    edges, counts = np.unique(pairs, axis=0, return_counts=True)
    found, places, found_counts = distinct_pairs(pairs)
    assert np.array_equal(found, edges)
    assert np.array_equal(found_counts, counts)
    assert np.array_equal(found[places], pairs)
    assert [len(part) for part in distinct_pairs(pairs[:0])] == [0, 0, 0]


def test_differences_of_triangulations():
    faces = np.array([[0, 1, 2], [1, 2, 3]])
    assert face_difference(faces, faces) is None
    assert face_difference(faces[:1], faces) == "1 triangles found, 2 expected"
    assert face_difference(faces, faces[:1]) == "2 triangles found, 1 expected"
    said = face_difference(faces[::-1], faces)
    assert said.startswith("all triangles or their corners are listed in another order, the first")
    said = face_difference(np.array([[0, 1, 2], [1, 2, 4]]), faces)
    assert said.endswith("differ, the first at index 1: (1, 2, 4) found, (1, 2, 3) expected")
