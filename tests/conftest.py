"""Settings shared by all tests, the one browser of the session, and a few bodies."""

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
from empty_figures import leave_empty
from headless_browser import opened_browser
from open_bodies import coarse_bodies, with_pose_directions

from riemhuman.datasets import Bodies, load_open_model

EVERYDAY_CASES = 6


def pytest_configure():
    """Collect no garbage while tests are collected: what is made until then stays."""
    gc.disable()


def pytest_collection_finish():
    """Collect garbage again, of tests alone."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(tryfirst=True)  # before pytest selects by markers
def pytest_collection_modifyitems(items):
    """Mark cases as slow, but for six of each test, or those that its mark `everyday` names.

    The mark without names is for tables of refusals, of which each is another line of the code.
    """
    cases_of_tests = {}
    for item in items:
        if item.get_closest_marker("slow") is None and hasattr(item, "callspec"):
            cases_of_tests.setdefault((item.path, item.function), []).append(item)
    for cases in cases_of_tests.values():
        everyday = cases[0].get_closest_marker("everyday")
        if everyday is None:
            chosen = spread(cases, EVERYDAY_CASES)
        elif everyday.args:
            chosen = [case for case in cases if case.callspec.id in everyday.args]
            if not chosen and len(cases) > 1:  # who asks for a single case collects no others
                raise pytest.UsageError(f"{cases[0].nodeid}: everyday names no case that it has")
        else:
            chosen = cases
        for case in cases:
            if case not in chosen:
                case.add_marker("slow")


def spread(cases, count):
    """Return at most so many cases, one of each of as many parts of the list.

    It is another one in each part, so that all values of a second parameter come up.
    """
    if len(cases) <= count:
        return cases
    length = len(cases) // count
    return [cases[part * len(cases) // count + part % length] for part in range(count)]


@pytest.fixture(scope="session")
def browser():
    """Return a headless browser, which all tests share."""
    with opened_browser() as opened:
        yield opened


@pytest.fixture(scope="session")
def bodies():
    """Return all open bodies, coarse."""
    return coarse_bodies()


@pytest.fixture(scope="session")
def model():
    """Return the open model, coarse."""
    return load_open_model("coarse")


@pytest.fixture(scope="session")
def bending(model):
    """Return the open model with pose directions."""
    return with_pose_directions(model)


@pytest.fixture(scope="session")
def nine_bodies():
    """Return three people in three poses, coarse."""
    bodies = coarse_bodies()
    chosen = np.flatnonzero(np.isin(bodies.subject, [0, 5, 8]) & np.isin(bodies.pose, [0, 1, 3]))
    per_body = ("points", "subject", "pose", "betas", "pose_vectors", "translations")
    kept = {name: getattr(bodies, name)[chosen] for name in per_body}
    whole = ("template", "model", "subject_names", "pose_names")
    return Bodies(**kept, **{name: getattr(bodies, name) for name in whole})


@pytest.fixture
def strict_floats():
    """Raise an error where floating-point numbers overflow or become NaN."""
    with np.errstate(divide="raise", over="raise", invalid="raise"):
        yield


@pytest.fixture
def undrawn(monkeypatch):
    """Leave figures of a report empty, which take most of its time."""
    leave_empty(monkeypatch)


@pytest.fixture(autouse=True)
def _figures_closed():
    yield
    if "matplotlib.pyplot" in sys.modules:
        sys.modules["matplotlib.pyplot"].close("all")
