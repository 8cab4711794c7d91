"""Points and tables as text: separators, headers, decimal commas."""

import numpy as np
import pytest

from riemhuman.errors import FileFormatError
from riemhuman.io import load_points
from riemhuman.io.text_tables import read_named_rows

POINTS = [[0.5, 0.125, -2.0], [1.0, 3.25, 0.0], [1e-3, 7.0, 4.5]]
NORMALS = np.eye(3)


def read(tmp_path, text):
    file = tmp_path / "scan.xyz"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return load_points(file)


def rows(separator, *tables):
    table = np.concatenate([POINTS, *tables], axis=1)
    return "".join(separator.join(map(repr, row)) + "\n" for row in table.tolist())


@pytest.mark.parametrize("separator", [" ", "\t", ",", " ; "])
def test_points_of_every_separator(tmp_path, separator):
    for header in ("", "x{0}y{0}z\n", '"X"{0}"Y"{0}"Z"\n', "# points\n\n"):
        points, faces, normals = read(tmp_path, header.format(separator) + rows(separator))
        np.testing.assert_array_equal(points, POINTS)
        assert faces is None
        assert normals is None


def test_a_first_line_with_the_number_of_points(tmp_path):
    np.testing.assert_array_equal(read(tmp_path, "# scan\r\n 3 \r\n" + rows(";"))[0], POINTS)


def test_columns_that_a_header_names(tmp_path):
    reordered = "id;z;y;x\n" + "".join(f"{k};{z};{y};{x};\n" for k, (x, y, z) in enumerate(POINTS))
    np.testing.assert_array_equal(read(tmp_path, reordered)[0], POINTS)
    text = "x y z nx ny nz red\n" + rows(" ", NORMALS, 255 * np.ones((3, 1)))
    points, _, normals = read(tmp_path, text)
    np.testing.assert_array_equal(points, POINTS)
    np.testing.assert_array_equal(normals, NORMALS)
    np.testing.assert_array_equal(read(tmp_path, b"\xef\xbb\xbf" + rows(" ").encode())[0], POINTS)


@pytest.mark.everyday
@pytest.mark.parametrize(
    "text",
    [
        "0,5 0,1 0,2\n1,5 1,1 0,3\n",
        "0,5,0,1,0\n1,5,1,1,0\n",
        "1,234.5,2,345.6,3,456.7\n1,234.5,2,345.6,3,456.8\n",
        "x y z\n0,5 0,1 0,2\n",
    ],
)
def test_decimal_commas_are_refused(tmp_path, text):
    with pytest.raises(FileFormatError, match=r"scan\.xyz: .*write decimals with a point"):
        read(tmp_path, text)


@pytest.mark.everyday
@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("id x y\n1 2 3\n", r"line 1 is not valid: 'id x y'.* columns x, y and z"),
        ("1 0.5 0.1 0.2\n2 0.5 0.1 0.3\n3 0.1 0.5 0.1\n", "the first column numbers the points"),
        ("0.5;;0.1\n", "line 1 is not valid: '0.5;;0.1'; it should hold numbers"),
        ("0 0 1\n\n0 1\n", "line 3 is not valid: '0 1'; it has 2 numbers, and line 1 has 3"),
        ("3\n0 0 1\n0 1 0\n", "its first line declares 3 points, and 2 follow"),
    ],
)
def test_what_else_is_refused(tmp_path, text, message):
    with pytest.raises(FileFormatError, match=message):
        read(tmp_path, text)


def named_rows(tmp_path, text):
    file = tmp_path / "landmarks.csv"
    file.write_text(text)
    return read_named_rows(file, "name", ("x", "y", "z"))


@pytest.mark.parametrize("header", [None, "joint X Y Z", "name z y x"])
def test_landmarks_of_every_separator(tmp_path, header):
    numbers = [0.62, 1.31, 0.05]
    written = numbers[::-1] if header == "name z y x" else numbers
    for separator in (",", ";", "\t"):
        lines = [] if header is None else [separator.join(header.split())]
        lines.append(separator.join(["left_wrist", *map(str, written)]))
        found = named_rows(tmp_path, "\n".join(lines) + "\n")
        np.testing.assert_array_equal(found["left_wrist"], numbers)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("left_wrist;0,62;1,31;0,05\n", "'0,62' is not a number; write decimals with a point"),
        ("left_wrist,0,62,1,31,0,05\n", "commas may be decimals or separate 6 whole numbers"),
        ("x,y,z,name\n1.0,2.0,3.0,left_wrist\n", "'left_wrist' is not a number"),
    ],
)
def test_landmarks_with_decimal_commas(tmp_path, text, message):
    with pytest.raises(FileFormatError, match=rf"landmarks\.csv.*{message}"):
        named_rows(tmp_path, text)
