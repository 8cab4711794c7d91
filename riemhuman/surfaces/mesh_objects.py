"""Conversion of meshes of trimesh, PyVista and meshio from and to arrays.

Vertices keep their order, and polygons are split into triangles as in mesh files.
"""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.optional import import_optional
from riemhuman.storage.file_content import brief, file_path
from riemhuman.surfaces.mesh_arrays import mesh_arrays, split_polygons

_SURFACE_CELLS = ("triangle", "quad", "polygon")


def from_trimesh(mesh: Any) -> tuple[ndarray, ndarray]:
    """Return the vertices and triangles of a trimesh mesh, in its order.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        A mesh, or any object with ``vertices`` and ``faces`` of shapes (V, 3) and (F, 3).

    Returns
    -------
    vertices : array, shape (V, 3)
    faces : array of int, shape (F, 3)

    Raises
    ------
    ArgumentTypeError
        If the object has no vertices and faces.
    ArgumentError
        If its arrays do not form a mesh.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> mesh = rh.surfaces.to_trimesh(bodies[0], bodies.template.faces)
    >>> vertices, faces = rh.surfaces.from_trimesh(mesh)
    >>> bool((vertices == bodies[0]).all())
    True
    """
    _refuse_without(mesh, ("vertices", "faces"), "trimesh")
    return arrays_of_mesh(mesh)


def from_pyvista(mesh: Any) -> tuple[ndarray, ndarray]:
    """Return the vertices and triangles of a PyVista mesh, in its order.

    Parameters
    ----------
    mesh : pyvista.PolyData
        A mesh, or any object with ``points``, shape (V, 3), and ``faces``, a list of polygons with
        the number of corners before the corners of each.

    Returns
    -------
    vertices : array, shape (V, 3)
    faces : array of int, shape (F, 3)
        Polygons are split from their first corner.

    Raises
    ------
    ArgumentTypeError
        If the object has no points and faces.
    ArgumentError
        If its arrays do not form a mesh.

    Examples
    --------
    >>> import riemhuman as rh
    >>> vertices, faces = rh.surfaces.from_pyvista(mesh)  # doctest: +SKIP
    """
    _refuse_without(mesh, ("points", "faces"), "PyVista")
    return arrays_of_mesh(mesh)


def arrays_of_mesh(mesh: Any) -> tuple[ndarray, ndarray]:
    """Return the vertices and triangles of a mesh object of trimesh or PyVista.

    Parameters
    ----------
    mesh : trimesh.Trimesh, pyvista.PolyData, or an object with their attributes
        See `from_trimesh` and `from_pyvista`.

    Returns
    -------
    vertices : array, shape (V, 3)
    faces : array of int, shape (F, 3)

    Raises
    ------
    ArgumentTypeError
        If the object has no vertices and faces.
    ArgumentError
        If its arrays do not form a mesh.
    """
    faces = getattr(mesh, "faces", None)
    vertices = getattr(mesh, "vertices", getattr(mesh, "points", None))
    if faces is None or vertices is None:
        raise ArgumentTypeError(
            "mesh must have vertices and faces, as those of trimesh and PyVista have; found "
            f"{type(mesh).__name__}"
        )
    faces = np.asarray(faces)
    return mesh_arrays(np.asarray(vertices), _counted(faces) if faces.ndim == 1 else faces)


def to_trimesh(vertices: ArrayLike, faces: ArrayLike) -> Any:
    """Return a trimesh mesh, with vertices neither merged nor reordered.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Vertex positions.
    faces : array_like, shape (F, 3)
        Triangles.

    Returns
    -------
    trimesh.Trimesh

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> mesh = rh.surfaces.to_trimesh(bodies[0], bodies.template.faces)
    >>> mesh.vertices.shape
    (1202, 3)
    """
    import trimesh  # imported here because the import takes long

    return trimesh.Trimesh(*mesh_arrays(vertices, faces), process=False)


def to_pyvista(vertices: ArrayLike, faces: ArrayLike) -> Any:
    """Return a PyVista mesh.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
        Vertex positions.
    faces : array_like, shape (F, 3)
        Triangles.

    Returns
    -------
    pyvista.PolyData

    Raises
    ------
    MissingDependencyError
        If PyVista is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.surfaces.to_pyvista(bodies[0], bodies.template.faces)  # doctest: +SKIP
    """
    pyvista = import_optional("pyvista", "meshes")
    vertices, faces = mesh_arrays(vertices, faces)
    return pyvista.PolyData(vertices, np.insert(faces, 0, 3, axis=1).ravel())


def load_with_meshio(path: str | os.PathLike[str]) -> tuple[ndarray, ndarray]:
    """Read a surface mesh from a file in any format that meshio reads, such as VTK or Gmsh.

    meshio does not check the sizes that a file declares: read only files from trusted sources.

    Parameters
    ----------
    path : path_like
        The mesh file. Line, point and solid elements in it are ignored.

    Returns
    -------
    vertices : array, shape (V, 3)
        In the file's order and unit.
    faces : array of int, shape (F, 3)
        Triangles, then the halves of quadrilaterals, then the parts of larger polygons.

    Raises
    ------
    FileFormatError
        If meshio cannot read the file, or it holds no surface.
    MissingDependencyError
        If meshio is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> vertices, faces = rh.surfaces.load_with_meshio("surface.vtk")  # doctest: +SKIP
    """
    meshio = import_optional("meshio", "meshes")
    file = file_path(path)
    try:
        mesh = meshio.read(file)
        polygons = [
            np.asarray(polygon)
            for cells in mesh.cells
            if cells.type in _SURFACE_CELLS
            for polygon in cells.data
        ]
        return mesh_arrays(mesh.points, _triangles(polygons))
    except (Exception, SystemExit) as error:  # meshio ends the program on some errors
        raise FileFormatError(f"{file} cannot be read by meshio: {brief(error)}") from error


def _refuse_without(mesh: Any, names: tuple[str, str], library: str) -> None:
    if any(not hasattr(mesh, name) for name in names):
        raise ArgumentTypeError(
            f"mesh must have {names[0]} and {names[1]}, as surfaces of {library} have; found "
            f"{type(mesh).__name__}"
        )


def _counted(faces: ndarray) -> ndarray:
    """Return the triangles of polygons listed in one array, each after its number of corners."""
    polygons, place = [], 0
    while place < len(faces):
        count = int(faces[place])
        if count < 0 or place + 1 + count > len(faces):
            raise ArgumentError(f"faces[{place}] = {count} corners are more than the array holds")
        polygons.append(faces[place + 1 : place + 1 + count])
        place += 1 + count
    return _triangles(polygons)


def _triangles(polygons: list[ndarray]) -> ndarray:
    lengths = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    return split_polygons(np.concatenate([np.zeros(0, np.int64), *polygons]), lengths)
