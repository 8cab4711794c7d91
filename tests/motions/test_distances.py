"""Properties that every distance of motions has."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import riemhuman as rh
from riemhuman.motions._frames import face_forward

DISTANCES = {
    "frames": lambda space, **o: rh.motions.DynamicTimeWarping(space.metric, **o),
    "frames and between": lambda space, **o: rh.motions.DynamicTimeWarping(
        space.metric, between_frames=True, **o
    ),
    "changes": lambda space, **o: rh.motions.DynamicTimeWarping(space.metric, centered=True, **o),
    "travel": lambda space, **o: rh.motions.DynamicTimeWarping(
        space.metric, travel_weight=1.0, frames_per_second=30.0, **o
    ),
    "velocities": lambda space, **o: rh.motions.VelocityTimeWarping(space.metric, **o),
    "rate-invariant": lambda space, **o: rh.motions.RateInvariantMetric(
        rh.motions.MotionSpace(space, n_times=10), **o
    ),
}
RETIMED = ["frames", "velocities", "rate-invariant"]


@pytest.fixture(params=DISTANCES)
def make(request, space):
    return lambda **options: DISTANCES[request.param](space, **options)


@pytest.fixture(params=RETIMED)
def distance(request, space):
    return DISTANCES[request.param](space)


def test_all_pairs_are_the_single_ones_in_both_orders(make, motions):
    unequal = [motions[0], motions[1][:7], motions[3][2:]]
    distance = make(n_jobs=2)
    distances = distance.dist_pairwise(unequal)
    assert not distances.diagonal().any()
    for i, j in itertools.combinations(range(3), 2):
        single = distance.dist(unequal[i], unequal[j])
        assert distances[i, j] == distances[j, i] == pytest.approx(single, rel=1e-9)
        assert distance.dist(unequal[j], unequal[i]) == pytest.approx(single, rel=1e-9)


@pytest.mark.parametrize(("name", "most"), [("frames", 0.2), ("rate-invariant", 0.1)])
def test_components_lower_distances_a_little(space, motions, name, most):
    exact = DISTANCES[name](space).dist_pairwise(motions[:4])
    projected = DISTANCES[name](space, n_components=30).dist_pairwise(motions[:4])
    assert (projected <= exact * (1 + 1e-9)).all()
    assert (projected >= (1 - most) * exact).all()


def test_repeated_frames_change_nothing(distance, motions):
    paused = np.repeat(motions[0], [1, 3, 1, 2, 1, 1, 1, 1, 1, 4], axis=0)
    assert distance.dist(motions[0], paused) == pytest.approx(0.0, abs=1e-6)
    warp = distance.warp(motions[0], paused)
    assert (warp.first[0], warp.second[0], warp.first[-1], warp.second[-1]) == (0, 0, 9, 15)


def test_known_re_timing_is_recovered(distance, full_motion, retiming):
    places, frames = retiming
    warp = distance.warp(frames, full_motion)
    assert np.median(np.abs(warp(np.arange(len(frames))) - places)) <= 1.0
    back = distance.warp(full_motion, frames)
    # Squares are computed: where the distance is 0, its square is rounding.
    assert back.dist**2 == pytest.approx(warp.dist**2, rel=1e-9, abs=1e-13)
    assert (back.first[-1], back.second[-1]) == (39, 29)


def test_heading_and_place_do_not_count(space, motions):
    angles = np.linspace(0.5, 2.5, len(motions[0]))
    rotation = Rotation.from_euler("y", angles[:, None]).as_matrix()
    elsewhere = motions[0] @ np.swapaxes(rotation, 1, 2) + [3.0, 0.0, 1.0]
    facing, other_facing = (face_forward(space, motion) for motion in (elsewhere, motions[1]))
    for name in RETIMED:
        known = DISTANCES[name](space).dist(motions[0], motions[1])
        assert DISTANCES[name](space).dist(elsewhere, motions[1]) == pytest.approx(known, rel=1e-6)
        assert DISTANCES[name](space, heading=True).dist(elsewhere, motions[1]) > 1.05 * known
        alike = DISTANCES[name](space, heading=True).dist(facing, other_facing)
        assert alike == pytest.approx(known, rel=1e-6)


def test_wrong_motions_are_named(distance, motions):
    damaged = np.concatenate([motions[0], motions[0]])
    damaged[17, 3, 1] = np.nan
    for wrong, message in (
        ((motions[0], motions[0][:1]), "m2 must have at least 2 frames; found 1"),
        ((damaged, motions[0]), "frame 17 of m1 holds NaN"),
        ((motions[0], motions[0][:, :-1]), "frames 0 to 9 of m2 must have shape"),
    ):
        with pytest.raises(rh.RiemhumanError, match=message):
            distance.dist(*wrong)
    for several, message in (
        ([motions[0], motions[0][:0]], r"motions\[1\] must have at least"),
        ([motions[0], iter(motions[0])], r"motions\[1\] must be an array, or have a length"),
        (iter(motions), "motions must be an array, or have a length"),
        (motions[0], "pass it in a list"),
    ):
        with pytest.raises(rh.RiemhumanError, match=message):
            distance.dist_pairwise(several)
