"""Joints of the limbs as a metric on bodies."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.errors import ArgumentError
from riemhuman.motions import JointMetric


@pytest.fixture(scope="module")
def knees():
    return rh.datasets.load_open_motions("coarse", sequences=["knees", "punching"])[:6]


@pytest.fixture(scope="module")
def metric(knees):
    return JointMetric(rh.AlignedSurfaces(knees[0].template), knees[0].model)


def test_distances_are_those_of_joints(metric, knees):
    """By the definition, for bodies that face forward."""
    model = knees[0].model
    poses = np.zeros((2, model.n_joints, 3))
    poses[1, model.joint_names.index("left_elbow"), 1] = -0.5
    names = [model.joint_names.index(f"{side}_{part}") for side in ("left", "right")
             for part in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")]  # fmt: skip
    a, b = (model.joints(np.zeros(model.n_betas), pose)[names] for pose in poses)
    surfaces = [model(pose=pose) for pose in poses]
    # Vertices follow several joints: the regressed wrist is millimetres from that of the skeleton.
    assert metric.dist(*surfaces) == pytest.approx(np.linalg.norm(a - b), rel=0.05)


@pytest.mark.parametrize("degrees", [30.0, 170.0, -90.0])
def test_places_and_headings_do_not_count(degrees, metric, knees):
    body, other = knees[0][5], knees[1][9]
    turn = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    moved = body @ turn.T + [3.0, 0.2, -1.0]
    assert metric.dist(body, moved) == pytest.approx(0.0, abs=1e-6)
    assert metric.dist(moved, other) == pytest.approx(float(metric.dist(body, other)), rel=1e-6)


def test_coordinates_have_the_distances(metric, knees):
    points = knees[0][:4]
    rows = metric.lower_bound_coordinates(points)
    expected = np.linalg.norm(rows[:, None] - rows[None], axis=-1)
    np.testing.assert_allclose(metric.dist_pairwise(points), expected, atol=1e-7)


def test_the_metric_keeps_its_promises(metric, knees):
    rh.testing.check_metric(metric, knees[0][:3])


def test_other_models_are_refused(knees):
    with pytest.raises(ArgumentError, match="its vertices are others"):
        JointMetric(rh.AlignedSurfaces(knees[0].template), rh.datasets.load_open_model("full"))
