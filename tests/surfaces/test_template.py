"""The template: frames, areas, checks and files."""

import pickle

import numpy as np
import pytest
import trimesh
from cases import sphere_template

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.surfaces.template import Template, TriangleAssembler


def bumpy_sphere(seed=0):
    sphere = trimesh.creation.icosphere(subdivisions=2)
    noise = np.random.default_rng(seed).normal(scale=0.03, size=sphere.vertices.shape)
    return np.asarray(sphere.vertices) + noise, np.asarray(sphere.faces)


@pytest.fixture(scope="module")
def template():
    return Template(*bumpy_sphere())


def derivatives(template, surface):
    values = template.differential_operator @ surface
    return values[: template.n_faces], values[template.n_faces :]


def test_frames_of_a_triangle_worked_by_hand():
    # Corners (0, 0), (4, 0), (1, 2) in the plane: u2 = 4, u3 = 1, v3 = 2, area 4.
    template = Template([[0, 0, 5], [4, 0, 5], [1, 2, 5]], [[0, 1, 2]])
    np.testing.assert_allclose(template.frame_coefficients, [[1 / 4, 1 / 2, 1 / 8]], rtol=1e-15)
    np.testing.assert_allclose(template.face_areas, [4.0], rtol=1e-15)
    np.testing.assert_allclose(template.vertex_areas, [4 / 3] * 3, rtol=1e-15)
    np.testing.assert_array_equal(template.edges, [[0, 1], [0, 2], [1, 2]])
    np.testing.assert_allclose(
        template.differential_operator.toarray(),
        [[-1 / 4, 1 / 4, 0], [1 / 8 - 1 / 2, -1 / 8, 1 / 2]],
        rtol=1e-15,
    )


def test_areas_and_edges_agree_with_trimesh(template):
    mesh = trimesh.Trimesh(template.vertices, template.faces, process=False)
    np.testing.assert_allclose(template.face_areas, mesh.area_faces, rtol=1e-12)
    np.testing.assert_allclose(template.vertex_areas.sum(), mesh.area, rtol=1e-12)
    assert {tuple(edge) for edge in template.edges} == {
        tuple(edge) for edge in np.sort(mesh.edges_unique, axis=1)
    }
    assert len(template.edges) == len(mesh.edges_unique)


@pytest.mark.parametrize("sent", [False, True], ids=["made", "sent to another process"])
def test_arrays_are_read_only_copies(sent):
    vertices, faces = bumpy_sphere()
    # Compiled loops over faces in another order of memory would be compiled again.
    template = Template(vertices, np.asfortranarray(faces))
    if sent:
        template = pickle.loads(pickle.dumps(template))
    assert template.faces.flags.c_contiguous
    first = template.vertices[0].copy()
    vertices[0] = 99.0
    faces[0] = 0
    np.testing.assert_array_equal(template.vertices[0], first)
    assert template.faces[0].any()
    assert template.vertices.dtype == np.float64
    assert template.faces.dtype == np.int64
    for array in (
        template.vertices,
        template.faces,
        template.face_areas,
        template.frame_coefficients,
        template.vertex_areas,
        template.edges,
    ):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    assert template.differential_operator is template.differential_operator
    assert repr(template) == "Template(n_vertices=162, n_faces=320)"


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 0, 1]])
def test_slivers_are_legal_at_every_size(size, order):
    corners = size * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 1e-6, 0.0]])
    template = Template(corners, [order])
    np.testing.assert_allclose(template.face_areas, 0.5e-6 * size**2, rtol=1e-9)
    f_u, f_v = derivatives(template, template.vertices)
    np.testing.assert_allclose([f_u @ f_u.T, f_v @ f_v.T], 1.0, rtol=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("offset", [0.0, 3.3])
def test_collinear_corners_are_refused_at_every_size(size, offset):
    direction = np.array([0.1, 0.2, 0.7])
    flat = size * (np.outer([0.1, 0.37, 0.9], direction) + offset)
    sound = size * np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    with pytest.raises(DegenerateSurfaceError, match=r"2 of 3 triangles.*index 1 .*\(3, 4, 5\)"):
        Template(np.vstack([sound, flat]), [[0, 1, 2], [3, 4, 5], [5, 4, 3]])


def test_corners_collinear_but_for_rounding_far_from_the_origin_are_refused():
    flat = 100.0 + 1e-4 * np.outer([0.1, 0.37, 0.9], [0.1, 0.2, 0.7])
    with pytest.raises(DegenerateSurfaceError, match="index 0"):
        Template(flat, [[0, 1, 2]])


def test_open_and_non_manifold_meshes_and_unused_vertices_are_legal():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0], [7, 7, 7]]
    template = Template(vertices, [[0, 1, 2], [0, 1, 3], [0, 1, 4]])
    assert template.vertex_areas[5] == 0
    assert 5 not in template.edges


TRIANGLE = np.eye(3)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("vertices", "faces", "error", "message"),
    [
        (TRIANGLE, np.empty((0, 3)), ArgumentError, "faces is empty"),
        (TRIANGLE, [[0, 1, 2], [0, 1, 3]], ArgumentError, r"faces\[1\] = \(0, 1, 3\).*holds 3"),
        (TRIANGLE, [[0, -1, 2]], ArgumentError, r"faces\[0\] = \(0, -1, 2\).*out of range"),
        (TRIANGLE, [[0, 1, 2], [1, 2, 1]], ArgumentError, r"faces\[1\].*same vertex twice"),
        (np.diag([1, np.nan, 1]), [[0, 1, 2]], ArgumentError, r"vertices .*index \(1, 1\)"),
    ],
)
def test_bad_arrays_are_refused_by_name(vertices, faces, error, message):
    with pytest.raises(error, match=message):
        Template(vertices, faces)


def test_check_points_refuses_others_by_name(template):
    with pytest.raises(ArgumentError, match=r"end_point has 161 vertices.*template has 162"):
        template.check_points(template.vertices[1:], "end_point")
    surface = template.vertices.copy()
    surface[7, 2] = np.nan
    with pytest.raises(ArgumentError, match=r"end_point .*\(7, 2\)"):
        template.check_points(surface, "end_point")


def test_check_faces_accepts_only_the_same_triangles_in_the_same_order(template):
    template.check_faces(template.faces.copy())
    other = template.faces.copy()
    other[[4, 9]] = other[[4, 9]][:, [1, 2, 0]]
    with pytest.raises(ArgumentError, match=r"mesh faces .*2 of 320 .*index 4"):
        template.check_faces(other, "mesh faces")
    with pytest.raises(ArgumentError, match="319 triangles found, 320 expected"):
        template.check_faces(template.faces[1:])


@pytest.mark.parametrize("ending", ["ply", "obj", "off"])
def test_template_survives_a_file(template, tmp_path, ending):
    template.save(tmp_path / f"template.{ending}")
    again = Template.from_file(tmp_path / f"template.{ending}")
    np.testing.assert_array_equal(again.vertices, template.vertices)
    np.testing.assert_array_equal(again.faces, template.faces)


def test_sum_equals_a_loop():
    template = sphere_template()
    blocks = np.random.default_rng(0).normal(size=(template.n_faces, 9, 9))
    dense = np.zeros((3 * template.n_vertices,) * 2)
    for face, block in zip(template.faces, blocks, strict=True):
        where = (3 * face[:, None] + np.arange(3)).ravel()
        dense[np.ix_(where, where)] += block
    assembled = TriangleAssembler(template.faces, template.n_vertices).assemble(blocks)
    np.testing.assert_allclose(assembled.toarray(), dense, atol=1e-13)
