"""How fast and how far bodies travel, as a part of distances of motions."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions import DynamicTimeWarping, VelocityTimeWarping


def carried(motion, metres_a_second, rate=30.0):
    """Return a motion that travels along x at a constant speed."""
    seconds = np.arange(len(motion)) / rate
    steps = np.zeros((len(motion), 1, 3))
    steps[:, 0, 0] = metres_a_second * seconds
    return motion + steps


def unit_of_speed(space):
    leg = 0.5 * np.ptp(space.template.vertices[:, 1])
    return np.sqrt(9.81 * leg)


def test_speed_counts_in_its_unit(pose, space, motions):
    warping = DynamicTimeWarping(pose, travel_weight=3.0, frames_per_second=30.0)
    still = np.repeat(motions[0][:1], 10, axis=0)
    moved = carried(still, 1.5)
    assert DynamicTimeWarping(pose).dist(still, moved) == pytest.approx(0.0, abs=1e-9)
    expected = 3.0 * 1.5 / unit_of_speed(space)
    assert warping.dist(still, moved) == pytest.approx(expected, rel=1e-6)
    # As fast in another direction, and from another place, is the same.
    turned = moved[..., [2, 1, 0]] + [5.0, 0.0, -2.0]
    upright = DynamicTimeWarping(pose, travel_weight=3.0, frames_per_second=30.0, heading=True)
    with_poses = upright.dist(moved, turned)
    assert with_poses == pytest.approx(DynamicTimeWarping(pose, heading=True).dist(moved, turned))


def test_all_pairs_are_the_single_distances(pose, motions):
    some = [carried(motion, speed) for motion, speed in zip(motions[:3], (0, 1, 3), strict=True)]
    warping = DynamicTimeWarping(pose, travel_weight=1.0, frames_per_second=30.0, n_jobs=2)
    matrix = warping.dist_pairwise(some)
    assert matrix[0, 2] == pytest.approx(warping.dist(some[0], some[2]), rel=1e-12)
    plain = DynamicTimeWarping(pose).dist_pairwise(some)
    assert (matrix >= plain - 1e-9).all()
    assert matrix[0, 2] > plain[0, 2]


def test_recordings_have_their_rate(pose, open_motions):
    warping = DynamicTimeWarping(pose, travel_weight=1.0)
    assert warping.dist(open_motions[0], open_motions[0]) == 0.0
    with pytest.raises(rh.RiemhumanError, match="speed of m1 needs its frame rate"):
        warping.dist(open_motions[0][:10], open_motions[0])


def test_way_in_velocities(pose, space, motions):
    """A body that stands still and is carried is far from one that stands still."""
    still = np.repeat(motions[0][:1], 8, axis=0)
    warping = VelocityTimeWarping(pose, travel_weight=1.0)
    assert warping.dist(still, carried(still, 1.0)) == pytest.approx(1.0)
    # The way counts, not the speed.
    assert warping.dist(carried(still, 1.0), carried(still, 2.0)) > 0.1
    assert warping.dist(carried(still, 2.0)[:4], carried(still, 1.0)[:7]) < 1e-6
    assert VelocityTimeWarping(pose).dist(still, carried(still, 1.0)) < 1e-6


def test_other_points_do_not_travel():
    metric = rh.VectorSpace((4, 3)).metric
    a = np.random.default_rng(0).normal(size=(5, 4, 3))
    with pytest.raises(rh.RiemhumanError, match="travel_weight needs surfaces"):
        DynamicTimeWarping(metric, travel_weight=1.0, frames_per_second=1.0).dist(a, a)
    with pytest.raises(rh.RiemhumanError, match="travel_weight must be a finite number"):
        DynamicTimeWarping(metric, travel_weight=-1.0)
    with pytest.raises(rh.RiemhumanError, match="frames_per_second must be a finite number above"):
        DynamicTimeWarping(metric, frames_per_second=0.0)
