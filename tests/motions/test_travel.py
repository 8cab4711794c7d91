"""How fast and how far bodies travel, as a part of distances of motions."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions import DynamicTimeWarping, VelocityTimeWarping
from riemhuman.motions._travel import ground_places, travel_speeds, travelled_lengths


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


def test_recordings_have_their_rate(pose):
    warping = DynamicTimeWarping(pose, travel_weight=1.0)
    (motion,) = rh.datasets.load_open_motions("coarse", "lean runner", "knees", 4)
    assert warping.dist(motion, motion) == 0.0
    with pytest.raises(rh.RiemhumanError, match="speed of m1 depends on the frame rate"):
        warping.dist(motion[:5], motion)


def test_way_in_velocities(pose, space, motions):
    """A body that stands still and is carried is far from one that stands still."""
    still = np.repeat(motions[0][:1], 8, axis=0)
    warping = VelocityTimeWarping(pose, travel_weight=1.0)
    assert warping.dist(still, carried(still, 1.0)) == pytest.approx(1.0)
    # The way counts, not the speed.
    assert warping.dist(carried(still, 1.0), carried(still, 2.0)) > 0.1
    assert warping.dist(carried(still, 2.0)[:4], carried(still, 1.0)[:7]) < 1e-6
    assert VelocityTimeWarping(pose).dist(still, carried(still, 1.0)) < 1e-6


def test_places_and_ways(space, motions):
    places = ground_places(space, motions[0])
    areas = space.template.vertex_areas
    for place, frame in zip(places, motions[0], strict=True):
        expected = np.average(frame[:, [0, 2]], axis=0, weights=areas)
        np.testing.assert_allclose(place, expected, atol=1e-12)
    ways = travelled_lengths(space, np.array([[0.0, 0.0], [3.0, 4.0], [3.0, 0.0]]))
    leg = 0.5 * np.ptp(space.template.vertices[:, 1])
    np.testing.assert_allclose(ways, [0.0, 5.0 / leg, 9.0 / leg])


def test_speeds_are_those_within_a_quarter_of_a_second(space):
    """A jump between two of eighty frames a second is seen from ten frames before and after."""
    places = np.zeros((60, 2))
    places[30:] = [1.0, 0.0]
    speeds = travel_speeds(space, places, 80.0)
    np.testing.assert_array_equal(np.flatnonzero(speeds), np.arange(20, 40))
    np.testing.assert_allclose(speeds[25] * unit_of_speed(space), 80.0 / 20)


def test_other_points_do_not_travel():
    metric = rh.VectorSpace((4, 3)).metric
    a = np.random.default_rng(0).normal(size=(5, 4, 3))
    with pytest.raises(rh.RiemhumanError, match="travel_weight needs surfaces"):
        DynamicTimeWarping(metric, travel_weight=1.0, frames_per_second=1.0).dist(a, a)
