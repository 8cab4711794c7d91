"""Shape and pose codes that ship, on people and poses that were no part of training."""

import numpy as np
import pytest
from evaluate_codes import UnseenBodies, mean_error
from open_bodies import coarse_bodies
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.learned import ShapePoseCodes
from riemhuman.surfaces.template import Template


@pytest.fixture(scope="module")
def codes():
    return ShapePoseCodes.load_pretrained()


@pytest.fixture(scope="module")
def bodies():
    return UnseenBodies("random")


def test_bodies_come_back_and_shape_and_pose_come_apart(codes, bodies):
    found = codes.transform(bodies.points)
    assert mean_error(codes.inverse_transform(found), bodies.points) < 15.0
    people, others, truth = bodies.transfers()
    moved = codes.transfer(bodies.points[people], bodies.points[others])
    assert mean_error(moved, truth) < 20.0
    assert codes.transform(bodies.points[:0]).shape == (0, codes.n_shape + codes.n_pose)
    shape, pose = codes.split(found)
    np.testing.assert_array_equal(np.concatenate([shape, pose], axis=1), found)
    mixed = np.concatenate([shape[people], pose[others]], axis=1)
    np.testing.assert_allclose(codes.inverse_transform(mixed), moved)


def test_codes_do_not_know_place_nor_heading(codes, bodies):
    turn = Rotation.from_rotvec([0.3, 2.0, -0.4]).as_matrix()
    moved = bodies.points[:3] @ turn.T + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(
        codes.transform(moved), codes.transform(bodies.points[:3]), atol=1e-6
    )


def test_refined_template_gives_nearly_the_same_codes(codes):
    full = load_open_model("full")
    coarse = coarse_bodies()
    fine = full(coarse.betas[:2], coarse.pose_vectors[:2])
    small = coarse.model(coarse.betas[:2], coarse.pose_vectors[:2])
    on_full = codes.on(full.template)
    found = on_full.transform(fine)
    spread = codes.transform(coarse.points).std(axis=0)
    assert (np.abs(found - codes.transform(small)) / spread).mean() < 0.05
    assert mean_error(on_full.inverse_transform(found), small) < 15.0
    other = Template(1.01 * full.template.vertices, full.faces)
    with pytest.raises(ArgumentError, match="Bring bodies to the open model first"):
        codes.on(other)


def test_refuses(codes, bodies):
    with pytest.raises(ArgumentError, match="the template has 1202"):
        codes.transform(np.zeros((2, 7, 3)))
    with pytest.raises(DegenerateSurfaceError):
        codes.transform(0.0 * bodies.points[:1])
    with pytest.raises(ArgumentError, match="millimetres.*unit that the network was trained in"):
        codes.transform(1000.0 * bodies.points[:1])
    with pytest.raises(ArgumentError, match="Z"):
        codes.inverse_transform(np.zeros((2, 7)))
    with pytest.raises(ArgumentError, match="must have the same length"):
        codes.transfer(bodies.points[:2], bodies.points[:1])
