"""Two visits of one person."""

import numpy as np
import pytest

from riemhuman.bodies import joint_motions, rotation_matrix, skin_surface
from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.measurements import (
    Measurements,
    compare_visits,
    noise_of_measurements,
    pose_distance,
)


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse", people=5)


def test_the_same_person_in_other_poses(bodies):
    measurements = Measurements(bodies.model)
    result = compare_visits(measurements, bodies.points[3], bodies.points[8])
    assert result.is_significant.mean() < 0.2
    assert np.abs(result.displacements).mean() < 0.005
    # The threshold is twice the deviation of a difference; 4.55 % of normal numbers exceed it.
    np.testing.assert_allclose(result.thresholds, 2 * np.hypot(result.noise, result.noise))
    assert result.expected_by_chance == pytest.approx(
        0.0455 * np.isfinite(result.noise).sum(), rel=1e-3
    )
    with pytest.raises(ArgumentError, match="after must have shape"):
        compare_visits(measurements, bodies.points[0], bodies.points[1][:-1])


def test_poses_hide_changes(bodies):
    measurements = Measurements(bodies.model, ["chest girth", "stature"])
    result = compare_visits(measurements, bodies.points[0], bodies.points[5])
    distance = pose_distance(measurements.definitions, bodies.points[0], bodies.points[5])
    assert result.pose_distance == distance
    np.testing.assert_array_equal(result.noise, noise_of_measurements(result.names, distance))
    in_same_pose = compare_visits(measurements, bodies.points[0], bodies.points[0])
    assert (result.thresholds > in_same_pose.thresholds).all()
    chest = f"chest girth must change by {100 * result.thresholds[0]:.1f} cm"
    assert chest in result.pose_advice()
    assert "in the same pose, 2.3 cm" in result.pose_advice()
    assert "0.9 in would do" in result.pose_advice("in")
    assert not in_same_pose.pose_advice()


@pytest.mark.parametrize(("number", "is_told"), [(5, True), (9, False)])
def test_a_change_is_found_where_it_is(bodies, number, is_told):
    """A belly grows by three centimetres; between a squat and a wave, that is too little."""
    measurements = Measurements(
        bodies.model, ["waist girth", "head girth", "calf girth", "arm length"]
    )
    model, betas = bodies.model, bodies.betas[0]
    grown = model.template.vertices.copy()
    belly = np.exp(-(((grown - [0.0, 1.1, 0.1]) / 0.12) ** 2).sum(axis=1))
    shape = model(betas) + 0.03 * belly[:, None] * [0.0, 0.0, 1.0]
    rotations, places = joint_motions(
        model.joints(betas),
        rotation_matrix(bodies.pose_vectors[5]),
        model.parents,
    )
    after = skin_surface(shape, model.weights, model.joints(betas), rotations, places)
    result = compare_visits(measurements, bodies.points[number], after)
    assert result.is_significant.tolist() == [is_told, False, False, False]
    assert result.changes[0] == pytest.approx(0.021, abs=0.005)
    most = np.argsort(-result.displacements)[:8]
    assert (belly[most] > 0.3).all()


def test_what_is_not_trusted_is_not_expected_to_change(bodies):
    measurements = Measurements(bodies.model)
    trusted = np.ones((2, bodies.points.shape[1]), dtype=bool)
    trusted[1] = bodies.points[3, :, 1] > bodies.points[3, :, 1].min() + 0.3  # without feet
    result = compare_visits(
        measurements, bodies.points[3], bodies.points[3], trusted_vertices=trusted
    )
    n_measured = np.isfinite(result.changes).sum()
    assert 0 < n_measured < len(measurements.names)
    assert result.expected_by_chance == pytest.approx(0.0455 * n_measured, rel=1e-3)
    np.testing.assert_array_equal(np.isnan(result.displacements), ~trusted[1])
