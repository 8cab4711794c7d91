"""PLY files of every layout that is legal, written from the specification and judged by plyfile."""

import io
import struct

import numpy as np
import pytest
from plyfile import PlyData

from riemhuman.errors import FileFormatError
from riemhuman.io.meshes import load_mesh

ENCODINGS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
CODES = {"char": "b", "uchar": "B", "short": "h", "int": "i", "uint": "I", "float": "f"}
CODES |= {"double": "d"}
POSITIONS = [("float", "x"), ("float", "y"), ("float", "z")]
CORNERS = [("uchar", "int", "vertex_indices")]
VERTICES = [[0.5, 0, 1], [1, 0.25, 0], [0, 1, 0], [2, 2, 2]]
FACES = [[[0, 1, 2]], [[3, 2, 1]]]
BODY = [("vertex", POSITIONS, VERTICES), ("face", CORNERS, FACES)]


def ply(elements, encoding, line_end="\n"):
    """Return a PLY file: elements are (name, properties, rows), and lists stand in their rows."""
    order = ENCODINGS[encoding]
    header, body = ["ply", f"format {encoding} 1.0", "comment a body"], b""
    for name, properties, rows in elements:
        header.append(f"element {name} {len(rows)}")
        header += [
            f"property {'list ' if len(each) == 3 else ''}{' '.join(each)}" for each in properties
        ]
        for row in rows:
            numbers, codes = [], ""
            for each, value in zip(properties, row, strict=True):
                values = value if len(each) == 3 else [value]
                if len(each) == 3:
                    numbers, codes = numbers + [len(values)], codes + CODES[each[0]]
                numbers, codes = numbers + list(values), codes + CODES[each[-2]] * len(values)
            body += (
                struct.pack(order + codes, *numbers)
                if order
                else (" ".join(map(repr, numbers)) + line_end).encode()
            )
    return line_end.join([*header, "end_header", ""]).encode() + body


def assert_reads(tmp_path, content):
    """Assert that a file is read as the mesh above, by plyfile and by the library."""
    judge = PlyData.read(io.BytesIO(content))
    assert [face.tolist() for face in judge["face"]["vertex_indices"]] == [f[0] for f in FACES]
    (tmp_path / "body.ply").write_bytes(content)
    vertices, faces = load_mesh(tmp_path / "body.ply")
    np.testing.assert_array_equal(vertices, VERTICES)
    np.testing.assert_array_equal(faces, [face[0] for face in FACES])


def assert_refused(tmp_path, content, message):
    (tmp_path / "body.ply").write_bytes(content)
    with pytest.raises(FileFormatError, match=message):
        load_mesh(tmp_path / "body.ply")


