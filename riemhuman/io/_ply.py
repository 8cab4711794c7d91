"""PLY files, read by plyfile after a check of the numbers of rows that their headers declare."""

from __future__ import annotations

import io
import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from riemhuman.errors import FileFormatError
from riemhuman.io.files import read_bytes, short_message
from riemhuman.io.mesh_arrays import split_polygons

_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_SHOWN = 60  # characters of a name or a line in messages

_Parts = tuple[np.ndarray, "np.ndarray | None", "np.ndarray | None"]


def read_ply(file: Path) -> _Parts:
    """Return vertices (V, 3), triangles (F, 3) or None, and normals (V, 3) or None, in order.

    Text and binary files of either byte order, with lists of any lengths and with any other
    elements and properties, which are ignored.
    """
    import plyfile  # imported here because few programs read PLY files

    content = read_bytes(file)
    header = _check_counts(content)
    # Triangles alone are mapped into memory at once; lists of other lengths are read row by row.
    all_triangles = {"face": dict.fromkeys(_CORNERS, 3)}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of empty lists
            try:
                if not header.isascii():  # comments in other encodings, which plyfile refuses
                    raise plyfile.PlyElementParseError("not mapped")
                data = plyfile.PlyData.read(str(file), known_list_len=all_triangles)
            except plyfile.PlyElementParseError:
                plain = header.decode("ascii", "replace").replace("\ufffd", "?").encode()
                data = plyfile.PlyData.read(io.BytesIO(plain + content[len(header) :]))
    except Exception as error:  # a damaged file can make the parser raise any error
        raise FileFormatError(f"damaged PLY file: {short_message(error)}") from error
    vertices = _columns(data, _POSITION)
    if vertices is None or len(vertices) == 0:
        raise FileFormatError("a PLY file must have vertices with numbers x, y and z")
    return vertices, _faces(data), _columns(data, _NORMAL)


def _check_counts(content: bytes) -> bytes:
    """Return the header, after a check of the numbers of rows, for which memory is allocated."""
    header, end, body = content.partition(b"end_header")
    if not re.match(rb"ply\s", header) or not end:
        raise FileFormatError("not a PLY file: it does not begin with a line 'ply' and a header")
    for line in re.findall(rb"[\r\n](element[ \t][^\r\n]*)", header):
        count = line.split()[-1]
        if not re.fullmatch(rb"\d{1,18}", count) or int(count) > len(body):
            raise FileFormatError(
                f"truncated: the PLY header declares {line.decode('latin-1')[:_SHOWN]!r}, and "
                f"{len(body)} bytes follow"
            )
    return header


def _columns(data: Any, names: tuple[str, ...]) -> np.ndarray | None:
    """Return properties of the vertices as columns; None if the vertices lack them."""
    if "vertex" not in data:
        return None
    rows = data["vertex"].data
    if not set(names).issubset(rows.dtype.names or ()) or any(
        rows[n].dtype == object for n in names
    ):
        return None
    with np.errstate(invalid="ignore"):  # of signalling NaNs
        return np.stack([rows[name] for name in names], axis=1).astype(np.float64)


def _faces(data: Any) -> np.ndarray | None:
    if "face" not in data or len(data["face"].data) == 0:
        return None
    rows = data["face"].data
    names = [name for name in _CORNERS if name in (rows.dtype.names or ())]
    if len(names) != 1 or (rows[names[0]].dtype != object and rows[names[0]].ndim != 2):
        listed = ", ".join(name[:_SHOWN] for name in (rows.dtype.names or ())[:10])
        raise FileFormatError(
            f"the faces of a PLY file must have one list {' or '.join(_CORNERS)}; found "
            f"{listed or 'none'}"
        )
    corners = rows[names[0]]
    if corners.ndim == 2:
        return np.asarray(corners, dtype=np.int64)
    lengths = np.array([len(polygon) for polygon in corners])
    return split_polygons(np.concatenate(corners).astype(np.int64), lengths)
