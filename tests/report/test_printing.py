"""PDF files of sheets, which a browser prints."""

import re

import pytest

import riemhuman as rh
from riemhuman.errors import FileError, FileFormatError, MissingDependencyError
from riemhuman.report import printing
from riemhuman.report import sheets as sheets_module


def pages_of(file):
    return len(re.findall(rb"/Type\s*/Page\b", file.read_bytes()))


@pytest.mark.slow
def test_the_browser_prints_two_pages(bodies, record, tmp_path):
    if printing.find_browser() is None:
        pytest.skip("there is no browser")
    later = bodies[0] * [1.04, 1.0, 1.04]
    for sheet in (rh.report.sheet(record), rh.report.sheet(later, before=bodies[0])):
        sheet.save(tmp_path / "sheet.pdf")
        assert pages_of(tmp_path / "sheet.pdf") == 2
    assert [file.name for file in tmp_path.iterdir()] == ["sheet.pdf"]


@pytest.mark.slow
def test_the_printed_page_takes_the_place_of_no_other(bodies, tmp_path, monkeypatch):
    """The browser reads it from a file beside the PDF, which is removed afterwards."""
    printed = []

    def print_page(browser, page, pdf):
        printed.append(page.read_text(encoding="utf-8"))
        pdf.write_bytes(b"%PDF")

    monkeypatch.setattr(sheets_module, "printing_browser", lambda: "browser")
    monkeypatch.setattr(printing, "print_page", print_page)
    longest = "e" * 251  # bytes that leave room for an ending of four
    rh.report.sheet(bodies[0]).save(tmp_path / f"{longest}.pdf")
    assert "stature" in printed[0]
    assert len(list(tmp_path.iterdir())) == 1


def test_what_does_not_print_is_said(record, tmp_path, monkeypatch):
    sheet = rh.report.sheet(record, name="Emma $1 and some more words " * 4, sex="woman")
    sheet.save(tmp_path / "emma.html")
    assert (tmp_path / "emma.html").read_text(encoding="utf-8") == sheet.html
    with pytest.raises(FileFormatError, match=r"must be \.html or \.pdf"):
        sheet.save(tmp_path / "emma.txt")
    monkeypatch.setattr(printing, "find_browser", lambda: None)
    with pytest.raises(MissingDependencyError, match="any browser prints"):
        sheet.save(tmp_path / "emma.pdf")
    monkeypatch.setattr(printing, "find_browser", lambda: "/no/such/browser")
    with pytest.raises(FileError, match="was not printed by /no/such/browser"):
        sheet.save(tmp_path / "emma.pdf")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["emma.html"]
