"""Triangle meshes: checks of their arrays, mesh files and mesh objects of other libraries."""

from __future__ import annotations

import os
import re
from array import array
from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeVar

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
from riemhuman.io._ply import read_ply
from riemhuman.io.files import atomic_file, file_path, read_bytes, short_message
from riemhuman.io.mesh_arrays import check_mesh, split_polygons
from riemhuman.io.text_tables import parse_float, parse_int
from riemhuman.optional import import_optional

_Mesh = tuple[np.ndarray, np.ndarray]
_Format = TypeVar("_Format")


def load_mesh(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read a triangle mesh from a PLY, OBJ or OFF file, in the file's order.

    Vertices and faces are neither merged, reordered nor dropped; normals, texture coordinates,
    colours and materials are ignored. Faces with more than three corners are split by the order of
    their corners, (1, 2, 3), (1, 3, 4), …, so that registered meshes stay registered.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format: PLY (text, or binary of either byte order),
        OBJ or OFF.

    Returns
    -------
    vertices : array, shape (V, 3), float64
        Vertex positions, in the file's unit.
    faces : array, shape (F, 3), int64
        Vertex indices of each triangle, counted from 0.

    Raises
    ------
    FileError
        If the file is missing, is a folder or cannot be read.
    FileFormatError
        If the suffix names no known format, the file is damaged or has no faces, a face has fewer
        than three corners or refers to a vertex that does not exist, or a position is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> rh.save_mesh("tetrahedron.ply", corners, faces)
    >>> vertices, triangles = rh.load_mesh("tetrahedron.ply")
    >>> vertices.shape, triangles.shape
    ((4, 3), (4, 3))
    """
    file = file_path(path)
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file was expected")
    read = _format_of(file, _READERS)
    if not file.exists():
        raise FileError(f"there is no file {file}")
    content = read_bytes(file)
    try:
        vertices, faces = read(content)
        return check_mesh(vertices, faces)
    except RiemhumanError as error:
        raise FileFormatError(f"{file}: {error}") from error


def save_mesh(path: str | os.PathLike[str], vertices: ArrayLike, faces: ArrayLike) -> None:
    """Write a triangle mesh to a PLY (binary), OBJ or OFF file that reads back bit for bit.

    The file appears whole or not at all.

    Parameters
    ----------
    path : path_like
        The mesh file, whose suffix gives its format; an existing file is replaced.
    vertices : array_like, shape (V, 3)
        Vertex positions.
    faces : array_like, shape (F, 3)
        Vertex indices of each triangle, counted from 0.

    Raises
    ------
    ArgumentTypeError
        If an array does not hold numbers of the right kind.
    ArgumentError
        If a shape is wrong, a position is not finite, there is no triangle, or a triangle
        refers to a vertex that does not exist.
    FileError
        If the file cannot be written.
    FileFormatError
        If the suffix names no known format.

    Examples
    --------
    >>> import numpy as np
    >>> import riemhuman as rh
    >>> corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    >>> rh.save_mesh("tetrahedron.obj", corners, faces)
    >>> bool((rh.load_mesh("tetrahedron.obj")[0] == corners).all())
    True
    """
    file = file_path(path)
    content = _format_of(file, _WRITERS)(*check_mesh(vertices, faces))
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file cannot take its place")
    if not file.parent.is_dir():
        raise FileError(f"{file} cannot be written: there is no folder {file.parent}")
    with atomic_file(file) as neighbour:
        neighbour.write_bytes(content)


def _format_of(file: Path, table: dict[str, _Format]) -> _Format:
    try:
        return table[file.suffix.lower()]
    except KeyError:
        found = repr(file.suffix) if file.suffix else "none"
        raise FileFormatError(
            f"{file}: the ending must be one of {', '.join(table)}; found {found}"
        ) from None


def _read_obj(content: bytes) -> _Mesh:
    positions, corners, lengths = array("d"), array("q"), array("q")
    for number, words in _lines_of_obj(content):
        keyword, *fields = words or [b""]
        try:
            if keyword == b"v":
                positions.extend(_position(fields))
            elif keyword == b"f":
                n_vertices = len(positions) // 3
                for field in fields:
                    corner = parse_int(field.split(b"/", 1)[0])
                    # Positive indices count from 1, negative ones back from the latest vertex.
                    corners.append(corner - 1 if corner >= 0 else n_vertices + corner)
                lengths.append(len(fields))
        except (OverflowError, ValueError) as error:
            raise FileFormatError(f"line {number} is not valid: {_shown(words)}") from error
    return _triangles(positions, corners, lengths)


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


def _read_off(content: bytes) -> _Mesh:
    lines = (
        line.partition(b"#")[0].split() for line in content.removeprefix(BOM_UTF8).splitlines()
    )
    rows = (words for words in lines if words)
    keyword, *counts = next(rows, [b""])
    if not re.fullmatch(rb"(ST)?C?N?OFF", keyword):
        raise FileFormatError("not an OFF text file: it does not begin with 'OFF'")
    counts = counts or next(rows, [])
    if len(counts) not in (2, 3) or not all(re.fullmatch(rb"\d{1,18}", word) for word in counts):
        raise FileFormatError("OFF must be followed by the numbers of vertices and faces")
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    positions, corners, lengths = array("d"), array("q"), array("q")
    for row in range(n_vertices + n_faces):
        words = next(rows, None)
        if words is None:
            raise FileFormatError(
                f"truncated: the OFF header declares {n_vertices} vertices and {n_faces} faces, "
                f"{row} lines follow"
            )
        try:
            if row < n_vertices:
                positions.extend(_position(words))
            else:
                lengths.append(parse_int(words[0]))
                if not 0 <= lengths[-1] < len(words):
                    raise ValueError
                corners.extend(map(parse_int, words[1 : 1 + lengths[-1]]))
                for word in words[1 + lengths[-1] :]:
                    parse_float(word)  # a colour
        except (OverflowError, ValueError) as error:
            kind = "face" if row >= n_vertices else "vertex"
            raise FileFormatError(f"not a valid {kind} line: {_shown(words)}") from error
    more = next(rows, None)
    if more is not None:
        raise FileFormatError(
            f"the OFF header declares {n_vertices} vertices and {n_faces} faces, more lines "
            f"follow: {_shown(more)}"
        )
    return _triangles(positions, corners, lengths)


def _position(words: list[bytes]) -> list[float]:
    """Return the position of a vertex, which its colour or normal may follow."""
    numbers = [parse_float(word) for word in words]
    if len(numbers) < 3:
        raise ValueError
    return numbers[:3]


def _triangles(positions: array[float], corners: array[int], lengths: array[int]) -> _Mesh:
    vertices = np.array(positions).reshape(-1, 3)
    if not len(vertices) or not len(lengths):
        raise FileFormatError(
            f"{len(vertices)} vertices and {len(lengths)} faces found; both needed"
        )
    return vertices, split_polygons(np.array(corners), np.array(lengths))


def _shown(words: list[bytes]) -> str:
    return repr(b" ".join(words).decode("latin-1")[:60])


def _write_ply(vertices: np.ndarray, faces: np.ndarray) -> bytes:
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


def _write_obj(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    return _lines("v {!r} {!r} {!r}", vertices) + _lines("f {} {} {}", faces + 1)


def _write_off(vertices: np.ndarray, faces: np.ndarray) -> bytes:
    header = f"OFF\n{len(vertices)} {len(faces)} 0\n".encode()
    return header + _lines("{!r} {!r} {!r}", vertices) + _lines("3 {} {} {}", faces)


def _lines(pattern: str, rows: np.ndarray) -> bytes:
    return "".join(pattern.format(*row) + "\n" for row in rows.tolist()).encode()


_READERS = {".ply": read_ply, ".obj": _read_obj, ".off": _read_off}
_WRITERS = {".ply": _write_ply, ".obj": _write_obj, ".off": _write_off}


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
    >>> mesh = rh.io.to_trimesh(bodies[0], bodies.template.faces)
    >>> vertices, faces = rh.io.from_trimesh(mesh)
    >>> bool((vertices == bodies[0]).all())
    True
    """
    _refuse_without(mesh, ("vertices", "faces"), "trimesh")
    return as_arrays(mesh)


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
    >>> vertices, faces = rh.io.from_pyvista(mesh)  # doctest: +SKIP
    """
    _refuse_without(mesh, ("points", "faces"), "PyVista")
    return as_arrays(mesh)


def as_arrays(mesh: Any) -> tuple[ndarray, ndarray]:
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
    return check_mesh(np.asarray(vertices), _counted(faces) if faces.ndim == 1 else faces)


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

    Raises
    ------
    MissingDependencyError
        If PyVista is not installed.

    Examples
    --------
    >>> import riemhuman as rh
    >>> bodies = rh.datasets.load_open_bodies("coarse")
    >>> rh.io.to_pyvista(bodies[0], bodies.template.faces)  # doctest: +SKIP
    """
    pyvista = import_optional("pyvista", "meshes")
    vertices, faces = check_mesh(vertices, faces)
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
    >>> vertices, faces = rh.io.load_with_meshio("surface.vtk")  # doctest: +SKIP
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
        return check_mesh(mesh.points, _triangles_of(polygons))
    except (Exception, SystemExit) as error:  # meshio ends the program on some errors
        raise FileFormatError(f"{file} cannot be read by meshio: {short_message(error)}") from error


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
    return _triangles_of(polygons)


def _triangles_of(polygons: list[ndarray]) -> ndarray:
    lengths = np.array([len(polygon) for polygon in polygons], dtype=np.int64)
    return split_polygons(np.concatenate([np.zeros(0, np.int64), *polygons]), lengths)
