"""Readers and writers of PLY, OBJ, OFF and STL meshes and of points in text, in their order.

Registration depends on this order. Readers of other libraries split the vertices of an OBJ file
that has texture coordinates or normals, sort its faces by material, or split polygons by their
shape; hence the short readers of text files here.
"""

from __future__ import annotations

import io
import re
import warnings
from array import array
from codecs import BOM_UTF8
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from riemhuman.arrays import Array, Triangles, Values
from riemhuman.errors import FileFormatError
from riemhuman.io.mesh_arrays import place_numbers
from riemhuman.io.polygons import Polygons

if TYPE_CHECKING:
    import plyfile

Mesh: TypeAlias = tuple[Values, Polygons]
"""Vertices and polygons."""

_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_REMARKS = (b"comment", b"obj_info")
_HEADER_BYTES = 2**16  # longer than any header of a PLY file
_SHOWN = 60  # characters of a name or a line in messages
# What begins a comment in a table of points, and what is a number in decimal notation with a point.
_COMMENT = re.compile(r"#|//")
_NUMBER = re.compile(
    r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(nan|inf|infinity)", re.IGNORECASE
)
_ADVICE = "write decimals with a point, and spaces, tabs or semicolons between numbers"
# A row of a triangle in a binary PLY file.
_PLY_TRIANGLE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])
# A binary STL file: bytes of the comment and of the number of triangles, and a triangle's row.
_STL_HEADER = 84
_STL_ROW = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")])


def read_ply(
    file: Path, content: bytes
) -> tuple[Values, Polygons | None, Values | None, Values | None]:
    """Return vertices, and polygons, normals and the trusted vertices, if the file has them.

    The content of the file is checked first; plyfile then maps the file into memory.
    """
    data = _read_ply(file, content)
    vertices = _columns(data, _POSITION)
    if vertices is None or len(vertices) == 0:
        raise FileFormatError("a PLY file must have vertices with numbers x, y and z")
    trusted = _columns(data, ("trusted",))
    trusted = None if trusted is None else trusted[:, 0] != 0
    return vertices, _faces(data), _columns(data, _NORMAL), trusted


def says_trusted(file: Path) -> bool:
    """Return whether the header of a PLY file declares which vertices are trusted."""
    with file.open("rb") as stream:
        header = stream.read(_HEADER_BYTES).partition(b"end_header")[0]
    return re.search(rb"[\r\n]property[ \t]+\w+[ \t]+trusted[ \t]*[\r\n]", header) is not None


