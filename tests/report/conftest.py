"""A small set of bodies, and figures closed after every test."""

import numpy as np
import pytest

from riemhuman.datasets import Bodies, load_open_bodies
from riemhuman.report import make_report


@pytest.fixture(scope="session")
def nine_bodies():
    """Return three people in three poses, coarse."""
    bodies = load_open_bodies("coarse")
    chosen = np.flatnonzero(np.isin(bodies.subject, [0, 5, 8]) & np.isin(bodies.pose, [0, 1, 3]))
    per_body = ("points", "subject", "pose", "betas", "pose_vectors", "translations")
    kept = {name: getattr(bodies, name)[chosen] for name in per_body}
    whole = ("template", "model", "subject_names", "pose_names")
    return Bodies(**kept, **{name: getattr(bodies, name) for name in whole})


@pytest.fixture(scope="session")
def report_page(tmp_path_factory, nine_bodies):
    """Return the page of a report on nine bodies."""
    output = tmp_path_factory.mktemp("reports") / "report"
    page = make_report(output, bodies=nine_bodies, quick=True)
    assert page == output / "index.html"
    return page


@pytest.fixture(autouse=True)
def _figures_closed():
    yield
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.close("all")
