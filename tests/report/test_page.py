"""Tables: the page and the file say the same."""

import csv
import io
import re

import numpy as np

from riemhuman.report._page import Column, Table

ROWS = [
    {"name": "a < b", "score": 99.0 + 1 / 3, "time": 0.25, "count": 3, "note": "x"},
    {"name": "c", "score": 12.0, "time": float("nan"), "count": 40, "note": None},
    {"name": "d", "score": -1e-9, "time": 0.125, "count": np.int64(5), "note": "y, z"},
]
TABLE = Table(
    "made-up",
    "What it says.",
    (
        Column("name", "Name"),
        Column("score", "Score", ".1f", "highest"),
        Column("time", "Time", ".2f", "lowest"),
        Column("count", "Count", "d"),
        Column("note", "Note", is_shown=False),
    ),
    ROWS,
)


def test_the_file_keeps_all_digits():
    first, *rest = csv.reader(io.StringIO(TABLE.csv()))
    assert first == ["name", "score", "time", "count", "note"]
    assert [row[0] for row in rest] == ["a < b", "c", "d"]
    assert [float(row[1]) for row in rest] == [row["score"] for row in ROWS]
    assert [row[2] for row in rest] == ["0.25", "", "0.125"]
    assert [row[4] for row in rest] == ["x", "", "y, z"]


def test_the_file_is_no_program():
    table = Table("made-up", "", (Column("name", "Name"),), [{"name": "=1+1"}, {"name": -1.5}])
    assert table.csv() == "name\n'=1+1\n-1.5\n"


def test_numbers_of_the_page_carry_those_of_the_file():
    rows = list(csv.DictReader(io.StringIO(TABLE.csv())))
    found = re.findall(
        r'<data value="([^"]*)" data-table="made-up" data-row="(\d+)" data-column="(\w+)">([^<]*)<',
        TABLE.html(),
    )
    assert len(found) == 8  # three columns of three numbers, one of them missing
    for value, row, column, shown in found:
        assert value == rows[int(row)][column]
        form = {"score": ".1f", "time": ".2f", "count": "d"}[column]
        number = int(value) if form == "d" else float(value)
        assert shown == format(number, form).replace("-", "−")


def test_the_best_is_marked():
    bold = re.findall(r"<strong[^>]*><data value=\"([^\"]*)\"", TABLE.html())
    assert bold == [repr(ROWS[0]["score"]), "0.125"]
    alone = Table("one", "", TABLE.columns, ROWS[:1])
    assert "<strong" not in alone.html()


def test_text_is_escaped_and_hidden_columns_stay_in_the_file():
    html = TABLE.html()
    assert "a &lt; b" in html
    assert "Note" not in html
    assert 'href="tables/made-up.csv"' in html
    assert html.count('scope="row"') == 3