def _read_ply(file: Path, content: bytes) -> plyfile.PlyData:
    import plyfile  # imported here because few programs read PLY files

    header, body, is_plain = _ply_header(content)
    counts = _checked_counts(header, body)
    is_text = b"format ascii" in header
    if is_text:
        lines = [line for line in body.splitlines() if line.strip()]
        _check_end(sum(counts), len(lines), "lines")
        body = b"\n".join([*lines, b""])
    # Triangles alone are mapped into memory at once; lists of other lengths are read row by row.
    all_triangles = {"face": dict.fromkeys(_CORNERS, 3)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of empty lists
        if is_text or not is_plain:
            stream = io.BytesIO(header + body)
            data = plyfile.PlyData.read(stream)
            n_read = 0 if is_text else stream.tell() - len(header)
        else:
            with file.open("rb") as mapped:
                try:
                    data = plyfile.PlyData.read(mapped, known_list_len=all_triangles)
                except plyfile.PlyElementParseError:
                    mapped.seek(0)
                    data = plyfile.PlyData.read(mapped)
                n_read = mapped.tell() - (len(content) - len(body))
    if not is_text and len(body) - n_read >= _PLY_TRIANGLE.itemsize:
        _check_end(n_read, len(body), "bytes")
    return data


def _check_end(expected: int, found: int, what: str) -> None:
    if found < expected:
        raise FileFormatError(f"truncated: its header declares {expected} {what}; found {found}")
    if found > expected:
        raise FileFormatError(
            f"its header declares fewer rows than follow: {expected} {what} expected, {found} "
            "found; correct the numbers of elements in the header"
        )


def _ply_header(content: bytes) -> tuple[bytes, bytes, bool]:
    """Return the header as plyfile reads it, the body, and whether the file has that header.

    Some programs write spaces after words, capitals or blank lines; comments may be in any
    encoding, and are left out.
    """
    start = re.match(rb"(\xef\xbb\xbf)?ply[ \t]*(\r\n|\r|\n)", content, re.IGNORECASE)
    # After an old line end alone, numbers that look like a new one may follow.
    line_end = rb"\r" if start is not None and start[2] == b"\r" else rb"\r?\n"
    end = re.search(rb"[\r\n][ \t]*end_header[ \t]*(%s|\Z)" % line_end, content, re.IGNORECASE)
    if start is None:
        raise FileFormatError("not a PLY file: it does not begin with a line 'ply' and a header")
    if end is None:
        raise FileFormatError("truncated: the header of a PLY file ends with a line 'end_header'")
    written = content[start.end() : end.start() + 1].splitlines()
    comments = {line for line in written if line.lstrip().lower().startswith(_REMARKS)}
    lines = [b" ".join(line.split()).lower() for line in written if line not in comments]
    header = b"\n".join([b"ply", *filter(None, lines), b"end_header", b""])
    plain = start[2].join([b"ply", *written, b"end_header", b""])
    is_plain = plain.isascii() and content.startswith(plain) and set(written) <= {*lines, *comments}
    return header, content[end.end() :], is_plain


def _checked_counts(header: bytes, body: bytes) -> list[int]:
    """Return the numbers of rows, for which memory is allocated."""
    counts = []
    for line in re.findall(rb"^element .*$", header, re.MULTILINE):
        count = line.split()[-1]
        if not re.fullmatch(rb"\d{1,18}", count) or int(count) > len(body):
            raise FileFormatError(
                f"truncated: the PLY header declares {line.decode('latin-1')[:_SHOWN]!r}, and "
                f"{len(body)} bytes follow"
            )
        counts.append(int(count))
    return counts


def _columns(data: plyfile.PlyData, names: tuple[str, ...]) -> Values | None:
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


def _faces(data: plyfile.PlyData) -> Polygons | None:
    if "tristrips" in data:
        raise FileFormatError("its strips of triangles are not read; save it with single triangles")
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
        return Polygons.of_triangles(np.asarray(corners, dtype=np.int64))
    lengths = np.array([len(polygon) for polygon in corners])
    return Polygons(np.concatenate(corners).astype(np.int64), lengths)


def read_obj(content: bytes) -> Mesh:
    mesh = _plain_obj(content)
    return _obj_by_lines(content) if mesh is None else mesh


def _plain_obj(content: bytes) -> Mesh | None:
    """Return the mesh of a file as most programs write it, of triangles; None of another."""
    # Continued or indented lines, or separators other than spaces.
    if any(mark in content for mark in (b"\\", b"\t", b"\v", b"\f", b"\n ", b"\r ")):
        return None
    lines = content.splitlines()
    if lines and lines[0][:1].isspace():
        return None
    vertices = _rows_of_numbers([line[2:] for line in lines if line.startswith(b"v ")], 3, float)
    faces = _rows_of_numbers([line[2:] for line in lines if line.startswith(b"f ")], 3, np.int64)
    if vertices is None or faces is None or not 1 <= faces.min() <= faces.max() <= len(vertices):
        return None
    return vertices, Polygons.of_triangles(faces - 1)


def _rows_of_numbers(lines: list[bytes], width: int, dtype: type) -> Values | None:
    """Return the numbers of lines of equal width, or None; of corners, the part before a slash."""
    if {len(line.split()) for line in lines} != {width}:
        return None
    text = b" ".join(lines)
    if dtype is np.int64 and b"/" in text:
        text = re.sub(rb"/[^ ]*", b"", text)
    if text.translate(None, b"0123456789+-.eE "):  # such as names, commas and comments
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # where a number ends within a word
        try:
            numbers: Values = np.fromstring(text.decode(), dtype, sep=" ")
        except (DeprecationWarning, ValueError):
            return None
    return numbers.reshape(-1, width) if numbers.size == width * len(lines) else None


def _obj_by_lines(content: bytes) -> Mesh:
    positions = array("d")
    corners = array("q")
    lengths = array("q")
    for number, words in _lines_of_words(content):
        keyword, *fields = words
        try:
            if keyword == b"v":
                positions.extend(_position(fields))
            elif keyword == b"f":
                n_vertices = len(positions) // 3
                for field in fields:
                    corner = int(field.split(b"/", 1)[0])
                    # Positive indices count from 1, negative ones back from the latest vertex.
                    if not corner or corner < -n_vertices:
                        raise FileFormatError(
                            f"line {number}: a face refers to vertex {corner}; they are counted "
                            f"from 1, or back from -1 to -{n_vertices}"
                        )
                    corners.append(corner - 1 if corner > 0 else n_vertices + corner)
                lengths.append(len(fields))
        except FileFormatError:
            raise
        except (OverflowError, ValueError) as error:
            raise _bad_line(number, words) from error
    n_vertices = len(positions) // 3
    if corners and n_vertices and max(corners) >= n_vertices:
        raise FileFormatError(
            f"a face refers to vertex {max(corners) + 1}; the file has {n_vertices}, counted from 1"
        )
    return _mesh_of_polygons(positions, corners, lengths)


def read_off(content: bytes) -> Mesh:
    lines = _lines_of_words(content)
    _, words = next(lines, (0, [b""]))
    # The letters say that texture coordinates, colours or normals follow the positions. Some
    # programs join the first number to them, and the word is optional.
    start = re.fullmatch(rb"((?:ST|C|N)*OFF)?(\d{1,18})?", words[0].upper())
    if start is None or not words[0]:
        raise FileFormatError(_not_off(words[0]))
    counts = ([start[2]] if start[2] else []) + words[1:]
    if counts[:1] == [b"BINARY"]:
        raise FileFormatError("it is a binary OFF file; save it as text, or as PLY")
    counts = counts or next(lines, (0, [b""]))[1]
    if len(counts) not in (2, 3) or not all(re.fullmatch(rb"\d{1,18}", word) for word in counts):
        line = b" ".join(counts).decode("latin-1")[:_SHOWN]
        raise FileFormatError(
            "OFF must be followed by the numbers of vertices and faces on one line, and each "
            f"vertex and face by a line end; found {line!r}"
        )
    n_vertices, n_faces = int(counts[0]), int(counts[1])
    positions = array("d")
    corners = array("q")
    lengths = array("q")
    for row, (number, words) in enumerate(lines):
        try:
            if row < n_vertices:
                positions.extend(_position(words))
            else:
                lengths.append(int(words[0]))
                if not 0 <= lengths[-1] < len(words):
                    raise ValueError
                corners.extend(map(int, words[1 : 1 + lengths[-1]]))
        except (OverflowError, ValueError) as error:
            raise _bad_line(number, words) from error
    n_lines = len(positions) // 3 + len(lengths)
    if n_lines != n_vertices + n_faces:
        raise FileFormatError(
            f"the OFF header declares {n_vertices} vertices and {n_faces} faces, {n_lines} lines "
            "follow"
        )
    return _mesh_of_polygons(positions, corners, lengths)


def _not_off(word: bytes) -> str:
    if re.fullmatch(rb"(ST|C|N)*(4N?|N)OFF", word.upper()):
        return "its vertices have four or more coordinates; save it as OFF with three"
    return "not an OFF text file: it does not begin with 'OFF'"


def _lines_of_words(content: bytes) -> Iterator[tuple[int, list[bytes]]]:
    """Yield the number and the words of each line that is not blank.

    A backslash at the end of a line continues it on the next.
    """
    words: list[bytes] = []
    for number, line in enumerate(content.removeprefix(BOM_UTF8).splitlines(), start=1):
        # A backslash in a comment, as in a Windows path, does not continue the line.
        text = line.partition(b"#")[0]
        words += text.removesuffix(b"\\").split()
        if words and not text.endswith(b"\\"):
            yield number, words
            words = []


def _bad_line(number: int, words: list[bytes]) -> FileFormatError:
    line = b" ".join(words).decode("latin-1")[:_SHOWN]
    advice = "; decimals need a point" if "," in line else ""
    return FileFormatError(f"line {number} is not valid: {line!r}{advice}")


def read_stl(content: bytes) -> Mesh:
    corners = _binary_corners(content)
    if corners is None:
        corners = _text_corners(content.removeprefix(BOM_UTF8).replace(b"\r", b"\n"))
    # Equal corners are one vertex; vertices come in the order in which they appear first.
    place_of_corner = place_numbers(corners)
    first = np.full(place_of_corner.max(initial=-1) + 1, len(corners))
    np.minimum.at(first, place_of_corner, np.arange(len(corners)))
    order = np.argsort(first)
    faces = np.argsort(order)[place_of_corner].reshape(-1, 3)
    return corners[first[order]], Polygons.of_triangles(faces)


def _binary_corners(content: bytes) -> Values | None:
    """Return the corners of a binary file, shape (3F, 3), or None if it seems to be text."""
    n_faces = int.from_bytes(content[80:_STL_HEADER], "little")
    n_held, n_spare = divmod(max(0, len(content) - _STL_HEADER), _STL_ROW.itemsize)
    # Text declares more triangles than any file holds; others end with a few bytes more.
    if n_held == n_faces and n_faces:
        rows = np.frombuffer(content, _STL_ROW, n_faces, _STL_HEADER)
        return np.asarray(rows["corners"].reshape(-1, 3))
    is_text = content.removeprefix(BOM_UTF8).lstrip()[:5].lower() == b"solid"
    if is_text and (b"\0" not in content or re.search(rb"\bendsolid", content, re.IGNORECASE)):
        return None
    if len(content) < _STL_HEADER:
        raise FileFormatError("not an STL file: it is too short, and does not begin with 'solid'")
    what = "truncated: " if n_faces > n_held else ""
    raise FileFormatError(
        f"{what}its header declares {n_faces} triangles, and {n_held} follow, with {n_spare} bytes "
        "more; if it is a binary STL file, save it anew"
    )


def _text_corners(content: bytes) -> Values:
    """Return the corners of a text file, shape (3F, 3)."""
    flags = re.MULTILINE | re.IGNORECASE
    words = re.findall(rb"^[ \t]*vertex\s+(\S+)\s+(\S+)\s+(\S+)\s*$", content, flags)
    facets = len(re.findall(rb"^[ \t]*endfacet\b", content, flags))
    if not re.search(rb"\bendsolid", content, flags):
        raise FileFormatError("truncated: a text STL file ends with 'endsolid'")
    if not facets or len(words) != 3 * facets:
        raise FileFormatError(
            f"{len(words)} vertices in {facets} facets; a facet of an STL file has three vertices, "
            "each on a line of its own with three numbers"
        )
    try:
        return np.array(words, dtype=float).reshape(-1, 3)
    except ValueError as error:
        advice = "; decimals need a point" if any(b"," in n for row in words for n in row) else ""
        raise FileFormatError(f"its vertices are not all numbers{advice}") from error


def _position(words: list[bytes]) -> list[float]:
    """Return the position of a vertex; its colour or normal may follow it."""
    numbers = [float(word) for word in words]
    if len(numbers) < 3 or any(b"_" in word for word in words):  # Python reads 1_0 as 10
        raise ValueError
    return numbers[:3]


def _mesh_of_polygons(positions: array[float], corners: array[int], lengths: array[int]) -> Mesh:
    vertices = np.array(positions).reshape(-1, 3)
    if not len(vertices) or not len(lengths):
        raise FileFormatError(
            f"{len(vertices)} vertices and {len(lengths)} faces found; a mesh needs both (loose "
            "points are read from .ply, .xyz and .npy files)"
        )
    return vertices, Polygons(np.array(corners), np.array(lengths))


def write_ply(vertices: Values, faces: Triangles, trusted: Values | None = None) -> bytes:
    import plyfile

    columns = dict(zip(_POSITION, vertices.T, strict=True))
    if trusted is not None:
        columns["trusted"] = trusted.astype(np.uint8)
    dtype = [(name, column.dtype) for name, column in columns.items()]
    points = np.rec.fromarrays(list(columns.values()), np.dtype(dtype))
    triangles = faces.astype(np.int32, order="C").view([(_CORNERS[0], np.int32, (3,))])[:, 0]
    elements = [
        plyfile.PlyElement.describe(points, "vertex"),
        plyfile.PlyElement.describe(triangles, "face"),
    ]
    header: str = plyfile.PlyData(elements, byte_order="<").header + "\n"
    # plyfile would write the triangles one by one.
    rows = np.empty(len(faces), _PLY_TRIANGLE)
    rows["count"], rows["corners"] = 3, faces
    little_endian = points.astype(points.dtype.newbyteorder("<"), copy=False)
    return header.encode("ascii") + little_endian.tobytes() + rows.tobytes()


def write_obj(vertices: Values, faces: Triangles) -> bytes:
    return _lines("v {!r} {!r} {!r}", vertices) + _lines("f {} {} {}", faces + 1)


def write_off(vertices: Values, faces: Triangles) -> bytes:
    header = f"OFF\n{len(vertices)} {len(faces)} 0\n".encode()
    return header + _lines("{!r} {!r} {!r}", vertices) + _lines("3 {} {} {}", faces)


def _lines(pattern: str, rows: Values) -> bytes:
    return "".join(pattern.format(*row) + "\n" for row in rows.tolist()).encode()


def read_points_text(content: bytes) -> Array:
    """Return positions, and what follows them in other columns, shape (N, C)."""
    text = content.removeprefix(BOM_UTF8).decode("latin-1")
    lines = [_COMMENT.split(line, maxsplit=1)[0].strip() for line in text.splitlines()]
    numbered = [(number, line) for number, line in enumerate(lines, start=1) if line]
    if not numbered:
        return np.zeros((0, 3))
    separator = _separator(numbered)
    columns = _named_columns(*numbered[0])
    if _is_count(numbered) and int(numbered[0][1]) != len(numbered) - 1:
        raise FileFormatError(
            f"its first line declares {numbered[0][1]} points, and {len(numbered) - 1} follow"
        )
    numbered = numbered[0 if columns is None and not _is_count(numbered) else 1 :]
    if separator == ";":
        numbered = [(number, row.removesuffix(";")) for number, row in numbered]
    if separator == ",":
        _refuse_decimal_commas([row for _, row in numbered])
    values = _numbers(numbered, separator)
    if columns is not None:
        return values[:, columns]
    n_rows, n_columns = values.shape
    is_counted = n_columns > 3 and n_rows > 2 and values[0, 0] in (0, 1)
    if is_counted and np.array_equal(values[:, 0], values[0, 0] + np.arange(n_rows)):
        raise FileFormatError(
            "the first column numbers the points; leave it out, or name the columns in a first "
            "line: id x y z"
        )
    return values


def _separator(numbered: list[tuple[int, str]]) -> str | None:
    """Return the separator of numbers, None for spaces and tabs."""
    if any(";" in line for _, line in numbered):
        return ";"
    return "," if any("," in line for _, line in numbered) else None


def _named_columns(number: int, line: str) -> list[int] | None:
    """Return the columns of positions and normals if the first line names them."""
    fields = [field.strip("\"'").lower() for field in re.split(r"[\s,;]+", line) if field]
    if any(map(_NUMBER.fullmatch, fields)):
        return None
    names = [*_POSITION, *(_NORMAL if set(_NORMAL) <= set(fields) else ())]
    if any(fields.count(name) != 1 for name in names):
        raise FileFormatError(
            f"line {number} is not valid: {line[:_SHOWN]!r}; it should hold numbers, "
            "or name the columns x, y and z"
        )
    return [fields.index(name) for name in names]


def _refuse_decimal_commas(rows: list[str]) -> None:
    """Raise an error where commas may stand for decimals, as in 0,5,0,1,0,2."""
    table = [row.split(",") for row in rows]
    for row in table:
        for field in row:
            if len(field.split()) > 1:
                raise FileFormatError(f"{','.join(row)[:_SHOWN]!r} is ambiguous: {_ADVICE}")
    n_columns = len(table[0]) if table else 0
    if n_columns <= 3:
        return

    def has_fractions(columns: tuple[int, ...]) -> bool:
        return any(
            re.search(r"[.eE]", row[column]) for row in table for column in columns[: len(row)]
        )

    alternate = (0, 2, 4) if n_columns > 4 else (0, 2)
    if any(len(row) != n_columns for row in table) or not has_fractions(alternate):
        raise FileFormatError(f"{rows[0][:_SHOWN]!r} is ambiguous: {_ADVICE}")


def _is_count(numbered: list[tuple[int, str]]) -> bool:
    """Return whether the first line says how many points follow."""
    return re.fullmatch(r"\d{1,18}", numbered[0][1]) is not None and len(numbered) > 1


def _numbers(numbered: list[tuple[int, str]], separator: str | None) -> Array:
    rows = [row for _, row in numbered]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without points
            return np.loadtxt(rows, comments=None, delimiter=separator, ndmin=2)
    except ValueError as error:
        if any("," in row for row in rows):
            first = next(row for row in rows if "," in row)
            raise FileFormatError(f"{first[:_SHOWN]!r} is not valid: {_ADVICE}") from error
        n_columns = len(rows[0].split(separator))
        for number, row in numbered:
            fields = row.split(separator)
            where = f"line {number} is not valid: {row[:_SHOWN]!r}"
            if len(fields) != n_columns:
                raise FileFormatError(
                    f"{where}; it has {len(fields)} numbers, and line {numbered[0][0]} has "
                    f"{n_columns}"
                ) from error
            if not all(_NUMBER.fullmatch(field.strip()) for field in fields):
                raise FileFormatError(f"{where}; it should hold numbers") from error
        raise
