"""Rigid motions are taken out of a path, and nothing else."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from riemhuman.kernels.drift import still_path

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


def test_two_surfaces_have_nothing_between_them():
    path = RNG.normal(size=(2, 60, 3))
    np.testing.assert_array_equal(still_path(path, WEIGHTS, rotations=True), path)
