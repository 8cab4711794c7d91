"""Headers of PLY files, which declare their elements and properties."""

from __future__ import annotations

import re
from collections import Counter
from typing import NamedTuple

from riemhuman.errors import FileFormatError

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
