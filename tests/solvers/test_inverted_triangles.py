"""Triangles that are turned over are found, and no others."""

import numpy as np
import pytest
from cases import open_template, sphere_template
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.statistics import inverted_triangles

TEMPLATE = sphere_template(2)
VERTICES, FACES = TEMPLATE.vertices, TEMPLATE.faces


def folded_over_an_edge():
    """Return the sphere with one vertex moved beyond the triangles on its other side."""
    one, other = TEMPLATE.edges[0]
    folded = VERTICES.copy()
    folded[one] += 2.5 * (VERTICES[other] - VERTICES[one])
    return folded, one


def test_smooth_deformations_invert_nothing():
    bent = VERTICES + 0.2 * np.sin(2.0 * VERTICES[:, ::-1])
    stretched = VERTICES * [0.1, 3.0, 1.0]
    turned = VERTICES @ Rotation.from_euler("xyz", [170.0, 80.0, 10.0], degrees=True).as_matrix()
    found = inverted_triangles(np.stack([VERTICES, bent, stretched, turned]), VERTICES, FACES)
    assert found.shape == (4, len(FACES))
    assert not found.any()


def test_mirrored_triangles_agree_with_their_neighbourhood_or_not():
    # In a plane, orientation is the sign of the area.
    flat = open_template()
    folded = flat.vertices.copy()
    middle = 7
    folded[middle] = folded[middle] + 1.6 * (folded[middle + 1] - folded[middle])

    def signs(points):
        one, two, three = (points[corner] for corner in flat.faces.T)
        return np.sign(np.cross(two - one, three - one)[:, 2])

    expected = signs(folded) != signs(flat.vertices)
    assert expected.any()
    assert np.all(np.any(flat.faces[expected] == middle, axis=1))
    found = inverted_triangles(folded, flat.vertices, flat.faces)
    np.testing.assert_array_equal(found, expected)


def test_a_fold_is_found_where_it_is():
    folded, vertex = folded_over_an_edge()
    found = inverted_triangles(folded, VERTICES, FACES)
    assert found.any()
    assert np.any(FACES[found] == vertex, axis=1).all()
    moved = Rotation.from_euler("xyz", [10.0, 60.0, 130.0], degrees=True).apply(folded) + 3.0
    np.testing.assert_array_equal(inverted_triangles(moved, VERTICES, FACES), found)


def test_refusals():
    flat = VERTICES.copy()
    flat[FACES[3, 0]] = flat[FACES[3, 1]]
    with pytest.raises(DegenerateSurfaceError, match="reference must have an area.*triangle"):
        inverted_triangles(VERTICES, flat, FACES)
    assert inverted_triangles(flat, VERTICES, FACES)[3]
    with pytest.raises(ArgumentError, match="points must have shape"):
        inverted_triangles(VERTICES[:-1], VERTICES, FACES)
