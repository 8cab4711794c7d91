"""One person in many poses measures alike, once the pose is taken out."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.measurements import Measurements, in_standard_pose

LARGE = ["chest girth", "waist girth", "hip girth"]
LENGTHS = ["stature", "arm length", "inside leg height", "back length", "foot length"]


@pytest.fixture(scope="module")
def spreads():
    """Standard deviations over poses of three people nothing was tuned on, millimetres."""
    bodies = load_open_bodies("coarse", people=7)
    own = Measurements(bodies.model, LARGE + LENGTHS)
    points = bodies.points[:60].reshape(6, 10, -1, 3)[::2]
    standard = own.measure(points, pose="standard").values
    as_is = own.measure(points, missing="nan").values
    return 1000 * standard.std(axis=1, ddof=1), 1000 * np.nanstd(as_is, axis=1, ddof=1)


def test_spread_over_poses(spreads):
    standard, as_is = spreads
    n = len(LARGE)
    assert (np.median(standard[:, :n], axis=0) < 5).all()
    assert (np.median(standard[:, n:], axis=0) < 3).all()
    assert standard.max() < 8
    # As they stand, the same people measure otherwise in every pose.
    assert np.median(as_is[:, LARGE.index("hip girth")]) > 50


def test_the_models_own_bodies_come_back():
    bodies = load_open_bodies("coarse")
    own = Measurements(bodies.model)
    model, rng = bodies.model, np.random.default_rng(0)
    betas = rng.normal(size=(2, 16))
    vectors = np.array(
        [own.definitions.standard_pose.get(n, np.zeros(3)) for n in model.joint_names]
    )
    posed = model(betas, bodies.pose_vectors[[3, 9]], rng.normal(size=(2, 3)))
    straight = in_standard_pose(own.definitions, posed)
    np.testing.assert_allclose(straight, model(betas, vectors), atol=2e-5)
