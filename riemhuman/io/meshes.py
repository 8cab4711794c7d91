"""Mesh files and mesh objects of other libraries, with vertices in their order.

Registration depends on this order. Readers of other libraries split the vertices of an OBJ file
that has texture coordinates or normals, sort its faces by material, or split polygons by their
shape; hence the short readers of text files here.
"""

from __future__ import annotations

import os
import re
from array import array
from codecs import BOM_UTF8
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    FileError,
    FileFormatError,
    RiemhumanError,
)
from riemhuman.io._gltf import read_glb
from riemhuman.io._ply import read_ply
from riemhuman.io.files import check_file, file_path, read_bytes, short_message, write_bytes
from riemhuman.io.mesh_arrays import check_mesh, split_polygons
from riemhuman.optional import import_optional

_Mesh = tuple[ndarray, ndarray]

_SURFACE_CELLS = ("triangle", "quad", "polygon")
_MESHIO_SUFFIXES = (
    *(".bdf", ".e", ".exo", ".inp", ".med", ".mesh", ".meshb", ".msh", ".nas", ".su2", ".ugrid"),
    *(".vtk", ".vtu", ".xdmf"),
)
# Numbers and the three normals, corners and spare bytes of each triangle of a binary STL file.
_STL_HEADER = 84
_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])
POINT_CLOUDS = {
    ".pcd": "open3d.io.write_point_cloud('scan.ply', open3d.io.read_point_cloud('scan.pcd'))",
    ".e57": "CloudCompare -SILENT -O scan.e57 -C_EXPORT_FMT PLY -SAVE_CLOUDS",
}
"""How to convert files of point clouds that no reader here reads, by suffix."""


def load_mesh(path: str | os.PathLike[str]) -> tuple[ndarray, ndarray]:
    """Read a triangle mesh from a file, in the file's order.

    Vertices and faces are neither merged, reordered nor dropped; normals, texture coordinates,
    colours, materials and animations are ignored. Faces with more than three corners are split by
    the order of their corners, (1, 2, 3), (1, 3, 4), …, so that registered meshes stay registered.
    An STL file lists three corners for each triangle; equal corners become one vertex.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format: PLY, OBJ, OFF, STL or GLB, each as text or
        binary where the format has both; other formats, such as VTK and Gmsh, are read by meshio,
        which does not check the sizes that a file declares: read these only from trusted sources.

    Returns
    -------
    vertices : array, shape (V, 3), float64
        Vertex positions, in the file's unit.
    faces : array, shape (F, 3), int64
        Vertex indices of each triangle, counted from 0.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.ply", bodies[0], bodies.template.faces)
    >>> vertices, faces = rh.load_mesh("body.ply")
    >>> vertices.shape, faces.shape
    ((1202, 3), (2400, 3))
    """
    file = file_path(path)
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file was expected")
    suffix = file.suffix.lower()
    if suffix not in MESH_SUFFIXES:
        check_not_point_cloud(file)
        raise _unknown_suffix(file, MESH_SUFFIXES)
    if not file.exists():
        raise FileError(f"there is no file {file}")
    check_file(file)
    try:
        return check_mesh(*_READERS.get(suffix, _read_with_meshio)(file))
    except (FileError, ImportError):
        raise
    except RiemhumanError as error:
        raise FileFormatError(f"{file}: {error}") from error


def save_mesh(path: str | os.PathLike[str], vertices: ArrayLike, faces: ArrayLike) -> None:
    """Write a triangle mesh atomically to a file that reads back bit for bit.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format: PLY (binary), OBJ or OFF; an existing file is
        replaced.
    vertices : array_like, shape (V, 3)
        Vertex positions.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.save_mesh("body.obj", bodies[0], bodies.template.faces)
    >>> bool((rh.load_mesh("body.obj")[0] == bodies[0]).all())
    True
    """
    file = file_path(path)
    if file.suffix.lower() not in _WRITERS:
        raise _unknown_suffix(file, tuple(_WRITERS))
    content = _WRITERS[file.suffix.lower()](*check_mesh(vertices, faces))
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file cannot take its place")
    if not file.parent.is_dir():
        raise FileError(f"{file} cannot be written: there is no folder {file.parent}")
    write_bytes(file, content)


