"""The report on a small set of bodies."""

import pytest
from third_party import Extents, VertexOffsets

from riemhuman import extensions
from riemhuman.report import make_report
from riemhuman.surfaces import DeformationBasis


@pytest.fixture(scope="session")
def make_small_report(tmp_path_factory, nine_bodies):
    """Return a function that makes one report, also by what another package registers."""
    output = tmp_path_factory.mktemp("reports") / "report"
    basis = DeformationBasis.from_laplacian(nine_bodies.template, 10)
    added = (("metrics", "offsets", VertexOffsets), ("descriptors", "extents", Extents))

    def make():
        for one in added:
            extensions.register(*one)
        try:
            return make_report(output, bodies=nine_bodies, basis=basis, quick=True)
        finally:
            for kind, name, _ in added:
                extensions.unregister(kind, name)

    return make


@pytest.fixture(scope="session")
def report_page(make_small_report):
    """Return the page of the report."""
    return make_small_report()
