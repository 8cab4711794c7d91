"""Settings shared by all tests, the one browser of the session, and a few bodies."""

import functools
import gc
import os
import sys

if "PYTEST_XDIST_WORKER" in os.environ:
    # Every core has a worker already: threads of BLAS, which NumPy asks for when it is imported,
    # would wait for each other, and double the processor time.
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"):
        os.environ.setdefault(name, "1")

import numpy as np
import pytest
from headless_browser import opened_browser
from lengths import deselected

import riemhuman.datasets
from riemhuman.datasets import Bodies, load_open_bodies

# While thousands of tests are collected, next to nothing becomes garbage; what is there then stays
# to the end, and is not looked at again.
gc.disable()


def pytest_collection_finish(session):
    gc.freeze()
    gc.enable()


# Of two workers, one begins with the first half of the tests and the other with the second: that
# one compiles what most tests need, while this one first runs tests that compile next to nothing.
COMPILED_FIRST = ("bodies", "descriptors", "geometry", "kernels", "learned", "motions", "terms")
COMPILED_LAST = ("cli", "measurements", "registration", "report", "retrieval", "solvers")


def pytest_collection_modifyitems(config, items):
    names = [item.path.parent.name for item in items]
    places = [(name in COMPILED_LAST) - (name in COMPILED_FIRST) for name in names]
    items[:] = [items[k] for k in np.argsort(places, kind="stable")]
    if any("::" in argument for argument in config.args):
        return  # who names a test runs it
    left_out = deselected(items)
    items[:] = [item for item in items if item not in left_out]
    config.hook.pytest_deselected(items=list(left_out))


computed_bodies = functools.cache(load_open_bodies)


@functools.wraps(load_open_bodies)
def open_bodies(resolution="full", variant="plain", people=None):
    """Return the open bodies, computed once for all tests, in arrays that a test may change."""
    bodies = vars(computed_bodies(resolution, variant, people))
    return Bodies(**{k: v.copy() if isinstance(v, np.ndarray) else v for k, v in bodies.items()})


riemhuman.datasets.load_open_bodies = open_bodies


@pytest.fixture(scope="session")
def browser():
    """Return a headless browser, which all tests share."""
    with opened_browser() as one:
        yield one


@pytest.fixture(scope="session")
def nine_bodies():
    """Return three people in three poses, coarse."""
    bodies = open_bodies("coarse")
    chosen = np.flatnonzero(np.isin(bodies.subject, [0, 5, 8]) & np.isin(bodies.pose, [0, 1, 3]))
    per_body = ("points", "subject", "pose", "betas", "pose_vectors", "translations")
    kept = {name: getattr(bodies, name)[chosen] for name in per_body}
    whole = ("template", "model", "subject_names", "pose_names")
    return Bodies(**kept, **{name: getattr(bodies, name) for name in whole})


@pytest.fixture
def undrawn(monkeypatch):
    """Leave figures of a report empty, which take most of its time."""
    pixels = np.zeros((2, 2, 4))
    monkeypatch.setattr("riemhuman.plots.body_plots.render", lambda *given, **settings: pixels)
    monkeypatch.setattr(
        "riemhuman.report._page.figure_files",
        lambda figure: ('<svg viewBox="0 0 4 3"></svg>', b""),
    )


@pytest.fixture(autouse=True)
def _figures_closed():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
