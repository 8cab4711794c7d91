"""The report on a small set of bodies."""

import os

import pytest
from filelock import FileLock
from third_party import Extents, VertexOffsets

from riemhuman import extensions
from riemhuman.report import make_report
from riemhuman.surfaces import DeformationBasis


@pytest.fixture(scope="session")
def make_small_report(nine_bodies):
    """Return a function that makes one report, also by what another package registers."""
    basis = DeformationBasis.from_laplacian(nine_bodies.template, 10)
    added = (("metrics", "offsets", VertexOffsets), ("descriptors", "extents", Extents))

    def make(output):
        for one in added:
            extensions.register(*one)
        try:
            return make_report(output, bodies=nine_bodies, basis=basis, quick=True)
        finally:
            for kind, name, _ in added:
                extensions.unregister(kind, name)

    return make


@pytest.fixture(scope="session")
def report_page(make_small_report, tmp_path_factory):
    """Return the page of the report, which the workers of a session share, and only read."""
    root = tmp_path_factory.getbasetemp()
    output = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / "report"
    with FileLock(output.with_name("report.lock")):
        page = output / "index.html"
        return page if page.exists() else make_small_report(output)
