"""Settings shared by all tests, the one browser of the session, and a few bodies."""

import sys

import numpy as np
import pytest
from headless_browser import opened_browser
from hypothesis import settings

from riemhuman.datasets import Bodies, load_open_bodies

settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def browser():
    """Return a headless browser, which all tests share."""
    with opened_browser() as one:
        yield one


@pytest.fixture(scope="session")
def nine_bodies():
    """Return three people in three poses, coarse."""
    bodies = load_open_bodies("coarse")
    chosen = np.flatnonzero(np.isin(bodies.subject, [0, 5, 8]) & np.isin(bodies.pose, [0, 1, 3]))
    per_body = ("points", "subject", "pose", "betas", "pose_vectors", "translations")
    kept = {name: getattr(bodies, name)[chosen] for name in per_body}
    whole = ("template", "model", "subject_names", "pose_names")
    return Bodies(**kept, **{name: getattr(bodies, name) for name in whole})


@pytest.fixture(autouse=True)
def _figures_closed():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
