"""The pose, its derivatives and the soft assignment, against independent definitions."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.registration._posed_body import Pose, Prior, pose_body, sample_model, take_step
from riemhuman.registration._soft_assignment import KAPPA, OUTLIERS, assign


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
        step = take_step(posed, prior, 0.0, shares, gaps[-1], gaps[-1], 1.0, 1.0)
        posed = pose_body(body, step)
        gaps.append(targets - posed.points)
    sizes = [np.abs(each).max() for each in gaps]
    # The damping of 1e-4 keeps Gauss–Newton's steps from being exact.
    assert sizes[1] < 0.1 * sizes[0]
    assert sizes[2] < 0.1 * sizes[1]


@pytest.mark.parametrize("signed", [True, False])
def test_assignment_is_the_mixture(rng, signed):
    n, m, sigma = 30, 20, 0.2
    points, scan = rng.normal(0.0, 0.3, (n, 3)), rng.normal(0.0, 0.3, (m, 3))
    normals, others = rng.standard_normal((n, 3)), rng.standard_normal((m, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    others /= np.linalg.norm(others, axis=1, keepdims=True)
    areas = rng.dirichlet(np.ones(n))

    squares = np.sum((points[:, None] - scan) ** 2, axis=-1)
    cosines = normals @ others.T
    cosines = cosines if signed else np.abs(cosines)
    spheres = (1.0 - np.exp(-2.0 * KAPPA)) / (2.0 * KAPPA)
    density = np.exp(-squares / (2 * sigma**2) + KAPPA * (cosines - 1.0)) / (
        (2 * np.pi * sigma**2) ** 1.5 * spheres
    )
    joint = (1.0 - OUTLIERS) * areas[:, None] * density
    total = joint.sum(axis=0) + OUTLIERS
    shares = joint / total

    single = [each.T.astype(np.float32).copy() for each in (points, normals)]
    masses, targets = np.empty(n, np.float32), np.empty((3, n), np.float32)
    likelihood = assign(
        *single,
        areas.astype(np.float32),
        scan.astype(np.float32),
        others.astype(np.float32),
        sigma,
        signed,
        masses,
        targets,
    )
    # The exponential is a power of order 1024: exp(−t) to a relative t²/2048.
    np.testing.assert_allclose(likelihood, np.log(total).mean(), atol=0.02)
    np.testing.assert_allclose(masses, shares.sum(axis=1), rtol=0.05, atol=0.01)
    np.testing.assert_allclose(targets.T, shares @ scan, rtol=0.05, atol=0.01)
