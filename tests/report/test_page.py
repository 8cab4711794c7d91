"""Tables: the page and the file say the same."""

import csv
import io
import re
from contextlib import nullcontext

import numpy as np
import PIL.features
import pytest

from riemhuman.report._page import Output, Table, template

ROWS = [
    {"pair": "a < b", "metric_part": 99.0 + 1 / 3, "normal_part": 0.25, "squared_distance": 3.0},
    {"pair": "=1+1", "metric_part": 12.0, "normal_part": np.nan, "squared_distance": None},
    {"pair": "d", "metric_part": -1e-9, "normal_part": 0.125, "squared_distance": np.float64(5)},
]
TABLE = Table("made-up", ROWS)


@pytest.fixture
def html():
    """Return the table as part of a page."""
    parts = template("parts.html").module
    columns = [
        ("pair", "Pair"),
        ("metric_part", "Metric", ".1f", "highest"),
        ("normal_part", "Normal", ".2f", "lowest"),
        ("absent", "Absent"),
    ]
    return str(parts.table(TABLE, "What it shows.", columns))


def test_files_keep_all_digits_and_run_nothing():
    first, *rest = csv.reader(io.StringIO(TABLE.csv()))
    assert first == list(ROWS[0])
    assert [row[0] for row in rest] == ["a < b", "'=1+1", "d"]
    assert [float(row[1]) for row in rest] == [row["metric_part"] for row in ROWS]
    assert [row[2] for row in rest] == ["0.25", "", "0.125"]
    assert [row[3] for row in rest] == ["3.0", "", "5.0"]


def test_numbers_of_the_page_carry_those_of_the_file(html):
    rows = list(csv.DictReader(io.StringIO(TABLE.csv())))
    found = re.findall(
        r'<data value="([^"]*)" data-table="made-up" data-row="(\d+)" data-column="(\w+)">([^<]*)<',
        html,
    )
    assert len(found) == 5  # two columns of three numbers, one of them missing
    for value, row, column, shown in found:
        assert value == rows[int(row)][column]
        form = {"metric_part": ".1f", "normal_part": ".2f"}[column]
        assert shown == format(float(value), form).replace("-", "−")


def test_long_tables_show_their_first_rows():
    """All rows are in the page: a button shows the rest, and so does print."""
    columns = [("name", "Name"), ("value", "Value", ".1f")]

    def html_of(n_rows):
        rows = [{"name": f"row {k}", "value": float(k)} for k in range(n_rows)]
        table = Table("long", rows)
        return str(template("parts.html").module.table(table, "What it shows.", columns))

    assert "folded" not in html_of(15)
    assert "<button" not in html_of(15)
    assert html_of(16).count("<data") == 16
    assert 'class="table long folded"' in html_of(16)
    assert "Show all 16 rows" in html_of(16)


def test_figures_of_the_page_have_smaller_pictures(tmp_path):
    """The file for other programs has PNG pictures, the page the same in WebP."""
    noise = np.random.default_rng(0).random((20, 30))
    (tmp_path / "figures").mkdir()

    def draw(ax):
        ax.imshow(np.kron(noise, np.ones((10, 10))))

    image = Output(tmp_path, 300, nullcontext).figure("noise", draw, size=(4.0, 3.0))
    written = (tmp_path / "figures" / "noise.svg").read_text(encoding="utf-8")
    assert "data:image/png" in written
    if PIL.features.check("webp"):
        assert "data:image/webp" in image.source
        assert "data:image/png" not in image.source


def test_the_best_is_marked_and_text_is_escaped(html):
    bold = re.findall(r"<strong[^>]*><data value=\"([^\"]*)\"", html)
    assert bold == [repr(ROWS[0]["metric_part"]), "0.125"]
    assert not Table("one", ROWS[:1]).is_best(0, "metric_part", "highest")
    assert "a &lt; b" in html
    assert "Absent" not in html
    assert 'href="tables/made-up.csv"' in html
    assert html.count('scope="row"') == 3
