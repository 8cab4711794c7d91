"""The model, scans and registrations that several tests share."""

import numpy as np
import pytest
from scanned_people import settings_with

import riemhuman as rh
from riemhuman.kernels.threads import single_threaded_libraries
from riemhuman.registration import ScanRegistration, simulated_scan


@pytest.fixture(scope="module", autouse=True)
def _single_threaded():
    """Call stages as `solve` does: with threads of their own, libraries take ten times as long."""
    with single_threaded_libraries():
        yield


@pytest.fixture(scope="session")
def natural_bodies():
    """Return people with flesh that the model lacks; tests change none of their arrays."""
    return rh.datasets.load_open_bodies("coarse", variant="natural", people=909)


@pytest.fixture(scope="session")
def registration(model):
    return ScanRegistration(model, up="y")


@pytest.fixture(scope="session")
def registration_from(model):
    """Return a function that makes registrations which start from few poses, and try no arms."""

    def make(*poses, up="y"):
        return ScanRegistration(model, up=up, settings=settings_with(poses=poses, tries_arms=False))

    return make


@pytest.fixture(scope="session")
def frames():
    """Return two neighbouring frames of a motion that is among no start poses."""
    (motion,) = rh.datasets.load_open_motions(
        "coarse", subjects=["lean runner"], sequences=["punching"]
    )
    return np.stack([motion[28], motion[31]])


@pytest.fixture(scope="session")
def scan(model, frames):
    return simulated_scan(frames[0], model.faces, rng=3, n_points=6000, mesh=True, missing=0.1)


@pytest.fixture(scope="session")
def few_starts(model):
    """Return a registration that starts from some poses, and tries everything after that."""
    return ScanRegistration(
        model, up="y", settings=settings_with(poses=("a", "t", "down", "forward"))
    )


@pytest.fixture(scope="session")
def result(few_starts, scan):
    return few_starts.solve(scan.surface)
