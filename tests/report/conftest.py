"""The report on a small set of bodies."""

import os

import numpy as np
import pytest
from empty_figures import leave_empty
from filelock import FileLock
from scipy.spatial.transform import Rotation
from third_party import Extents, VertexOffsets

import riemhuman as rh
from riemhuman import extensions
from riemhuman.registration.folders import ScanRecord
from riemhuman.report import make_report, printing, sheet_folders
from riemhuman.surfaces import DeformationBasis


@pytest.fixture(scope="session")
def make_small_report(nine_bodies):
    """Return a function that makes one report, also by what another package registers."""
    basis = DeformationBasis.from_laplacian(nine_bodies.template, 10)
    added = (("metrics", "offsets", VertexOffsets), ("descriptors", "extents", Extents))

    def make(output):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(extensions, "_REGISTERED", {kind: {} for kind in extensions.KINDS})
            for one in added:
                extensions.register(*one)
            return make_report(output, bodies=nine_bodies, basis=basis, quick=True)

    return make


def _shared_page(name, make_small_report, tmp_path_factory):
    """Return the page of a report, which the workers of a session share, and only read."""
    root = tmp_path_factory.getbasetemp()
    output = (root.parent if "PYTEST_XDIST_WORKER" in os.environ else root) / name
    with FileLock(output.with_name(f"{name}.lock")):
        page = output / "index.html"
        return page if page.exists() else make_small_report(output)


@pytest.fixture(scope="session")
def report_page(make_small_report, tmp_path_factory):
    """Return the page of the report, its figures empty."""
    with pytest.MonkeyPatch.context() as patch:
        leave_empty(patch)
        return _shared_page("report", make_small_report, tmp_path_factory)


@pytest.fixture(scope="session")
def drawn_report_page(make_small_report, tmp_path_factory):
    """Return the page of the report, with its figures."""
    return _shared_page("drawn_report", make_small_report, tmp_path_factory)


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse", people=2)


@pytest.fixture(scope="module")
def measurements(bodies):
    return rh.measurements.Measurements(bodies.model)


@pytest.fixture(autouse=True)
def small_pictures(monkeypatch):
    """Draw faster, with a third of the pixels."""

    def render_small(points, faces, *, height, **settings):
        return rh.plots.render(points, faces, height=height // 3, **settings)

    monkeypatch.setattr("riemhuman.report._sheet_pictures.render", render_small)


@pytest.fixture
def no_browser(monkeypatch):
    """Hide browsers from whatever writes PDF files, which take most of the time."""
    for module in (printing, sheet_folders):
        monkeypatch.setattr(module, "find_browser", lambda: None)


@pytest.fixture(scope="module")
def record(bodies):
    """Return the record of a scan that lies on its side, and does not show the feet."""
    points = bodies[0]
    shown = points[points[:, 1] > points[:, 1].min() + 0.25]
    transform = np.eye(4)
    transform[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    in_scan = transform[:3, :3].T
    trusted = points[:, 1] > points[:, 1].min() + 0.25
    return ScanRecord(
        name="half",
        trusted=True,
        message="the feet were not seen (7 % of the body)",
        likelihood=2.0,
        median_distance=0.0021,
        matched_share=0.66,
        arrays={
            "points": points @ in_scan.T,
            "transform": transform,
            "shown": (shown @ in_scan.T).astype(np.float32),
            "trusted_vertices": trusted,
            "faces": bodies.template.faces,
        },
    )


@pytest.fixture
def folder(bodies, tmp_path):
    """Return a folder with two visits of one person, another person, and labels."""
    place = tmp_path / "bodies"
    place.mkdir()
    for name, number in (("emma_1", 0), ("emma_2", 3), ("index", 12)):
        rh.save_mesh(place / f"{name}.ply", bodies[number], bodies.template.faces)
    rows = ["file;person;sex;date", "emma_2.ply;Emma;F;2026-06-01", "emma_1;Emma;woman;2026-02-28"]
    (place / "labels.csv").write_text("\n".join([*rows, "index.ply;=Ada;;"]), encoding="utf-8")
    return place
