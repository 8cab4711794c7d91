"""An open motion and its joints, the real recording performed, and a model of SMPL's family."""

import pytest
from marker_files import RATE
from model_pickles import smpl_model
from recorded_people import RECORDING, joint_paths

from riemhuman.datasets import load_bvh, load_open_motions


@pytest.fixture(scope="session")
def jump():
    (motion,) = load_open_motions("coarse", "tall sturdy woman", "jumping_jacks", RATE)
    return motion


@pytest.fixture(scope="session")
def joints(jump):
    return joint_paths(jump)


@pytest.fixture(scope="session")
def recording():
    """Two seconds of the CMU Graphics Lab Motion Capture Database, see recordings/README."""
    return load_bvh(RECORDING)


@pytest.fixture(scope="session")
def smpl():
    return smpl_model(24, n_betas=10)