def as_arrays(mesh: Any) -> tuple[ndarray, ndarray]:
    """Return the vertices and triangles of a mesh object, in its order.

    Parameters
    ----------
    mesh : trimesh.Trimesh, pyvista.PolyData, meshio.Mesh, Template, or a pair of arrays
        Any object with ``vertices`` or ``points``, shape (V, 3), and triangles ``faces``, shape
        (F, 3), or polygons as PyVista (``faces``) and meshio (``cells``) list them; or a tuple of
        vertices and faces.

    Returns
    -------
    vertices : array, shape (V, 3), float64
    faces : array, shape (F, 3), int64
        Polygons are split as by `load_mesh`.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> mesh = rh.io.to_trimesh(bodies[0], bodies.template.faces)
    >>> vertices, faces = rh.io.as_arrays(mesh)
    >>> bool((vertices == bodies[0]).all())
    True
    """
    if isinstance(mesh, tuple) and len(mesh) == 2:
        return check_mesh(*mesh)
    vertices = getattr(mesh, "vertices", getattr(mesh, "points", None))
    faces = getattr(mesh, "faces", None)
    if faces is None and isinstance(getattr(mesh, "cells", None), list):
        faces = _triangles_of_cells(mesh.cells)
    if vertices is None or faces is None:
        raise ArgumentTypeError(
            "mesh must have vertices and faces, as those of trimesh, PyVista and meshio have; "
            f"found {type(mesh).__name__}"
        )
    faces = np.asarray(faces)
    return check_mesh(np.asarray(vertices), _counted_triangles(faces) if faces.ndim == 1 else faces)


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
    >>> mesh = rh.io.to_trimesh(bodies[0], bodies.template.faces)
    >>> mesh.vertices.shape
    (1202, 3)
    """
    import trimesh  # imported here because the import takes long

    return trimesh.Trimesh(*check_mesh(vertices, faces), process=False)


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

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.to_pyvista(bodies[0], bodies.template.faces)  # doctest: +SKIP
    """
    pyvista = import_optional("pyvista", "meshes")
    vertices, faces = check_mesh(vertices, faces)
    return pyvista.PolyData(vertices, np.insert(faces, 0, 3, axis=1).ravel())


def check_not_point_cloud(file: Path) -> None:
    """Raise an error that says how to convert a PCD or E57 file."""
    if file.suffix.lower() in POINT_CLOUDS:
        raise FileFormatError(
            f"{file}: {file.suffix} files are not read; convert it to PLY first, as with "
            f"{POINT_CLOUDS[file.suffix.lower()]}"
        )


def _unknown_suffix(file: Path, suffixes: tuple[str, ...]) -> FileFormatError:
    suffix = repr(file.suffix) if file.suffix else "none"
    return FileFormatError(
        f"{file}: the ending must be one of {', '.join(suffixes)}; found {suffix}"
    )


def _read_ply_mesh(file: Path) -> _Mesh:
    vertices, faces, _ = read_ply(file)
    if faces is None:
        raise FileFormatError("the PLY file holds no faces; a mesh has some")
    return vertices, faces


def _read_with_meshio(file: Path) -> _Mesh:
    meshio = import_optional("meshio", "meshes")
    printed = StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            mesh = meshio.read(file)
        return mesh.points, _triangles_of_cells(mesh.cells)
    except (Exception, SystemExit) as error:  # meshio prints some errors and ends the program
        reason = " ".join(printed.getvalue().split()) or short_message(error)
        raise FileFormatError(
            f"meshio cannot read it ({reason[:300]}); save it as .ply, .obj or .stl"
        ) from error


def _triangles_of_cells(cells: Any) -> ndarray:
    """Return the triangles of the surface cells of a meshio mesh, block by block."""
    polygons = [
        np.asarray(p) for block in cells if block.type in _SURFACE_CELLS for p in block.data
    ]
    lengths = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    return split_polygons(np.concatenate([np.zeros(0, np.int64), *polygons]), lengths)


def _counted_triangles(faces: ndarray) -> ndarray:
    """Return the triangles of polygons listed in one array, each after its number of corners."""
    starts, place = [], 0
    while place < len(faces):
        if not 0 <= faces[place] < len(faces) - place:
            raise ArgumentError(
                f"faces[{place}] = {faces[place]} corners are more than the array holds"
            )
        starts.append(place)
        place += 1 + int(faces[place])
    return split_polygons(np.delete(faces, starts), faces[starts])


def _read_obj(file: Path) -> _Mesh:
    positions, corners, lengths = array("d"), array("q"), array("q")
    for number, words in _lines_of_obj(read_bytes(file)):
        keyword, *fields = words or [b""]
        try:
            if keyword == b"v":
                positions.extend(_position(fields))
            elif keyword == b"f":
                n_vertices = len(positions) // 3
                for field in fields:
                    corner = int(field.split(b"/", 1)[0])
                    # Positive indices count from 1, negative ones back from the latest vertex.
                    corners.append(corner - 1 if corner >= 0 else n_vertices + corner)
                lengths.append(len(fields))
        except (OverflowError, ValueError) as error:
            raise FileFormatError(f"line {number} is not valid: {_shorten(words)}") from error
    return _mesh_of_polygons(positions, corners, lengths)


