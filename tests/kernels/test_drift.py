"""Rigid motions are taken out of a path, and nothing else."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.kernels.drift import centroid, steady_path, still_path

RNG = np.random.default_rng(0)
BODY = RNG.normal(size=(60, 3))
WEIGHTS = RNG.uniform(0.5, 2.0, 60)


def moving_part_path():
    """Return a path on which a third of the vertices moves and the rest stands still."""
    path = np.repeat(BODY[None], 5, axis=0)
    turns = Rotation.from_rotvec(np.linspace(0, 1.5, 5)[:, None] * [0.0, 0.0, 1.0])
    for i, turn in enumerate(turns):
        path[i, :20] = turn.apply(BODY[:20])
    return path


@pytest.mark.parametrize("rotations", [True, False])
def test_finds_the_path_on_which_most_stands_still(rotations):
    path = moving_part_path()
    shaken = path.copy()
    for i in range(1, 4):
        if rotations:
            shaken[i] = Rotation.from_rotvec(RNG.normal(size=3)).apply(shaken[i])
        shaken[i] += RNG.normal(size=3)
    still = still_path(shaken, WEIGHTS, rotations=rotations)
    np.testing.assert_allclose(still, path, atol=1e-3)
    np.testing.assert_array_equal(still[[0, -1]], path[[0, -1]])


def test_surfaces_move_rigidly():
    path = RNG.normal(size=(4, 60, 3))
    for rotations in (True, False):
        still = still_path(path, WEIGHTS, rotations=rotations)
        for before, after in zip(path, still, strict=True):
            gram_before = (before - before[0]) @ (before - before[0]).T
            gram_after = (after - after[0]) @ (after - after[0]).T
            np.testing.assert_allclose(gram_after, gram_before, atol=1e-10)
        handed = np.linalg.det(still[1, 1:4] - still[1, 0])
        assert handed == pytest.approx(np.linalg.det(path[1, 1:4] - path[1, 0]))


@pytest.mark.parametrize("rotations", [True, False])
def test_a_body_goes_evenly_from_one_end_to_the_other(rotations):
    times = np.linspace(0.0, 1.0, 5)[:, None, None]
    expected = BODY + times * [3.0, -1.0, 2.0]
    path = expected + 4.0 * times * (1.0 - times) * [0.5, 1.5, -0.2]
    still = still_path(path, WEIGHTS, rotations=rotations)
    np.testing.assert_allclose(still, expected, atol=1e-9)


def test_the_heavier_part_stands_still():
    """Every vertex of a small body has its say, by its weight."""
    body = np.eye(3)
    path = np.stack([body, body, body])
    path[1, 0] += [0.0, 0.0, 0.7]
    for weights in ([1.0, 0.8, 0.8], [1.0, 0.4, 0.1]):
        still = still_path(path, np.array(weights), rotations=False)
        expected = path.copy()
        if weights[0] > sum(weights[1:]):
            expected[1] -= [0.0, 0.0, 0.7]
        np.testing.assert_allclose(still, expected, atol=1e-3)


def test_a_body_of_many_vertices():
    """Every second one of 4000 is enough to find the motion, and all follow it."""
    body = RNG.normal(size=(4000, 3))
    path = np.stack([body, Rotation.from_rotvec([0.4, -0.1, 0.9]).apply(body) + 2.0, body])
    path[1, 1::2] *= [1.0, 1.0, 5.0]
    still = still_path(path, np.ones(4000), rotations=True)
    np.testing.assert_allclose(still[1, ::2], body[::2], atol=1e-9)
    lengths = [np.linalg.norm(np.diff(f[:2000], axis=0), axis=1) for f in (still[1], path[1])]
    np.testing.assert_allclose(*lengths, rtol=1e-9)


def test_a_steady_path_has_a_centroid_that_moves_uniformly():
    rng = np.random.default_rng(4)
    path, weights = rng.normal(size=(5, 20, 3)), rng.uniform(0.1, 1.0, 20)
    steady = steady_path(path, weights)
    centroids = centroid(steady, weights)[:, 0]
    np.testing.assert_allclose(centroids, np.linspace(centroids[0], centroids[-1], 5), atol=1e-14)
    np.testing.assert_array_equal(steady[[0, -1]], path[[0, -1]])
    np.testing.assert_allclose(np.diff(steady, axis=1), np.diff(path, axis=1), atol=1e-14)
