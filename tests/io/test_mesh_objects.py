"""Meshes of other libraries; those that are not installed are stood in for by what they look like.

`tests/trust/against_mesh_libraries.py` runs the same with the libraries themselves.
"""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from cases import sphere_template

from riemhuman.errors import ArgumentError, ArgumentTypeError, MissingDependencyError
from riemhuman.io import from_pyvista, from_trimesh, load_mesh, load_with_meshio, to_trimesh
from riemhuman.io.meshes import as_arrays
from riemhuman.surfaces import Template


def test_template_from_trimesh_and_back():
    template = sphere_template()
    mesh = template.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh)
    again = Template(mesh)
    np.testing.assert_array_equal(again.vertices, template.vertices)
    np.testing.assert_array_equal(again.faces, template.faces)
    np.testing.assert_array_equal(template.to_trimesh(2 * template.vertices).area, 4 * mesh.area)


def test_from_and_to_trimesh_by_name():
    template = sphere_template()
    vertices, faces = from_trimesh(to_trimesh(template.vertices, template.faces))
    np.testing.assert_array_equal(vertices, template.vertices)
    np.testing.assert_array_equal(faces, template.faces)
    again = Template.from_trimesh(template.to_trimesh())
    np.testing.assert_array_equal(again.vertices, template.vertices)
    with pytest.raises(ArgumentTypeError, match="as surfaces of trimesh have; found SimpleNamesp"):
        from_trimesh(SimpleNamespace(points=vertices, faces=faces))


def test_quads_are_split_alike_from_every_source(tmp_path):
    """By the order of corners alone, whatever their places: the same in files and in objects."""
    corners = np.array([[0, 0, 0], [3, 0, 0], [1, 1, 0], [0, 3, 0], [0, 0, 1.0]])
    polygons = [[1, 2, 3, 0], [0, 1, 4], [4, 3, 2, 1, 0]]
    expected = [[1, 2, 3], [1, 3, 0], [0, 1, 4], [4, 3, 2], [4, 2, 1], [4, 1, 0]]
    points = "\n".join(" ".join(map(str, corner)) for corner in corners)
    counted = "\n".join(" ".join(map(str, [len(one), *one])) for one in polygons)
    (tmp_path / "surface.off").write_text(f"OFF\n5 3 0\n{points}\n{counted}\n")
    obj = ["v " + line for line in points.split("\n")]
    obj += ["f " + " ".join(str(k + 1) for k in one) for one in polygons]
    (tmp_path / "surface.obj").write_text("\n".join(obj) + "\n")
    (tmp_path / "surface.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\n"
        "property float z\nelement face 3\nproperty list uchar int vertex_indices\n"
        f"end_header\n{points}\n{counted}\n"
    )
    for ending in ("off", "obj", "ply"):
        assert load_mesh(tmp_path / f"surface.{ending}")[1].tolist() == expected
    listed = np.concatenate([[len(one), *one] for one in polygons])
    mesh = SimpleNamespace(points=corners, faces=listed)
    assert from_pyvista(mesh)[1].tolist() == expected
    assert Template.from_pyvista(mesh).faces.tolist() == expected


def test_coincident_vertices_stay_apart():
    vertices, faces = np.eye(4, 3)[[0, 1, 2, 0, 1, 3]], [[0, 1, 2], [3, 4, 5]]
    mesh = Template(vertices, faces).to_trimesh()
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)


def test_faces_behind_their_numbers_of_corners():
    mesh = SimpleNamespace(points=np.eye(5, 3), faces=np.array([4, 0, 1, 2, 3, 3, 2, 1, 4]))
    assert as_arrays(mesh)[1].tolist() == [[0, 1, 2], [0, 2, 3], [2, 1, 4]]
    for wrong in ([4, 0, 1, 2], [-1, 0, 1], [2, 0, 1]):
        mesh.faces = np.array(wrong)
        with pytest.raises(ArgumentError, match="corners"):
            as_arrays(mesh)


def test_what_is_no_mesh_is_refused():
    with pytest.raises(ArgumentTypeError, match="must have vertices and faces.*found ndarray"):
        Template(np.eye(3))


@pytest.mark.parametrize("library", ["pyvista", "meshio"])
def test_missing_libraries_are_named(library, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, library, None)
    use = {"pyvista": sphere_template().to_pyvista, "meshio": lambda: load_with_meshio(tmp_path)}
    with pytest.raises(MissingDependencyError, match=r"riemhuman\[meshes\]"):
        use[library]()