def _lines_of_obj(content: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the number and the words of every line; a backslash at its end continues a line."""
    number, words = 0, list[bytes]()
    for number, line in enumerate(content.removeprefix(BOM_UTF8).splitlines(), start=1):
        # A backslash in a comment, as in a path of Windows, does not continue the line.
        text = line.partition(b"#")[0]
        words += text.removesuffix(b"\\").split()
        if not text.endswith(b"\\"):
            yield number, words
            words = []
    yield number, words


def _read_off(file: Path) -> _Mesh:
    lines = read_bytes(file).removeprefix(BOM_UTF8).splitlines()
    rows = iter([words for line in lines if (words := line.partition(b"#")[0].split())])
    keyword, *counts = next(rows, [b""])
    if not re.fullmatch(rb"(ST)?C?N?OFF", keyword):
        raise FileFormatError("not an OFF text file: it does not begin with 'OFF'")
    counts = counts or next(rows, [])
    if len(counts) not in (2, 3) or not all(re.fullmatch(rb"\d{1,18}", word) for word in counts):
        raise FileFormatError("OFF must be followed by the numbers of vertices and faces")
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    positions, corners, lengths = array("d"), array("q"), array("q")
    for row in range(n_vertices + n_faces):
        words = next(rows, [])
        if not words:
            raise FileFormatError(
                f"truncated: the OFF header declares {n_vertices} vertices and {n_faces} faces, "
                f"{row} lines follow"
            )
        try:
            if row < n_vertices:
                positions.extend(_position(words))
            else:
                lengths.append(int(words[0]))
                if not 0 <= lengths[-1] < len(words):
                    raise ValueError
                corners.extend(map(int, words[1 : 1 + lengths[-1]]))
        except (OverflowError, ValueError) as error:
            kind = "face" if row >= n_vertices else "vertex"
            raise FileFormatError(f"not a valid {kind} line: {_shorten(words)}") from error
    rest = next(rows, [])
    if rest:
        raise FileFormatError(
            f"the OFF header declares {n_vertices} vertices and {n_faces} faces, more lines "
            f"follow: {_shorten(rest)}"
        )
    return _mesh_of_polygons(positions, corners, lengths)


def _read_stl(file: Path) -> _Mesh:
    content = read_bytes(file)
    n_faces = int.from_bytes(content[80:_STL_HEADER], "little")
    if len(content) == _STL_HEADER + n_faces * _STL_ROW.itemsize:
        corners = np.frombuffer(content, _STL_ROW, offset=_STL_HEADER)["corners"].reshape(-1, 3)
    else:
        words = re.findall(rb"^[ \t]*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", content, re.MULTILINE)
        facets = len(re.findall(rb"^[ \t]*endfacet\b", content, re.MULTILINE))
        if b"endsolid" not in content or len(words) != 3 * facets:
            raise FileFormatError(
                "not a whole STL file: neither as many bytes as its header declares nor facets of "
                "three vertices each"
            )
        try:
            corners = np.array(words, dtype=float).reshape(-1, 3)
        except ValueError as error:
            raise FileFormatError(f"damaged STL file: {short_message(error)}") from error
    # Equal corners are one vertex; vertices come in the order in which they appear first.
    _, first, vertex_of_corner = np.unique(corners, axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    return corners[first[order]], np.argsort(order)[vertex_of_corner.ravel()].reshape(-1, 3)


def _position(words: list[bytes]) -> list[float]:
    """Return the position of a vertex, which its colour or normal may follow."""
    numbers = [float(word) for word in words]
    if len(numbers) < 3:
        raise ValueError
    return numbers[:3]


def _mesh_of_polygons(positions: array[float], corners: array[int], lengths: array[int]) -> _Mesh:
    vertices = np.array(positions).reshape(-1, 3)
    if not len(vertices) or not len(lengths):
        raise FileFormatError(
            f"{len(vertices)} vertices and {len(lengths)} faces found; both needed"
        )
    return vertices, split_polygons(np.array(corners), np.array(lengths))


def _shorten(words: list[bytes]) -> str:
    return repr(b" ".join(words).decode("latin-1")[:60])


def _write_ply(vertices: ndarray, faces: ndarray) -> bytes:
    header = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    rows = np.empty(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    return header.encode() + vertices.astype("<f8").tobytes() + rows.tobytes()


def _write_obj(vertices: ndarray, faces: ndarray) -> bytes:
    return _lines("v {!r} {!r} {!r}", vertices) + _lines("f {} {} {}", faces + 1)


def _write_off(vertices: ndarray, faces: ndarray) -> bytes:
    header = f"OFF\n{len(vertices)} {len(faces)} 0\n".encode()
    return header + _lines("{!r} {!r} {!r}", vertices) + _lines("3 {} {} {}", faces)


def _lines(pattern: str, rows: ndarray) -> bytes:
    return "".join(pattern.format(*row) + "\n" for row in rows.tolist()).encode()


_READERS: dict[str, Callable[[Path], _Mesh]] = {
    ".ply": _read_ply_mesh,
    ".obj": _read_obj,
    ".off": _read_off,
    ".stl": _read_stl,
    ".glb": read_glb,
}
_WRITERS: dict[str, Callable[[ndarray, ndarray], bytes]] = {
    ".ply": _write_ply,
    ".obj": _write_obj,
    ".off": _write_off,
}

MESH_SUFFIXES = (*_READERS, *_MESHIO_SUFFIXES)
"""Suffixes of the files that `load_mesh` reads."""