RAGGED = [[[1, 2]], [[]], [[3, 4, 5]], [[6]]]
RAGGED_PROPERTY = ("uchar", "short", "neighbours")
LAYOUTS = {
    "lists before the vertices": [("strip", [RAGGED_PROPERTY], RAGGED), *BODY],
    "equal sums of lengths before the vertices": [
        ("strip", [RAGGED_PROPERTY], [[[1]], [[2, 3]], [[]]]),
        *BODY,
    ],
    "lists per vertex": [
        (
            "vertex",
            [RAGGED_PROPERTY, *POSITIONS],
            [[*extra, *row] for extra, row in zip(RAGGED, VERTICES, strict=True)],
        ),
        BODY[1],
    ],
    "lists per face": [
        BODY[0],
        ("face", [*CORNERS, RAGGED_PROPERTY], [[*FACES[0], [1, 2, 3, 4]], [*FACES[1], [7]]]),
    ],
    "faces first": BODY[::-1],
    "long lengths": [BODY[0], ("face", [("int", "uint", "vertex_indices")], FACES)],
    "numbers between": [
        ("vertex", [POSITIONS[2], ("uchar", "red"), *POSITIONS[:2]], [
            [z, 255, x, y] for x, y, z in VERTICES
        ]),
        BODY[1],
    ],
    "something behind": [*BODY, ("edge", [("int", "vertex1"), ("int", "vertex2")], [[0, 1]])],
    "elements without rows": [("camera", POSITIONS, []), *BODY, ("strip", [RAGGED_PROPERTY], [])],
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:loadtxt")  # plyfile, of empty lists
@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_legal_layout_is_read(tmp_path, layout, encoding):
    assert_reads(tmp_path, ply(LAYOUTS[layout], encoding))


@pytest.mark.parametrize("encoding", ENCODINGS)
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_every_line_end_is_read(tmp_path, encoding, line_end):
    assert_reads(tmp_path, ply(BODY, encoding, line_end))


def test_binary_data_may_begin_like_a_line_end(tmp_path):
    strip = ("strip", [("uchar", "a")], [[10], [13]])
    assert_reads(tmp_path, ply([strip, *BODY], "binary_little_endian", "\r"))


def test_comments_in_any_encoding(tmp_path):
    content = ply(BODY, "ascii").replace(b"a body", "ein Körper".encode("latin-1"))
    (tmp_path / "body.ply").write_bytes(content)
    assert load_mesh(tmp_path / "body.ply")[0].tolist() == VERTICES


@pytest.mark.parametrize("encoding", list(ENCODINGS)[1:])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_no_byte_may_be_missing_or_follow(tmp_path, layout, encoding):
    content = ply(LAYOUTS[layout], encoding)
    assert_refused(tmp_path, content[:-1], "truncated|takes more bytes")
    assert_refused(tmp_path, content + b"\0", "1 bytes more than its PLY header declares")


def test_lines_that_are_not_declared(tmp_path):
    assert_refused(tmp_path, ply(BODY, "ascii") + b"\n3 0 1 2\n", "more lines than .*'3 0 1 2'")
    assert_refused(tmp_path, ply(BODY, "ascii").replace(b"\n3 ", b" 1\n3 "), "row 3 of vertex")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (b"float x", b"float u", "x missing"),
        (b"float y", b"float x", "declares x twice"),
        (b"element face", b"element vertex", "declares vertex twice"),
        (b"float z", b"real z", "is not valid: 'property real z'"),
        (b"list uchar", b"list float", "is not valid"),
        (b"vertex_indices", b"corners", "one list vertex_indices or vertex_index; found corners"),
        (b"list uchar int", b"int", "one list vertex_indices"),
        (b"1.0\n", b"2.0\n", "is not valid: .format ascii 2.0."),
        (b"format ascii", b"format text", "must name one of the formats"),
        (b"vertex 4", b"vertex 1_0", "is not valid: 'element vertex 1_0'"),
        (b"vertex 4", b"vertex -4", "is not valid: 'element vertex -4'"),
        (b"float z", "float z\nproperty float é".encode(), "is not valid: 'property float"),
        (b"3 0 1 2", b"3 0 1 1_0", "an underscore among its numbers"),
        (b"3 0 1 2", b"3 0 1 2.0", "row 0 of face"),
        (b"3 0 1 2", b"3 0 1 2147483648", "vertex_indices holds numbers beyond its type"),
        (b"3 0 1 2", b"-1 0 1 2", "row 0 of face"),
        (b"3 0 1 2", b"259 0 1 2", "row 0 of face"),
        (b"0.5 0 1\n", "0.5 0\u2028 1\n".encode(), "row 0 of vertex"),
        (b"0.5 0 1\n", b"0.5 0 1\n\n", "row 1 of vertex"),
    ],
)
def test_what_the_format_does_not_know(tmp_path, old, new, message):
    content = ply(BODY, "ascii")
    assert old in content
    assert_refused(tmp_path, content.replace(old, new, 1), message)


@pytest.mark.parametrize("encoding", list(ENCODINGS)[1:])
def test_lengths_and_counts_at_the_edges_of_their_types(tmp_path, encoding):
    order = ENCODINGS[encoding]
    ragged = ply([("strip", [("int", "double", "a")], [[[1.0]], [[1.0, 2.0]]]), *BODY], encoding)
    length = struct.pack(order + "i", 2)
    for wrong in (-(2**31), -1, 2**31 - 1):
        broken = ragged.replace(length, struct.pack(order + "i", wrong), 1)
        assert_refused(tmp_path, broken, "truncated|negative length")
    for n_rows in (2**31, 2**56, 10**18 - 1):
        broken = ragged.replace(b"strip 2", b"strip %d" % n_rows)
        assert_refused(tmp_path, broken, "truncated")


def test_a_header_of_many_properties_takes_no_time(tmp_path):
    many = b"".join(b"property int a%d\n" % number for number in range(50_000))
    content = ply(BODY, "ascii").replace(b"property float z\n", b"property float z\n" + many)
    assert_refused(tmp_path, content, "row 0 of vertex")
