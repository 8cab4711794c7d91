"""PDF files of sheets, by a browser and without one."""

import re

import pytest

import riemhuman as rh
from riemhuman.errors import FileFormatError
from riemhuman.report import _sheet_making, printing
from riemhuman.report import sheets as sheets_module


def pages_of(file):
    return len(re.findall(rb"/Type\s*/Page\b", file.read_bytes()))


@pytest.mark.slow
def test_the_browser_prints_two_sides(bodies, record, tmp_path):
    if printing.find_browser() is None:
        pytest.skip("there is no browser")
    later = bodies[0] * [1.04, 1.0, 1.04]
    for sheet in (rh.report.sheet(record), rh.report.sheet(later, before=bodies[0])):
        sheet.save(tmp_path / "sheet.pdf")
        assert pages_of(tmp_path / "sheet.pdf") == 2
        assert b"Skia" in (tmp_path / "sheet.pdf").read_bytes()
    assert [file.name for file in tmp_path.iterdir()] == ["sheet.pdf"]


def test_the_printed_page_takes_the_place_of_no_other(bodies, tmp_path, monkeypatch):
    """The browser reads it from a file beside the PDF, which is removed afterwards."""
    longest = "e" * 251  # bytes that leave room for an ending of four
    for name in ("emma", longest):
        (tmp_path / f"{name[:200]}.print.html").write_text("mine")
        printed = []

        def print_page(browser, page, pdf, printed=printed):
            printed.append(page.read_text(encoding="utf-8"))
            pdf.write_bytes(b"%PDF")
            return True

        monkeypatch.setattr(sheets_module, "find_browser", lambda: "browser")
        monkeypatch.setattr(_sheet_making, "print_page", print_page)
        rh.report.sheet(bodies[0]).save(tmp_path / f"{name}.pdf")
        assert "stature" in printed[0]
        assert (tmp_path / f"{name[:200]}.print.html").read_text() == "mine"
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.slow
def test_a_browser_that_fails_leaves_it_to_matplotlib(bodies, tmp_path, monkeypatch):
    monkeypatch.setattr(sheets_module, "find_browser", lambda: "/no/such/browser")
    rh.report.sheet(bodies[0]).save(tmp_path / "sheet.pdf")
    assert pages_of(tmp_path / "sheet.pdf") == 2


def test_both_files_of_a_sheet(record, tmp_path, no_browser):
    sheet = rh.report.sheet(record, name="Emma $1 and some more words " * 4, sex="woman")
    sheet.save(tmp_path / "emma.html")
    sheet.save(tmp_path / "emma.pdf")
    assert (tmp_path / "emma.html").read_text(encoding="utf-8") == sheet.html
    assert pages_of(tmp_path / "emma.pdf") == 2
    with pytest.raises(FileFormatError, match=r"must be \.html or \.pdf"):
        sheet.save(tmp_path / "emma.txt")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["emma.html", "emma.pdf"]
