"""Reading of the vertices and triangles of PLY files."""

from __future__ import annotations

import re
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from riemhuman.errors import FileFormatError
from riemhuman.io.mesh_arrays import split_polygons

# The types of the format, their later names, and types that some writers have added.
_TYPES = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
    "int64": "i8",
    "uint64": "u8",
    "float16": "f2",
}
_ENCODINGS = {b"ascii": "", b"binary_little_endian": "<", b"binary_big_endian": ">"}
SHOWN = 60
"""Largest number of characters of a name or a line in messages."""


class Property(NamedTuple):
    """A number in every row of an element, or a list of numbers.

    Attributes
    ----------
    name : str
        Its name.
    kind : str
        NumPy's code of the type of the numbers.
    length_kind : str or None
        That of the length of a list; None for a single number.
    """

    name: str
    kind: str
    length_kind: str | None

    @property
    def least(self) -> int:
        """Smallest number of bytes in a row."""
        return int((self.length_kind or self.kind)[1:])


class Element(NamedTuple):
    """Rows with the same properties.

    Attributes
    ----------
    name : str
        Its name, such as "vertex".
    n_rows : int
        Number of rows.
    properties : list of Property
        Properties of every row, in order.
    """

    name: str
    n_rows: int
    properties: list[Property]


def read_header(content: bytes) -> tuple[str, list[Element], bytes]:
    """Read the header of a file.

    Parameters
    ----------
    content : bytes
        The file.

    Returns
    -------
    order : str
        Byte order of the data as NumPy's "<" or ">"; empty for text.
    elements : list of Element
        The declared elements, in order.
    body : bytes
        The data after the header.

    Raises
    ------
    FileFormatError
        If the header is damaged or declares a name twice.
    """
    first = re.match(rb"ply(\r\n|\n|\r)", content)
    if not first:
        raise FileFormatError("not a PLY file: it does not begin with a line 'ply'")
    order: str | None = None
    elements: list[Element] = []
    start = first.end()
    while True:
        end = content.find(first[1], start)
        if end < 0:
            raise FileFormatError("the PLY header has no end")
        line, start = content[start:end], end + len(first[1])
        if line == b"end_header":
            break
        keyword, *words = line.split() or [b""]
        if keyword in (b"comment", b"obj_info"):
            continue
        if not line.isascii():
            raise _meaningless(line)
        if keyword == b"format" and order is None and words[1:] == [b"1.0"]:
            order = _ENCODINGS.get(words[0])
        elif keyword == b"element" and len(words) == 2 and re.fullmatch(rb"\d{1,18}", words[1]):
            elements.append(Element(_word(words[0]), int(words[1]), []))
        elif keyword == b"property" and elements and _types_known(words):
            kinds = [_TYPES[_word(word)] for word in words[:-1] if word != b"list"]
            added = Property(_word(words[-1]), kinds[-1], kinds[0] if len(kinds) > 1 else None)
            elements[-1].properties.append(added)
        else:
            raise _meaningless(line)
    if order is None:
        raise FileFormatError(
            f"the PLY header must name one of the formats {b', '.join(_ENCODINGS).decode()}, "
            "version 1.0"
        )
    for names in (
        [element.name for element in elements],
        *([each.name for each in element.properties] for element in elements),
    ):
        if len(names) > len(set(names)):
            name = Counter(names).most_common(1)[0][0]
            raise FileFormatError(f"the PLY header declares {name[:SHOWN]} twice")
    return order, elements, content[start:]


def _types_known(words: list[bytes]) -> bool:
    """Tell whether the declaration of a property is valid; lengths are whole numbers."""
    if words[:1] == [b"list"]:
        return (
            len(words) == 4
            and all(_word(word) in _TYPES for word in words[1:3])
            and (_TYPES[_word(words[1])][0] in "iu")
        )
    return len(words) == 2 and _word(words[0]) in _TYPES


def _meaningless(line: bytes) -> FileFormatError:
    return FileFormatError(f"the PLY header has a line that is not valid: {shown_line(line)}")


def _word(word: bytes) -> str:
    return word.decode("latin-1")


def shown_line(line: bytes) -> str:
    """Return a line, shortened, for a message.

    Parameters
    ----------
    line : bytes
        The line.
    """
    return repr(_word(line.strip())[:SHOWN])


_POSITION, _NORMAL = ("x", "y", "z"), ("nx", "ny", "nz")
_CORNERS = ("vertex_indices", "vertex_index")
_NUMBERS: dict[str, Callable[[bytes], float]] = {"f": float, "i": int, "u": int}
# Double precision holds no larger whole numbers exactly.
_WHOLE = 2**53
# NumPy allows no larger rows.
_LONGEST_ROW = 2**31 - 1


class _Column(NamedTuple):
    """The numbers of a property, row after row, and their count in each row."""

    values: np.ndarray
    lengths: np.ndarray


_Columns = dict[str, _Column]


