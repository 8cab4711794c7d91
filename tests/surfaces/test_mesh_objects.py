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
from riemhuman.surfaces import Template, load_with_meshio
from riemhuman.surfaces.mesh_objects import arrays_of_mesh


def test_template_from_trimesh_and_back():
    template = sphere_template()
    mesh = template.to_trimesh()
    assert isinstance(mesh, trimesh.Trimesh)
    again = Template(mesh)
    np.testing.assert_array_equal(again.vertices, template.vertices)
    np.testing.assert_array_equal(again.faces, template.faces)
    np.testing.assert_array_equal(template.to_trimesh(2 * template.vertices).area, 4 * mesh.area)


def test_coincident_vertices_stay_apart():
    vertices, faces = np.eye(4, 3)[[0, 1, 2, 0, 1, 3]], [[0, 1, 2], [3, 4, 5]]
    mesh = Template(vertices, faces).to_trimesh()
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)


def test_faces_behind_their_numbers_of_corners():
    mesh = SimpleNamespace(points=np.eye(5, 3), faces=np.array([4, 0, 1, 2, 3, 3, 2, 1, 4]))
    assert arrays_of_mesh(mesh)[1].tolist() == [[0, 1, 2], [0, 2, 3], [2, 1, 4]]
    for wrong in ([4, 0, 1, 2], [-1, 0, 1], [2, 0, 1]):
        mesh.faces = np.array(wrong)
        with pytest.raises(ArgumentError, match="corners"):
            arrays_of_mesh(mesh)


def test_what_is_no_mesh_is_refused():
    with pytest.raises(ArgumentTypeError, match="must have vertices and faces.*found ndarray"):
        Template(np.eye(3))


@pytest.mark.parametrize("library", ["pyvista", "meshio"])
def test_missing_libraries_are_named(library, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, library, None)
    use = {"pyvista": sphere_template().to_pyvista, "meshio": lambda: load_with_meshio(tmp_path)}
    with pytest.raises(MissingDependencyError, match=r"riemhuman\[meshes\]"):
        use[library]()
