"""Two visits: what changed is found whatever the pose, and nothing where nothing changed."""

import numpy as np
import pytest

from riemhuman.bodies import joint_motions, rotation_matrix, skin_surface
from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError
from riemhuman.measurements import Measurements, compare_visits, noise_of_poses, open_measurements


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse", people=5)


def test_the_same_person_in_other_poses(bodies):
    own = Measurements(bodies.model)
    result = compare_visits(own, bodies.points[3], bodies.points[8])
    assert result.seen.mean() < 0.2
    assert np.nanmean(result.areas_seen) < 0.1
    assert np.abs(result.displacements).mean() < 0.005


def test_a_change_is_found_where_it_is(bodies):
    """The belly grows by three centimetres between a squat and a wave."""
    own = Measurements(bodies.model, ["waist girth", "head girth", "calf girth", "arm length"])
    model, betas = bodies.model, bodies.betas[0]
    grown = model.template.vertices.copy()
    belly = np.exp(-(((grown - [0.0, 1.1, 0.1]) / 0.12) ** 2).sum(axis=1))
    shape = model(betas) + 0.03 * belly[:, None] * [0.0, 0.0, 1.0]
    turns, places = joint_motions(
        model.joints(betas),
        rotation_matrix(bodies.pose_vectors[5]),
        model.parents,
        model.joint_order,
    )
    after = skin_surface(shape, model.weights, model.joints(betas), turns, places)
    result = compare_visits(own, bodies.points[9], after)
    assert result.seen.tolist() == [True, False, False, False]
    assert 0.02 < result.changes[0] < 0.09
    most = np.argsort(-result.displacements)[:8]
    assert (belly[most] > 0.3).all()


def test_the_noise_is_of_all_measurements():
    names = open_measurements().names
    measurements, parts = noise_of_poses()
    assert set(measurements) == set(names)
    assert set(parts) == set(open_measurements().parts)
    assert all(0 < value < 1 for value in measurements.values())


def test_what_is_refused(bodies):
    own = Measurements(bodies.model)
    with pytest.raises(ArgumentError, match="after must have shape"):
        compare_visits(own, bodies.points[0], bodies.points[1][:-1])