def read_ply(content: bytes) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and triangles of a PLY file.

    Parameters
    ----------
    content : bytes
        The file: text, or binary of either byte order, with any line ends.

    Returns
    -------
    vertices : array, shape (V, 3)
    faces : array, shape (F, 3)
        In the file's order; indices are not checked.

    Raises
    ------
    FileFormatError
        If the file is damaged, has no vertices, no faces or more data than it declares, a required
        property is missing or declared twice, or a face has fewer than three corners.
    """
    order, elements, body = read_header(content)
    declared = {element.name: element.n_rows for element in elements}
    n_vertices, n_faces = (declared.get(name, 0) for name in ("vertex", "face"))
    if n_vertices == 0 or n_faces == 0:
        raise FileFormatError(
            f"the PLY header declares {n_vertices} vertices and {n_faces} faces; a mesh has both"
        )
    corners_name = _name_of_corners(elements)
    tables = _tables(order, elements, body, {"vertex": _POSITION, "face": (corners_name,)})
    corners = tables["face"][corners_name]
    return _stacked(tables["vertex"], _POSITION), split_polygons(corners.values, corners.lengths)


def read_ply_points(content: bytes) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the vertices of a PLY file of loose points, and their normals.

    Parameters
    ----------
    content : bytes
        The file, as for `read_ply`; faces are ignored.

    Returns
    -------
    points : array, shape (N, 3)
    normals : array, shape (N, 3), or None
        Unit normals or others, if the file has them.

    Raises
    ------
    FileFormatError
        If the file is damaged or has no vertices.
    """
    order, elements, body = read_header(content)
    found = [element for element in elements if element.name == "vertex" and element.n_rows]
    if not found:
        raise FileFormatError("the PLY header declares no vertices")
    single = {each.name for each in found[0].properties if each.length_kind is None}
    has_normals = single.issuperset(_NORMAL)
    wanted = _POSITION + (_NORMAL if has_normals else ())
    table = _tables(order, elements, body, {"vertex": wanted})["vertex"]
    return _stacked(table, _POSITION), _stacked(table, _NORMAL) if has_normals else None


def has_ply_faces(content: bytes) -> bool:
    """Tell whether a PLY file has faces.

    Parameters
    ----------
    content : bytes
        The file.

    Raises
    ------
    FileFormatError
        If its header is damaged.
    """
    return any(element.name == "face" and element.n_rows for element in read_header(content)[1])


def _tables(
    order: str, elements: list[Element], body: bytes, wanted: dict[str, tuple[str, ...]]
) -> dict[str, _Columns]:
    """Return columns of the elements of a file, at least the wanted ones."""
    _check_positions(elements)
    read = (
        _binary_columns(body, elements, order, wanted) if order else _text_columns(body, elements)
    )
    return dict(zip((element.name for element in elements), read, strict=True))


def _stacked(columns: _Columns, names: tuple[str, ...]) -> np.ndarray:
    return np.stack([columns[name].values for name in names], axis=1)


def _name_of_corners(elements: list[Element]) -> str:
    (face,) = (element for element in elements if element.name == "face")
    found = [each for each in face.properties if each.name in _CORNERS]
    if len(found) != 1 or found[0].length_kind is None:
        raise FileFormatError(
            f"the faces of a PLY file must have one list {' or '.join(_CORNERS)}; found "
            f"{', '.join(each.name[:SHOWN] for each in face.properties[:10]) or 'none'}"
        )
    return found[0].name


def _check_positions(elements: list[Element]) -> None:
    (vertex,) = (element for element in elements if element.name == "vertex")
    single = [each.name for each in vertex.properties if each.length_kind is None]
    missing = [axis for axis in "xyz" if axis not in single]
    if missing:
        raise FileFormatError(
            f"the vertices of a PLY file must have numbers x, y and z; {', '.join(missing)} missing"
        )


def _text_columns(body: bytes, elements: list[Element]) -> Iterator[_Columns]:
    """Yield the columns of every element of a text file, in which each row is a line."""
    if b"_" in body:
        raise FileFormatError("the PLY file holds an underscore among its numbers")
    lines = iter(body.splitlines())
    for element in elements:
        yield _of_text(lines, element)
    rest = next((line for line in lines if line.strip()), None)
    if rest is not None:
        raise FileFormatError(
            f"the file has more lines than its PLY header declares: {shown_line(rest)}"
        )


def _of_text(lines: Iterator[bytes], element: Element) -> _Columns:
    parts = [(each, _NUMBERS[each.kind[0]], array("d"), array("d")) for each in element.properties]
    for row in range(element.n_rows):
        line = next(lines, None)
        if line is None:
            raise FileFormatError(
                f"truncated: the PLY header declares {element.n_rows} rows of "
                f"{element.name[:SHOWN]}; {row} found"
            )
        words = line.split()
        position = 0
        try:
            for each, number, values, lengths in parts:
                length = 1
                if each.length_kind is not None:
                    length = int(words[position])
                    position += 1
                if not 0 <= length <= len(words) - position:
                    raise ValueError
                values.extend(map(number, words[position : position + length]))
                lengths.append(length)
                position += length
            if position != len(words):
                raise ValueError
        except (IndexError, OverflowError, ValueError) as error:
            raise FileFormatError(
                f"row {row} of {element.name[:SHOWN]} is not what the PLY header declares: "
                f"{shown_line(line)}"
            ) from error
    return {
        each.name: _Column(
            _of_kind(values, each.kind, each.name),
            _of_kind(lengths, each.length_kind or "u1", each.name).astype(np.int64),
        )
        for each, _, values, lengths in parts
    }


