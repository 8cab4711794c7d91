"""Files of meshes and points, and mesh objects of other libraries."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.arrays import Array, Booleans, Integers, Triangles, Values
from riemhuman.checks import check_resolution, checked, mask, real_array
from riemhuman.errors import ArgumentError, ArgumentTypeError, FileFormatError
from riemhuman.io import _mesh_formats as formats
from riemhuman.io._gltf import write_glb
from riemhuman.io._gltf_reader import read_glb
from riemhuman.io._mesh_formats import Mesh, read_ply, read_points_text
from riemhuman.io.arrays import load_array
from riemhuman.io.files import (
    check_file,
    file_path,
    format_errors,
    read_bytes,
    read_in_utf8,
    short_message,
    suffix_of,
    write_bytes,
)
from riemhuman.io.kinds_of_files import AFTER, BY_MAP, FileKind, reads
from riemhuman.io.mesh_arrays import check_mesh
from riemhuman.io.mesh_seams import a_seam_choice, find_seams
from riemhuman.io.polygons import Polygons, is_split, split_polygons
from riemhuman.optional import import_optional

if TYPE_CHECKING:
    import meshio
    import pyvista
    import trimesh

_SURFACE_CELLS = ("triangle", "quad", "polygon")
_MESHIO_SUFFIXES = (
    *(".bdf", ".e", ".exo", ".inp", ".med", ".mesh", ".meshb", ".msh", ".nas", ".su2", ".ugrid"),
    *(".vtk", ".vtu", ".xdmf"),
)


@checked(seams=a_seam_choice)
def load_mesh(path: str | os.PathLike[str], *, seams: str = "keep") -> tuple[Array, Triangles]:
    """Read a triangle mesh from a file, in the file's order.

    By default, vertices and faces are neither merged, reordered nor dropped; normals, texture
    coordinates, colours, materials and animations are ignored. A convex face with more than three
    corners is split by their order, (1, 2, 3), (1, 3, 4), …; one that is not convex is split into
    triangles of the same total area. `RegisteredMeshes` splits the polygons of all files alike.
    An STL file lists three corners for each triangle; equal corners become one vertex.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format: PLY, OBJ, OFF, STL or GLB, each as text or
        binary where the format has both; other formats, such as VTK and Gmsh, are read by meshio,
        which does not check the sizes that a file declares: read these only from trusted sources.
    seams : {"keep", "join"}
        Whether to join vertices that an exporter duplicated along seams, see `find_seams`.

    Returns
    -------
    vertices : array, shape (V, 3), float64
    faces : array, shape (F, 3), int64

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.ply", bodies[0], bodies.template.faces)
    >>> rh.load_mesh("body.ply")[0].shape
    (1202, 3)
    """
    vertices, faces = load_split_mesh(path)
    if seams == "join":
        seams_of_file = find_seams(vertices, faces)
        vertices, faces = seams_of_file.join(vertices), seams_of_file.faces
    return vertices, faces


def load_split_mesh(
    path: str | os.PathLike[str], expected: Triangles | None = None
) -> tuple[Array, Triangles]:
    """Read a triangle mesh; polygons that can be split into the expected triangles are.

    Otherwise, the same polygon in two poses may be split along different diagonals.
    """
    file = _existing_file(path, MESH_SUFFIXES)
    suffix = file.suffix.lower()
    with format_errors(file, "a mesh or a table of points"):
        if suffix in _MESHIO_SUFFIXES:
            points, polygons = _read_with_meshio(file)
        else:
            points, polygons = _READERS[suffix](file, read_in_utf8(file))
        if expected is not None and is_split(expected, polygons):
            vertices, faces = check_mesh(points, expected)
        else:
            vertices, faces = check_mesh(points, split_polygons(points, polygons))
    check_resolution(vertices, f"{file}: vertices", error=FileFormatError)
    return vertices, faces


def load_points(path: str | os.PathLike[str]) -> tuple[Array, Triangles | None, Array | None]:
    r"""Read points from a file, with triangles and normals if it has any.

    Parameters
    ----------
    path : path_like
        A mesh file (PLY, OBJ, OFF, STL or GLB), a PLY file without faces, text with one point per
        line (.xyz) or an array (.npy). Three columns after the position are read as normals if they
        have unit length. In text, numbers have decimal points and are separated by spaces, tabs,
        semicolons or commas; a first line may name the columns. Possible decimal commas are
        refused.

    Returns
    -------
    points : array, shape (N, 3)
    faces : array of int, shape (F, 3), or None
    normals : array, shape (N, 3), or None

    Examples
    --------
    >>> with open("scan.xyz", "w") as file:
    ...     _ = file.write("0 0 0\n0 1.7 0\n")
    >>> points, faces, normals = rh.io.load_points("scan.xyz")
    >>> points.shape, faces, normals
    ((2, 3), None, None)
    """
    file = _existing_file(path, POINT_SUFFIXES)
    suffix = file.suffix.lower()
    is_array = suffix == ".npy"
    values, content = (load_array(file), b"") if is_array else (None, read_in_utf8(file))
    polygons: Polygons | None = None
    faces: Triangles | None = None
    normals: Array | None = None
    with format_errors(file, "a mesh or a table of points"):
        if values is not None:
            points, normals = _columns(values)
        elif suffix == ".xyz":
            points, normals = _columns(read_points_text(content))
        elif suffix == ".ply":
            points, polygons, normals, _ = read_ply(file, content)
        else:
            points, polygons = _READERS[suffix](file, content)
        if polygons is None:
            points = np.asarray(real_array(points, "points", ("n", 3), batched=False))
        else:
            points, faces = check_mesh(points, split_polygons(points, polygons))
            normals = None
    dtype = None if values is None else values.dtype
    check_resolution(points, f"{file}: points", dtype, FileFormatError)
    return points, faces, normals


def load_trusted(path: str | os.PathLike[str]) -> Booleans | None:
    """Return which vertices of a registered body are trusted, or None if its file does not say.

    Parameters
    ----------
    path : path_like
        A mesh file; PLY files written by `save_mesh` may contain this.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.ply", bodies[0], bodies.template.faces, bodies[0][:, 1] > 0.9)
    >>> bool((rh.io.load_trusted("body.ply") == (bodies[0][:, 1] > 0.9)).all())
    True
    """
    file = file_path(path)
    with format_errors(file, "a mesh or a table of points"):
        is_ply = file.suffix.lower() == ".ply"
        return read_ply(file, read_bytes(file))[3] if is_ply else None


def is_registered_scan(path: str | os.PathLike[str]) -> bool:
    """Return whether the header of a mesh file says that it is a registered scan.

    Parameters
    ----------
    path : path_like
        A mesh file; the PLY files of `riemhuman register` say so, see `load_trusted`.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.ply", bodies[0], bodies.template.faces)
    >>> rh.io.is_registered_scan("body.ply")
    False
    """
    file = file_path(path)
    if file.suffix.lower() != ".ply":
        return False
    check_file(file)
    return formats.says_trusted(file)


def save_mesh(
    path: str | os.PathLike[str],
    vertices: ArrayLike,
    faces: ArrayLike,
    trusted: ArrayLike | None = None,
) -> None:
    """Write a triangle mesh atomically to a file that reads back bit for bit.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format: PLY (binary), OBJ, OFF, or GLB, which holds
        single precision; an existing file is replaced.
    vertices : array_like, shape (V, 3)
        Vertex positions.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0.
    trusted : array_like of bool, shape (V,), optional
        Which vertices a registration trusts; only PLY files can store it, as a vertex property.

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.obj", bodies[0], bodies.template.faces)
    """
    file = file_path(path)
    suffix = suffix_of(file, _WRITERS)
    mesh = check_mesh(vertices, faces)
    if trusted is not None:
        trusted = mask(trusted, "trusted", [mesh[0].shape[:1]])
    if suffix == ".ply":
        write_bytes(file, formats.write_ply(*mesh, trusted))
    else:
        write_bytes(file, _WRITERS[suffix](*mesh))


def as_arrays(mesh: object) -> tuple[Array, Triangles]:
    """Return the vertices and triangles of a mesh object, in its order.

    Parameters
    ----------
    mesh : trimesh.Trimesh, pyvista.PolyData, meshio.Mesh, Template, or a pair of arrays
        Any object with ``vertices`` or ``points``, shape (V, 3), and triangles ``faces``, shape
        (F, 3), or polygons as PyVista (``faces``) and meshio (``cells``) list them; or a tuple of
        vertices and faces. Polygons are split as by `load_mesh`.

    Returns
    -------
    vertices : array, shape (V, 3), float64
    faces : array, shape (F, 3), int64

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> vertices, faces = rh.io.as_arrays(bodies.template.to_trimesh())
    """
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return check_mesh(*mesh)
    vertices = getattr(mesh, "vertices", getattr(mesh, "points", None))
    faces, cells = getattr(mesh, "faces", None), getattr(mesh, "cells", None)
    if faces is None and isinstance(cells, list) and vertices is not None:
        faces = split_polygons(np.asarray(vertices), _polygons_of_cells(cells))
    if vertices is None or faces is None:
        raise ArgumentTypeError(
            "mesh must have vertices and faces, as those of trimesh, PyVista and meshio have; "
            f"found {type(mesh).__name__}"
        )
    faces, vertices = np.asarray(faces), np.asarray(vertices)
    if faces.ndim == 1:
        faces = split_polygons(vertices, _counted_polygons(faces))
    return check_mesh(vertices, faces)


def to_trimesh(vertices: ArrayLike, faces: ArrayLike) -> trimesh.Trimesh:
    """Return a trimesh.Trimesh, with vertices neither merged nor reordered.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
    faces : array_like, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.to_trimesh(bodies[0], bodies.template.faces).vertices.shape
    (1202, 3)
    """
    import trimesh  # imported here because the import takes long

    return trimesh.Trimesh(*check_mesh(vertices, faces), process=False)


def to_pyvista(vertices: ArrayLike, faces: ArrayLike) -> pyvista.PolyData:
    """Return a pyvista.PolyData.

    Parameters
    ----------
    vertices : array_like, shape (V, 3)
    faces : array_like, shape (F, 3)

    Examples
    --------
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.to_pyvista(bodies[0], bodies.template.faces)  # doctest: +SKIP
    """
    pyvista = import_optional("pyvista", "meshes")
    vertices, faces = check_mesh(vertices, faces)
    return pyvista.PolyData(vertices, np.insert(faces, 0, 3, axis=1).ravel())


def _existing_file(path: str | os.PathLike[str], suffixes: Sequence[str]) -> Path:
    file = file_path(path)
    if not os.path.isdir(file):
        suffix_of(file, suffixes)
    check_file(file)
    return file


def _read_ply_mesh(file: Path, content: bytes) -> Mesh:
    vertices, polygons, *_ = read_ply(file, content)
    if polygons is None:
        raise FileFormatError("the PLY file holds no faces; a mesh needs at least one")
    return vertices, polygons


def _read_with_meshio(file: Path) -> Mesh:
    meshio = import_optional("meshio", "meshes")
    printed = StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            mesh = meshio.read(file)
        return mesh.points, _polygons_of_cells(mesh.cells)
    except (Exception, SystemExit) as error:  # meshio prints some errors and ends the program
        reason = " ".join(printed.getvalue().split()) or short_message(error)
        raise FileFormatError(
            f"meshio cannot read it ({reason[:300]}); save it as .ply, .obj or .stl"
        ) from error


def _polygons_of_cells(cells: Iterable[meshio.CellBlock]) -> Polygons:
    """Return the polygons of the surface cells of a meshio mesh, block by block."""
    polygons = [
        np.asarray(p) for block in cells if block.type in _SURFACE_CELLS for p in block.data
    ]
    lengths = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    return Polygons(np.concatenate([np.zeros(0, np.int64), *polygons]), lengths)


def _counted_polygons(faces: Integers) -> Polygons:
    """Return polygons listed in one array, each after its number of corners."""
    starts, place = [], 0
    while place < len(faces):
        if not 0 <= faces[place] < len(faces) - place:
            raise ArgumentError(
                f"faces[{place}] = {faces[place]} corners are more than the array holds"
            )
        starts.append(place)
        place += 1 + int(faces[place])
    return Polygons(np.delete(faces, starts), faces[starts])


def _columns(values: Values) -> tuple[Array, Array | None]:
    """Return points, and normals if there are some, of an array with 3 columns or more."""
    if values.ndim != 2 or values.shape[1] < 3 or values.dtype.kind not in "fiu":
        raise FileFormatError(
            "an array of points must have 3 columns of numbers, or 6 with normals; found shape "
            f"{values.shape} of {values.dtype}"
        )
    points, normals = values[:, :3], np.asarray(values[:, 3:], dtype=np.float64)
    # The last three of six columns are normals or colours.
    is_unit = np.abs(np.linalg.norm(normals, axis=1) - 1.0) < 0.01
    return points, normals if values.shape[1] == 6 and is_unit.all() else None


_READERS: dict[str, Callable[[Path, bytes], Mesh]] = {
    ".ply": _read_ply_mesh,
    ".obj": lambda _, content: formats.read_obj(content),
    ".off": lambda _, content: formats.read_off(content),
    ".stl": lambda _, content: formats.read_stl(content),
    ".glb": lambda _, content: read_glb(content),
}
_WRITERS: dict[str, Callable[[Array, Triangles], bytes]] = {
    ".ply": formats.write_ply,
    ".obj": formats.write_obj,
    ".off": formats.write_off,
    ".glb": write_glb,
}

MESH_SUFFIXES = (*_READERS, *_MESHIO_SUFFIXES)
"""Suffixes of the files that `load_mesh` reads."""

WRITTEN_SUFFIXES = (*_WRITERS,)
"""Suffixes of the files that `save_mesh` writes."""

POINT_SUFFIXES = (*_READERS, ".xyz", ".npy")
"""Suffixes of the files that `load_points` reads."""

reads(
    FileKind(
        "a mesh with the topology of SMPL, SMPL-X, MHR, Anny or another",
        "load_mesh",
        MESH_SUFFIXES,
        registered=BY_MAP,
        measured=AFTER,
        written=WRITTEN_SUFFIXES,
    )
)(load_mesh)
