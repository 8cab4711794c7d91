"""Meshes of PyVista and files of meshio: run by `.ci/oracles`, which installs both."""

import meshio
import numpy as np
import pytest
import pyvista
from cases import sphere_template

from riemhuman.errors import FileFormatError
from riemhuman.io import as_arrays, load_mesh, to_pyvista
from riemhuman.surfaces import Template

TEMPLATE = sphere_template()


def test_pyvista_there_and_back():
    mesh = TEMPLATE.to_pyvista(2 * TEMPLATE.vertices)
    assert mesh.is_all_triangles
    np.testing.assert_allclose(mesh.area, 4 * TEMPLATE.face_areas.sum(), rtol=1e-6)
    vertices, faces = as_arrays(mesh)
    np.testing.assert_array_equal(vertices, 2 * TEMPLATE.vertices)
    np.testing.assert_array_equal(faces, TEMPLATE.faces)
    np.testing.assert_array_equal(Template(mesh).faces, TEMPLATE.faces)
    again = to_pyvista(*as_arrays(mesh))
    np.testing.assert_array_equal(again.points, mesh.points)
    np.testing.assert_array_equal(again.faces, mesh.faces)


def test_quads_of_pyvista_and_of_meshio(tmp_path):
    quads = pyvista.Plane(i_resolution=2, j_resolution=2)
    vertices, faces = as_arrays(quads)
    meshio.Mesh(quads.points, [("quad", quads.faces.reshape(-1, 5)[:, 1:])]).write(
        tmp_path / "plane.vtk", "vtk"
    )
    again = load_mesh(tmp_path / "plane.vtk")
    np.testing.assert_array_equal(again[0], vertices)
    np.testing.assert_array_equal(again[1], faces)


@pytest.mark.parametrize(
    ("ending", "format_name"),
    [("vtk", "vtk"), ("vtu", "vtu"), ("msh", "gmsh22"), ("mesh", "medit")],
)
def test_files_of_meshio(ending, format_name, tmp_path):
    path = tmp_path / f"surface.{ending}"
    quads = np.array([[0, 1, 2, 3]])
    cells = [("triangle", TEMPLATE.faces), ("quad", quads), ("line", TEMPLATE.edges[:3])]
    meshio.Mesh(TEMPLATE.vertices, cells).write(path, format_name)
    vertices, faces = load_mesh(path)
    np.testing.assert_allclose(vertices, TEMPLATE.vertices, rtol=1e-12)
    np.testing.assert_array_equal(faces[:-2], TEMPLATE.faces)
    assert faces[-2:].tolist() == [[0, 1, 2], [0, 2, 3]]


def test_files_that_meshio_cannot_read(tmp_path):
    (tmp_path / "damaged.vtk").write_text("# vtk DataFile\nnothing")
    meshio.Mesh(TEMPLATE.vertices, [("line", TEMPLATE.edges)]).write(tmp_path / "lines.vtk")
    for name, reason in (
        ("damaged.vtk", "meshio cannot read it"),
        ("lines.vtk", "faces is empty"),
        ("odd.ending", "the ending must be one of"),
    ):
        with pytest.raises(FileFormatError, match=f"{name}.*{reason}"):
            load_mesh(tmp_path / name)
