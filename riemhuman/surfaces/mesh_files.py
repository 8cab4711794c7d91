"""Mesh files: vertex i of the file is vertex i of the array, for registration lives in that order.

PLY is read by trimesh. OBJ and OFF are read here, because trimesh splits the vertices of an OBJ
file that has texture coordinates or normals, sorts its faces by material, and turns polygons of
either format into triangles without a word. All three are written here, in double precision.
"""

from __future__ import annotations

import io
import os
import re
import warnings
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from riemhuman.errors import FileError, FileFormatError, RiemhumanError
from riemhuman.surfaces.file_content import brief, file_content, file_path
from riemhuman.surfaces.mesh_arrays import mesh_arrays
from riemhuman.surfaces.whole_files import whole_file

_Mesh = tuple[ArrayLike, ArrayLike]
_Format = TypeVar("_Format")


def load_mesh(path: str | os.PathLike[str]) -> tuple[np.ndarray, np.ndarray]:
    """Read a triangle mesh from a PLY, OBJ or OFF file, vertices and faces in the file's order.

    Nothing is merged, split, reordered or dropped; normals, texture coordinates, colours and
    materials are ignored.

    Parameters
    ----------
    path : path_like
        The mesh file: PLY (text or binary of either byte order), OBJ or OFF, by its ending.

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
        If the ending names no known format, the file is damaged or holds no faces, a face is not
        a triangle or refers to a vertex that does not exist, or a position is not finite.
    """
    file = file_path(path)
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file was expected")
    read = _format_of(file, _READERS)
    if not file.exists():
        raise FileError(f"there is no file {file}")
    content = file_content(file)
    try:
        vertices, faces = read(content)
        return mesh_arrays(vertices, faces)
    except (RiemhumanError, _DamagedError) as error:
        raise FileFormatError(f"{file}: {error}") from error


def save_mesh(path: str | os.PathLike[str], vertices: ArrayLike, faces: ArrayLike) -> None:
    """Write a triangle mesh to a PLY (binary), OBJ or OFF file that reads back bit for bit.

    The file appears whole or not at all: a temporary neighbour is written first.

    Parameters
    ----------
    path : path_like
        The mesh file; its ending says which format. An existing file is replaced.
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
        If the ending names no known format.
    """
    file = file_path(path)
    content = _format_of(file, _WRITERS)(*mesh_arrays(vertices, faces))
    if file.is_dir():
        raise FileError(f"{file} is a folder; a mesh file cannot take its place")
    if not file.parent.is_dir():
        raise FileError(f"{file} cannot be written: there is no folder {file.parent}")
    with whole_file(file) as neighbour:
        neighbour.write_bytes(content)


class _DamagedError(ValueError):
    """The content of a file is not what its format asks for."""


def _format_of(file: Path, table: dict[str, _Format]) -> _Format:
    try:
        return table[file.suffix.lower()]
    except KeyError:
        found = repr(file.suffix) if file.suffix else "none"
        raise FileFormatError(
            f"{file}: the ending must be one of {', '.join(table)}; found {found}"
        ) from None


def _read_ply(content: bytes) -> _Mesh:
    header, _, body = content.partition(b"end_header")
    if not header.startswith(b"ply"):
        raise _DamagedError("not a PLY file, for it does not begin with 'ply'")
    if not body:
        raise _DamagedError("the PLY header has no end")
    declared = dict(re.findall(rb"^element\s+(\w+)\s+(\d{1,18})\b", header, re.MULTILINE))
    n_vertices, n_faces = (int(declared.get(name, 0)) for name in (b"vertex", b"face"))
    if n_vertices == 0 or n_faces == 0:
        raise _DamagedError(
            f"the PLY header declares {n_vertices} vertices and {n_faces} faces; a mesh has both"
        )

    from trimesh.exchange.ply import load_ply

    try:
        with warnings.catch_warnings():
            # Where text stands among the numbers, older releases of NumPy only warn and stop there.
            warnings.simplefilter("error", DeprecationWarning)
            mesh = load_ply(io.BytesIO(content), fix_texture=False, skip_materials=True)
        vertices, faces = np.asarray(mesh["vertices"]), np.asarray(mesh["faces"])
    except Exception as error:  # whatever a damaged file makes a parser stumble over
        raise _DamagedError(
            f"truncated or damaged PLY file ({type(error).__name__}: {brief(error)})"
        ) from error
    if len(vertices) != n_vertices:
        raise _DamagedError(f"{len(vertices)} vertices found, the PLY header declares {n_vertices}")
    if len(faces) < n_faces:
        raise _DamagedError(f"{len(faces)} faces found, the PLY header declares {n_faces}")
    if len(faces) > n_faces or faces.shape[1] != 3:
        raise _DamagedError("some of its faces have more than 3 corners; triangulate the mesh")
    return vertices, faces


