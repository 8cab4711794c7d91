"""Several scans of one person at one visit."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.measurements import (
    Measurements,
    compare_visits,
    in_standard_pose,
    noise_of_measurements,
    open_measurements,
    person_in_standard_pose,
    pose_distance,
)
from riemhuman.measurements.uncertainty import pose_distance_of_visits


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse", people=1)


@pytest.fixture(scope="module")
def definitions(bodies):
    return open_measurements(bodies.model)


def test_the_mean_of_what_each_scan_shows(bodies, definitions):
    straight = in_standard_pose(definitions, bodies.points[:3])
    person = person_in_standard_pose(definitions, bodies.points[:3])
    np.testing.assert_allclose(person, straight.mean(axis=0), atol=1e-12)
    for wrong in (bodies.points[0], bodies.points[:0], bodies.points[:2, :-1]):
        with pytest.raises(ArgumentError, match="points must"):
            person_in_standard_pose(definitions, wrong)


def test_what_a_scan_does_not_show_comes_from_the_others(bodies, definitions):
    """The head of the second scan is 5 cm too far forward, and not trusted."""
    points = bodies.points[[0, 1]].copy()
    on_head = bodies.model.weights[:, bodies.model.joint_names.index("head")]
    points[1] += 0.05 * on_head[:, None] * [0.0, 0.0, 1.0]
    trusted = np.ones(points.shape[:2], dtype=bool)
    trusted[1, on_head > 0.0] = False
    person = person_in_standard_pose(definitions, points, trusted_vertices=trusted)
    first, second = in_standard_pose(definitions, points)
    is_head = on_head > 0.9
    gaps = np.linalg.norm(person - first, axis=1)[is_head]
    all_gaps = np.linalg.norm(second - first, axis=1)[is_head]
    assert gaps.max() < 0.02 * all_gaps.max()
    on_legs = bodies.points[0, :, 1] < np.median(bodies.points[0, :, 1])
    np.testing.assert_allclose(person[on_legs], (first + second)[on_legs] / 2, atol=1e-5)
    unseen = np.zeros_like(trusted)
    hidden = person_in_standard_pose(definitions, points, trusted_vertices=unseen)
    np.testing.assert_allclose(hidden, (first + second) / 2, atol=1e-9)
    with pytest.raises(ArgumentError, match="trusted_vertices must be Boolean"):
        person_in_standard_pose(definitions, points, trusted_vertices=trusted[0])


def test_the_variance_of_means_follows_from_that_of_pairs(definitions, bodies):
    """For scans that differ by a random walk along a line: its variance grows with the distance."""
    distances = pose_distance(definitions, bodies.points[:4, np.newaxis], bodies.points[:4])
    before, after = bodies.points[:1], bodies.points[2:3]
    one_each = pose_distance_of_visits(definitions, before, after)
    assert one_each == pytest.approx(distances[0, 2], rel=1e-9)
    found = pose_distance_of_visits(definitions, bodies.points[:2], bodies.points[2:4])
    within = (distances[0, 1] + distances[2, 3]) / 2.0
    expected = distances[:2, 2:].mean() - within / 2.0
    assert found == pytest.approx(expected, rel=0.02)  # aligned with each other both ways
    # The same poses at both visits: what they hide is the same.
    assert pose_distance_of_visits(definitions, bodies.points[:3], bodies.points[:3]) < 1e-6
    noise = noise_of_measurements(["stature"], 0.0)
    np.testing.assert_allclose(noise_of_measurements(["stature"], 0.0, 4), noise / 2.0)


def test_several_scans_of_a_visit_show_smaller_changes(bodies):
    """Both visits have a squat, a wave and another pose."""
    measurements = Measurements(bodies.model, ["chest girth", "waist girth", "stature"])
    before, after = bodies.points[[0, 5, 9]], bodies.points[[1, 4, 9]]
    single = compare_visits(measurements, before[1], after[0])
    several = compare_visits(measurements, before, after)
    assert several.n_scans == 3.0
    assert (several.thresholds < single.thresholds).all()
    assert several.pose_distance < single.pose_distance
    assert not several.is_significant.any()
    assert "Repeat the scan in the same pose." in single.pose_advice()
    far = compare_visits(measurements, bodies.points[[0, 1]], bodies.points[[5, 8]])
    assert far.pose_advice().endswith("Repeat the scans in the same poses.")
    uneven = compare_visits(measurements, before, after[:1])
    assert uneven.n_scans == pytest.approx(1.5)
    trusted = [
        np.ones((3, bodies.points.shape[1]), bool),
        np.ones((1, bodies.points.shape[1]), bool),
    ]
    trusted[1][0, bodies.points[1, :, 1] > 1.0] = False
    hidden = compare_visits(measurements, before, after[:1], trusted_vertices=trusted)
    assert np.isnan(hidden.changes[0])
    assert np.isnan(hidden.displacements).sum() == (~trusted[1]).sum()
    for wrong in (trusted[0], trusted[:1], [trusted[1], trusted[0]]):
        with pytest.raises(ArgumentError, match="trusted_vertices"):
            compare_visits(measurements, before, after[:1], trusted_vertices=wrong)
    with pytest.raises(ArgumentError, match="before must be one body, or the scans of one visit"):
        compare_visits(measurements, bodies.points[None], after)
