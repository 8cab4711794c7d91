"""The model that performs, the real recording that is performed, and a model of SMPL's family."""

import pytest
from model_pickles import smpl_model
from recorded_people import RECORDING

from riemhuman.datasets import load_bvh, load_open_model


@pytest.fixture(scope="session")
def model():
    return load_open_model("coarse")


@pytest.fixture(scope="session")
def recording():
    """Two seconds of the CMU Graphics Lab Motion Capture Database, see recordings/README."""
    return load_bvh(RECORDING)


@pytest.fixture(scope="session")
def smpl():
    return smpl_model(24, n_betas=10)
