"""The report on a small set of bodies."""

import pytest

from riemhuman.report import make_report


@pytest.fixture(scope="session")
def report_page(tmp_path_factory, nine_bodies):
    """Return the page of a report on nine bodies."""
    output = tmp_path_factory.mktemp("reports") / "report"
    page = make_report(output, bodies=nine_bodies, quick=True)
    assert page == output / "index.html"
    return page
