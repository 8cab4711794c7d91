"""Tables of text: what they hold, and what is refused by its line."""

import pytest

from riemhuman.errors import FileFormatError
from riemhuman.io.text_tables import csv_cell, read_named_rows, read_rows


def test_cells_are_one_line_and_no_formulas():
    for text, expected in [
        ("Zoë 1.ply", "Zoë 1.ply"),
        ("=cmd|'/c calc'!A1", "'=cmd|'/c calc'!A1"),
        ("-1", "'-1"),
        ("\t=1", "' =1"),
        ("two\nlines\r\n", "two lines  "),
        ("two\u2028lines", "two lines"),
        ("\udcff.ply", "\\udcff.ply"),
        ("", ""),
    ]:
        assert csv_cell(text) == expected


def test_named_rows(tmp_path):
    file = tmp_path / "rows.csv"
    file.write_text("Name, x, y\nanna, 1, 2\n\nbert,3,-4e1\n")
    rows = read_named_rows(file, "name")
    assert {name: row.tolist() for name, row in rows.items()} == {"anna": [1, 2], "bert": [3, -40]}
    for text, message in [
        ("", "holds no rows"),
        ("a,1\na,2\n", "line 2: the name 'a' is repeated"),
        ("a,1\n,2\n", "line 2: the name is missing"),
        ("a,1\nb,2,3\n", "line 2: 2 numbers found, 1 expected"),
        ("a,1\nb,two\n", "line 2: 'two' is not a number"),
        ('a,"1\n', "line 1"),
    ]:
        file.write_text(text)
        with pytest.raises(FileFormatError, match=message):
            read_named_rows(file, "name")


def test_cells_longer_than_readers_take_are_refused(tmp_path):
    file = tmp_path / "labels.csv"
    file.write_text(f"file,subject,pose\na.ply,{'x' * 200_000},b\n")
    for read in (read_rows, lambda file: read_named_rows(file, "name")):
        with pytest.raises(FileFormatError, match=r"labels\.csv, line 2: field larger than"):
            read(file)