def _of_kind(numbers: array[float], kind: str, name: str) -> np.ndarray:
    """Return numbers in their declared type."""
    found = np.array(numbers)
    if kind[0] != "f" and found.size:
        limits = np.iinfo(kind)
        lowest, highest = max(limits.min, -_WHOLE), min(limits.max, _WHOLE)
        if not lowest <= found.min() <= found.max() <= highest:
            raise FileFormatError(
                f"{name[:SHOWN]} holds numbers beyond its type: {found.min():g} to {found.max():g}"
            )
    with np.errstate(over="ignore"):  # infinite numbers are refused later, by name
        return found.astype(kind)


def _binary_columns(
    body: bytes, elements: list[Element], order: str, wanted: dict[str, tuple[str, ...]]
) -> Iterator[_Columns]:
    """Yield the wanted columns of every element of binary data."""
    start = 0
    for element in elements:
        least = sum(each.least for each in element.properties)
        if least * element.n_rows > len(body) - start:
            raise _truncated(element)
        columns, start = _of_binary(body, start, element, order, wanted.get(element.name, ()))
        yield columns
    if start != len(body):
        raise FileFormatError(
            f"the file has {len(body) - start} bytes more than its PLY header declares"
        )


def _of_binary(
    body: bytes, start: int, element: Element, order: str, wanted: tuple[str, ...]
) -> tuple[_Columns, int]:
    """Return the wanted columns of an element, and the start of the next element."""
    if element.n_rows == 0 or not element.properties:
        return {}, start
    table = _table(body, start, element, order)
    if table is None:
        return _row_by_row(body, start, element, order, wanted)
    columns = {}
    for number, each in enumerate(element.properties):
        if each.name in wanted:
            values = table[f"values {number}"]
            columns[each.name] = _Column(values.ravel(), np.full(len(table), values.shape[1]))
    return columns, start + table.nbytes


def _table(body: bytes, start: int, element: Element, order: str) -> np.ndarray | None:
    """Return the rows of an element as a table if all lists are as long as in the first row."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    position = start
    for number, each in enumerate(element.properties):
        length = 1
        if each.length_kind is not None:
            length = _length(body, position, each.length_kind, order)
            if length < 0:
                return None
            fields.append((f"length {number}", order + each.length_kind, ()))
            position += each.least
        fields.append((f"values {number}", order + each.kind, (length,)))
        position += length * int(each.kind[1:])
    row = position - start
    if row > _LONGEST_ROW or row * element.n_rows > len(body) - start:
        return None
    table = np.frombuffer(body, np.dtype(fields), element.n_rows, start)
    names = [name for name, _, _ in fields if name.startswith("length")]
    return table if all((table[name] == table[name][0]).all() for name in names) else None


def _row_by_row(
    body: bytes, start: int, element: Element, order: str, wanted: tuple[str, ...]
) -> tuple[_Columns, int]:
    """Return what `_of_binary` does for an element whose lists differ in length."""
    parts = [(each, int(each.kind[1:]), array("q"), array("q")) for each in element.properties]
    position = start
    for row in range(element.n_rows):
        for each, size, starts, lengths in parts:
            length = 1
            if each.length_kind is not None:
                length = _length(body, position, each.length_kind, order)
                position += each.least
            if length < 0:
                raise FileFormatError(
                    f"{each.name[:SHOWN]} of {element.name[:SHOWN]} {row} has a negative length"
                )
            if position + length * size > len(body):
                raise _truncated(element)
            if each.name in wanted:
                starts.append(position)
                lengths.append(length)
            position += length * size
    columns = {}
    for each, size, starts, lengths in parts:
        if each.name in wanted:
            pairs = zip(starts, lengths, strict=True)
            data = b"".join(body[first : first + length * size] for first, length in pairs)
            values = np.frombuffer(data, order + each.kind)
            columns[each.name] = _Column(values, np.array(lengths))
    return columns, position


def _length(body: bytes, position: int, kind: str, order: str) -> int:
    """Return the length of a list; missing bytes at the end of the data count as zero."""
    found = body[position : position + int(kind[1:])]
    return int.from_bytes(found, "little" if order == "<" else "big", signed=kind[0] == "i")


def _truncated(element: Element) -> FileFormatError:
    return FileFormatError(
        f"truncated: {element.n_rows} rows of {element.name[:SHOWN]}, as the PLY header declares, "
        "take more bytes than there are"
    )
