"""The models that tests of topologies share."""

import pytest
from scanned_people import with_pose_directions

import riemhuman as rh


@pytest.fixture(scope="session")
def model():
    return rh.datasets.load_open_model("coarse")


@pytest.fixture(scope="session")
def bending(model):
    return with_pose_directions(model)
