"""Areas, lengths and volumes against trimesh; adjacency of triangles."""

import numpy as np
import pytest
import trimesh
from cases import open_template, sphere_template, surfaces

from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.surfaces.measures import (
    adjacent_triangles,
    edge_lengths,
    find_inward_triangles,
    is_closed,
    signed_volume,
    triangle_areas,
)


def test_measures_agree_with_trimesh():
    template = sphere_template()
    points = surfaces(template, 3)
    areas = triangle_areas(points, template.faces)
    lengths = edge_lengths(points, template.edges)
    volumes = signed_volume(points, template.faces)
    for k in range(3):
        mesh = trimesh.Trimesh(points[k], template.faces, process=False)
        np.testing.assert_allclose(areas[k], mesh.area_faces, rtol=1e-12)
        np.testing.assert_allclose(volumes[k], mesh.volume, rtol=1e-12)
        np.testing.assert_allclose(np.sort(lengths[k]), np.sort(mesh.edges_unique_length))


def test_volume_does_not_depend_on_the_place():
    box = trimesh.creation.box([1.0, 2.0, 3.0])
    points, faces = np.asarray(box.vertices), np.asarray(box.faces)
    np.testing.assert_allclose(signed_volume(points, faces), 6.0, rtol=1e-14)
    np.testing.assert_allclose(signed_volume(points, faces[:, ::-1]), -6.0, rtol=1e-14)
    np.testing.assert_allclose(signed_volume(-points, faces), -6.0, rtol=1e-14)
    sphere = sphere_template()
    far = signed_volume(sphere.vertices + 1e4, sphere.faces)
    np.testing.assert_allclose(far, signed_volume(sphere.vertices, sphere.faces), rtol=1e-11)


def test_parts_that_face_inward_are_found():
    sphere = sphere_template()
    apart = np.concatenate([sphere.vertices, sphere.vertices + 3.0])
    faces, n_vertices = sphere.faces, sphere.n_vertices
    both = np.concatenate([faces, faces[:, ::-1] + n_vertices])
    inward = np.repeat([False, True], len(faces))
    np.testing.assert_array_equal(find_inward_triangles(apart, both), inward)
    # A triangle by itself has no inside: it is oriented like the rest.
    beside = np.concatenate([faces, [[n_vertices, n_vertices + 1, n_vertices + 2]]])
    assert not find_inward_triangles(apart, beside).any()
    assert find_inward_triangles(apart, beside[:, ::-1]).all()


def test_closed_meshes_are_told():
    faces = sphere_template().faces
    assert is_closed(faces)
    assert not is_closed(faces[1:])
    assert not is_closed(open_template().faces)
    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not is_closed(flipped)
    assert np.isnan(signed_volume(open_template().vertices, open_template().faces))


def test_adjacent_triangles_share_their_edge():
    faces = sphere_template().faces
    pairs, edges = adjacent_triangles(faces)
    assert len(pairs) == 3 * len(faces) // 2
    for pair, edge in zip(pairs, edges, strict=True):
        assert all(set(edge) <= set(faces[triangle]) for triangle in pair)


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 9]], r"faces\[0\] = \(0, 1, 9\) refers to a vertex out of range; points holds 4"),
        ([[0, 1, -1]], r"faces\[0\] = \(0, 1, -1\) refers to a vertex out of range"),
        ([[0.0, 1.0, 0.5]], "faces must be an array of whole numbers"),
    ],
)
def test_other_than_triangles_are_refused(faces, message):
    points = np.eye(4, 3)
    for measure in (triangle_areas, signed_volume):
        with pytest.raises(RiemhumanError, match=message):
            measure(points, faces)
    if faces != [[0, 1, 9]]:  # how many vertices there are is not known
        with pytest.raises(RiemhumanError, match=message.split(";")[0]):
            is_closed(faces)


def test_edges_out_of_range_are_refused():
    with pytest.raises(ArgumentError, match=r"edges\[1\] = \(0, 4\) refers to a vertex"):
        edge_lengths(np.eye(4, 3), [[0, 1], [0, 4]])


def test_without_triangles_nothing_is_closed():
    assert not is_closed(np.empty((0, 3), dtype=int))
    assert np.isnan(signed_volume(np.eye(4, 3), np.empty((0, 3), dtype=int)))
