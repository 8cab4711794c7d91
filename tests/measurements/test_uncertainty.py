"""How much measurements of an unchanged person vary."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, RiemhumanError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.measurements import (
    MeasurementSet,
    noise_of_measurements,
    open_measurements,
    pose_distance,
)
from riemhuman.measurements.measurement_set import load_json
from riemhuman.surfaces import Template


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse", people=1)


def test_variance_grows_in_proportion_to_the_distance_of_poses():
    names = ["chest girth", "no such girth", "neck girth"]
    distances = np.array([0.0, 0.5, 1.0])
    variances = noise_of_measurements(names, distances) ** 2
    assert np.isnan(variances[:, 1]).all()
    np.testing.assert_allclose(variances[1], (variances[0] + variances[2]) / 2)
    # Of real people: chest 36.7 mm and neck 22.7 mm over all pairs, about 0.9 apart in the mean.
    deviations = noise_of_measurements(names, 0.9)
    np.testing.assert_allclose(deviations[[0, 2]], [0.0367, 0.0227], rtol=0.06)
    # A chest must change by 10 cm at a distance of 1, and by 2.2 cm in the same pose.
    thresholds = 2 * np.sqrt(2) * noise_of_measurements(["chest girth"], [0.0, 1.0])[:, 0]
    np.testing.assert_allclose(thresholds, [0.023, 0.105], atol=0.001)


def test_distance_of_poses_does_not_depend_on_place_direction_or_template(bodies):
    definitions = open_measurements(bodies.model)
    expected = pose_distance(definitions, bodies[0], bodies[1:4])
    assert expected.shape == (3,)
    turn = Rotation.from_euler("y", 70, degrees=True).as_matrix()
    moved = bodies[1:4] @ turn.T + [1.0, 0.0, -2.0]
    np.testing.assert_allclose(pose_distance(definitions, bodies[0], moved), expected)
    # The template has almost the size to which distances are converted.
    metric = ElasticMetric(AlignedSurfaces(bodies.template), 0.0, 0.0, 1.0)
    assert (expected < 1.02 * metric.dist(bodies[0], bodies[1:4])).all()
    twice = MeasurementSet(Template(2.0 * bodies.template.vertices, bodies.template.faces), ())
    np.testing.assert_allclose(pose_distance(twice, bodies[0], bodies[1:4]), expected)


def test_variation_is_known_of_measurements():
    measurements = load_json("noise_of_poses.json")["measurements"]
    slopes = load_json("variation_of_people.json")["slopes"]
    assert set(measurements) == set(slopes) <= set(open_measurements("full").names)
    assert all(0 < value < 1 for value in measurements.values())
    assert all(0 <= slope < 3 for slope in slopes.values())  # body mass, kg²


def test_refusals(bodies):
    definitions = open_measurements(bodies.model)
    refused = [
        lambda: noise_of_measurements(["stature"], -0.1),
        lambda: noise_of_measurements("stature"),
        lambda: pose_distance(definitions, bodies[0], bodies[1][:-1]),
        lambda: pose_distance(bodies.model, bodies[0], bodies[1]),
    ]
    for call in refused:
        with pytest.raises(RiemhumanError):
            call()
    with pytest.raises(ArgumentError, match="pose_distance must be at least 0; found -0.1"):
        noise_of_measurements(["stature"], [-0.1, 0.2])