def _read_obj(content: bytes) -> _Mesh:
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    lines = _text(content).replace("\\\n", " ").splitlines()
    for number, line in enumerate(lines, start=1):
        keyword, *fields = line.split() or [""]
        try:
            if keyword == "v":
                vertices.append(_position(fields))
            elif keyword == "f":
                corners = [int(field.split("/", 1)[0]) for field in fields]
                # Positive indices count from 1; negative ones count back from the latest vertex.
                faces.append(
                    [corner - 1 if corner >= 0 else len(vertices) + corner for corner in corners]
                )
        except ValueError as error:
            raise _DamagedError(f"line {number} is not valid: {line.strip()[:60]!r}") from error
    return _triangles_only(vertices, faces)


def _read_off(content: bytes) -> _Mesh:
    text = re.sub(r"#.*", "", _text(content))
    keyword, *rest = text.split(maxsplit=1) or [""]
    if not re.fullmatch(r"(ST)?C?N?OFF", keyword):
        raise _DamagedError("not an OFF text file, for it does not begin with 'OFF'")
    rows = [row.split() for row in "".join(rest).splitlines() if row.strip()]
    try:
        n_vertices, n_faces = (int(count) for count in rows[0][:2])
    except (ValueError, IndexError) as error:
        raise _DamagedError("OFF must be followed by the numbers of vertices and faces") from error
    if len(rows) < 1 + n_vertices + n_faces:
        raise _DamagedError(
            f"truncated: the OFF header declares {n_vertices} vertices and {n_faces} faces, "
            f"{len(rows) - 1} lines follow"
        )
    vertices, faces = [], []
    row: list[str] = []
    try:
        for row in rows[1 : 1 + n_vertices]:
            vertices.append(_position(row))
        for row in rows[1 + n_vertices : 1 + n_vertices + n_faces]:
            n_corners = int(row[0])
            faces.append([int(field) for field in row[1 : 1 + n_corners]])
    except ValueError as error:
        kind = "face" if len(vertices) == n_vertices else "vertex"
        raise _DamagedError(f"not a valid {kind} line: {' '.join(row)[:60]!r}") from error
    return _triangles_only(vertices, faces)


def _text(content: bytes) -> str:
    # Numbers and keywords are ASCII; names in comments may be in any encoding.
    return content.decode("utf-8", errors="replace").replace("\r\n", "\n")


def _position(fields: list[str]) -> list[float]:
    x, y, z = fields[:3]
    return [float(x), float(y), float(z)]


def _triangles_only(vertices: list[list[float]], faces: list[list[int]]) -> _Mesh:
    if not vertices or not faces:
        raise _DamagedError(f"{len(vertices)} vertices and {len(faces)} faces found; both needed")
    others = [index for index, face in enumerate(faces) if len(face) != 3]
    if others:
        raise _DamagedError(
            f"{len(others)} of {len(faces)} faces are not triangles, the first at index "
            f"{others[0]} with {len(faces[others[0]])} corners; triangulate the mesh"
        )
    return vertices, faces


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


_READERS = {".ply": _read_ply, ".obj": _read_obj, ".off": _read_off}
_WRITERS = {".ply": _write_ply, ".obj": _write_obj, ".off": _write_off}
