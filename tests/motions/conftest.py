"""Short motions of a few people, and a known re-timing."""

import numpy as np
import pytest

import riemhuman as rh


@pytest.fixture(scope="session")
def open_motions():
    """Two people in three motions."""
    people = ["lean runner", "average woman"]
    return rh.datasets.load_open_motions("coarse", people, ["knees", "punching", "shake_arms"])


@pytest.fixture(scope="session")
def space(open_motions):
    return rh.AlignedSurfaces(open_motions[0].template).equip_with_metric(
        rh.ElasticMetric, a=0.0, lam=0.0, c=1.0
    )


@pytest.fixture(scope="session")
def pose(space):
    return space.metric


@pytest.fixture(scope="session")
def motions(open_motions):
    """Ten frames of each."""
    return [motion[:100:10] for motion in open_motions]


@pytest.fixture(scope="session")
def full_motion(open_motions):
    """Forty frames of one."""
    return open_motions[0][:80:2]


@pytest.fixture(scope="session")
def retiming(full_motion):
    """Times of thirty frames, and the frames at those times: slow, then fast."""
    places = np.rint(39 * np.linspace(0, 1, 30) ** 1.7).astype(int)
    return places, full_motion[places]
