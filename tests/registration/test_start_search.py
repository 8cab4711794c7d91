"""The soft assignment of a scan to a body, and what landmarks cost."""

import numpy as np
import pytest

from riemhuman.registration._start_search import KAPPA, OUTLIERS, assign, landmark_cost


@pytest.fixture
def rng():
    return np.random.default_rng(7)


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

    single = [rows.T.astype(np.float32).copy() for rows in (points, normals)]
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


def test_landmarks_far_from_their_joints_lower_the_likelihood():
    joints = np.zeros((2, 3))
    costs = [landmark_cost(joints, {1: np.array([0.0, x, 0.0])}) for x in (0.0, 0.1, 0.3, 2.0, 9.0)]
    assert costs[0] == 0.0
    assert costs[1] > 0.05  # more than likelihoods of neighbouring starts differ
    assert costs[2] > 0.5  # more than those of a flipped body
    assert costs[3] == costs[4]  # a mistaken landmark does not outweigh the scan
