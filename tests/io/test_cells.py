"""Cells of tables: one line each, and never code."""

import pytest

from riemhuman.io.text_tables import csv_cell


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("anna 1.ply", "anna 1.ply"),
        ("Zoë", "Zoë"),
        ("=cmd|'/c calc'!A1", "'=cmd|'/c calc'!A1"),
        ("+1", "'+1"),
        ("-1", "'-1"),
        ("@SUM(A1)", "'@SUM(A1)"),
        (" =1", "' =1"),
        ("\t=1", "' =1"),
        ("\n=1", "' =1"),
        ("two\nlines\r\n", "two lines  "),
        ("two\u2028lines", "two lines"),
        ("nothing\0", "nothing "),
        ("\udcff.ply", "\\udcff.ply"),
        ("", ""),
    ],
)
def test_cells(text, expected):
    assert csv_cell(text) == expected
