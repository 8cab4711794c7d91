"""The pose and its derivatives, against independent definitions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.registration._posed_body import (
    Pose,
    Prior,
    normal_equations,
    pose_body,
    sample_model,
    take_step,
)


@pytest.fixture(scope="module")
def body(model):
    return sample_model(model, 60)


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.fixture
def parameters(model, rng):
    return (
        rng.standard_normal(model.n_betas),
        rng.normal(0.0, 0.5, (model.n_joints, 3)),
        rng.standard_normal(3),
        rng.standard_normal(model.hand_directions.shape[-1]),
    )


def as_pose(betas, vectors, trans, hands=()):
    local = np.ascontiguousarray(Rotation.from_rotvec(vectors).as_matrix())
    return Pose(local, np.concatenate([betas, hands]), trans)


def test_points_are_those_of_the_model(model, body, parameters):
    points, normals, *_ = pose_body(body, as_pose(*parameters))
    skin = body.numbers >= 0
    np.testing.assert_allclose(points[skin], model(*parameters)[body.numbers[skin]], atol=1e-12)
    np.testing.assert_allclose(points[~skin], model.joints(*parameters[:3]), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(normals[skin], axis=1), 1.0, atol=1e-12)


def test_points_are_those_of_a_model_with_pose_offsets(bending, parameters):
    body = sample_model(bending, 60)
    points, *_ = pose_body(body, as_pose(*parameters[:3]))
    skin = body.numbers >= 0
    expected = bending(*parameters[:3])[body.numbers[skin]]
    np.testing.assert_allclose(points[skin], expected, atol=1e-12)


def test_derivatives_lead_back_to_a_body_nearby(body, parameters, rng):
    goal = as_pose(*parameters)
    start = Pose(
        rh.bodies.rotation_matrix(rng.normal(0.0, 0.02, (len(goal.local), 3))) @ goal.local,
        goal.betas + 0.02 * rng.standard_normal(len(goal.betas)),
        goal.trans + 0.01,
    )
    targets = pose_body(body, goal).points
    shares = np.full(len(targets), 1.0 / len(targets))
    posed = pose_body(body, start)
    gaps = [targets - posed.points]
    prior = Prior(goal.local, np.zeros(len(goal.local)), goal.betas, np.zeros(len(goal.betas)))
    for _ in range(2):
        equations = normal_equations(posed, prior, 0.0, shares, gaps[-1], gaps[-1], 1.0)
        step = take_step(posed, equations, 1.0)
        posed = pose_body(body, step)
        gaps.append(targets - posed.points)
    sizes = [np.abs(gap).max() for gap in gaps]
    # The damping of 1e-4 keeps Gauss–Newton's steps from being exact.
    assert sizes[1] < 0.1 * sizes[0]
    assert sizes[2] < 0.1 * sizes[1]


def test_what_smooth_skin_explains_moves_no_joint(model):
    """Bumps of some millimetres, on a body in its place, without a prior that would hold it."""
    body = sample_model(model, 600)
    rest = Pose(
        np.tile(np.eye(3), (model.n_joints, 1, 1)), np.zeros(body.shapedirs.shape[2]), np.zeros(3)
    )
    posed = pose_body(body, rest)
    coefficients = np.random.default_rng(3).normal(0.0, 0.005, body.detail.shape[1])
    heights = body.detail @ coefficients
    assert 0.002 < heights[body.numbers >= 0].std() < 0.01
    ones = np.ones(model.n_joints)
    prior = Prior(rest.local, ones, rest.betas, np.ones(len(rest.betas)))
    with_skin, without = (
        take_step(
            posed,
            normal_equations(
                posed, prior, 1e-8, body.areas, heights[:, np.newaxis] * posed.normals,
                posed.normals, 0.05, with_detail=with_detail,
            ),
            0.3,
        )
        for with_detail in (True, False)
    )  # fmt: skip
    turns, turns_without = (
        Rotation.from_matrix(pose.local).magnitude().mean() for pose in (with_skin, without)
    )
    assert turns < 0.4 * turns_without
