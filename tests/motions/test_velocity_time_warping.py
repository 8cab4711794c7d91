"""Time warping of velocities: any sampling of a motion is near it, and other motions are far."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import riemhuman as rh
from riemhuman.motions.chord_kernels import _match_frames, match_chords


def squared(a, b):
    return np.sum((a[:, None] - b) ** 2, axis=-1)


def roots(vectors):
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.sqrt(np.where(lengths > 0.0, lengths, 1.0))


def sum_at(steps, corners):
    """Return the sum that is to be least, from square root velocities as they are defined."""
    v, w = np.diff(steps, axis=0), np.diff(corners, axis=0)
    opposed = np.sum(v * w, axis=1) < 0.0
    apart = np.sum((roots(v) - roots(w)) ** 2, axis=1)
    lengths = np.linalg.norm(v, axis=1) + np.linalg.norm(w, axis=1)
    return np.sum(np.where(opposed, lengths, apart))


def tables_of(a, b):
    return squared(a, b), np.linalg.norm(np.diff(a, axis=0), axis=1), squared(b, b)


def at_places(points, places):
    """Return points between points, from the cubic through the four about each."""
    result = np.empty((len(places), points.shape[1]))
    for row, place in zip(result, places, strict=True):
        count = min(4, len(points))
        first = min(max(int(place) - 1, 0), len(points) - count)
        cubic = np.linalg.solve(np.vander(np.arange(count)), points[first : first + count])
        row[:] = np.vander([place - first], count)[0] @ cubic
    return result


curves = st.tuples(st.integers(2, 5), st.integers(2, 7), st.integers(0, 2**32 - 1)).map(
    lambda drawn: [
        np.random.default_rng(drawn[2] + k).standard_normal((n, 3)).cumsum(axis=0)
        for k, n in enumerate(drawn[:2])
    ]
)


@settings(max_examples=20, deadline=None)
@given(pair=curves)
def test_chords_from_frame_to_frame_are_the_best_of_all(pair):
    a, b = pair
    places = np.empty(len(a))
    total = _match_frames(*tables_of(a, b), places)
    inner = itertools.combinations_with_replacement(range(len(b)), len(a) - 2)
    least = min(sum_at(a, b[[0, *some, len(b) - 1]]) for some in inner)
    assert total == pytest.approx(least, rel=1e-9)
    assert sum_at(a, b[places.astype(int)]) == pytest.approx(least, rel=1e-9)


@settings(max_examples=20, deadline=None)
@given(pair=curves)
def test_places_between_frames_lower_the_sum_to_what_is_returned(pair):
    a, b = pair
    places, frames = np.empty((2, len(a)))
    total = match_chords(*tables_of(a, b), places)
    assert total <= _match_frames(*tables_of(a, b), frames) + 1e-12
    assert (np.diff(places) >= 0.0).all()
    assert places[[0, -1]].tolist() == [0.0, len(b) - 1.0]
    assert total == pytest.approx(sum_at(a, at_places(b, places)), rel=1e-6, abs=1e-9)


def knot(times, n_turns=3):
    """A closed curve in three dimensions."""
    turns = 2.0 * np.pi * n_turns * times
    return np.stack([np.cos(turns), np.sin(turns), np.sin(2.0 * np.pi * times)], axis=1)[:, None]


@pytest.fixture(scope="module")
def flat():
    return rh.motions.VelocityTimeWarping(rh.VectorSpace((1, 3)).metric)


FINE, FEW = np.linspace(0.0, 1.0, 201), np.linspace(0.0, 1.0, 15) ** 1.3


class TestFlatSpace:
    def test_few_points_of_a_curve_are_the_curve(self, flat):
        """Three turns in 15 points: chords are far from the arcs that they pass by."""
        warp = flat.warp(knot(FEW), knot(FINE))
        assert warp.dist < 1e-3
        np.testing.assert_allclose(warp(np.arange(15)), 200.0 * FEW, atol=0.05)

    def test_it_is_symmetric(self, flat):
        there, back = (flat.dist(*p) for p in itertools.permutations((knot(FEW), knot(FINE, 2))))
        assert there == back > 0.2

    def test_what_is_added_to_all_frames_and_pauses_change_nothing(self, flat):
        one, other = knot(FINE[::10]), knot(FINE[::8], 2)
        moved = other + np.array([3.0, -1.0, 2.0])
        assert flat.dist(one, moved) == pytest.approx(flat.dist(one, other), rel=1e-9)
        paused = np.repeat(one, np.where(np.arange(21) % 5, 1, 3), axis=0)
        assert flat.dist(one, paused) == pytest.approx(0.0, abs=1e-7)

    def test_stillness_is_at_one_from_motion(self, flat):
        still = np.zeros((4, 1, 3))
        assert flat.dist(still, still[:2]) == 0.0
        assert flat.dist(still, knot(FEW)) == pytest.approx(1.0)
        assert flat.dist(knot(FEW), still) == pytest.approx(1.0)


class TestBodies:
    @pytest.fixture(scope="class")
    @staticmethod
    def warping(pose):
        return rh.motions.VelocityTimeWarping(pose)

    def test_motion_is_near_its_own_re_timing(self, pose, warping, open_motions):
        """At 8 frames in a second, half of them between those at 60."""
        arms, other = open_motions[2], open_motions[5]
        slow = rh.datasets.load_open_motions("coarse", "lean runner", "shake_arms", 8)[0]
        few, whole = slow[:17], arms[:121]
        warp = warping.warp(few, whole)
        np.testing.assert_allclose(warp(np.arange(17)), 7.5 * np.arange(17), atol=0.5)
        assert warp.dist < 0.02 * warping.dist(few, other[:121])
        plain = rh.motions.DynamicTimeWarping(pose, between_frames=True)
        assert plain.dist(few, whole) > 0.06 * plain.dist(few, other[:121])

    def test_known_re_timing_is_recovered(self, warping, full_motion, retiming):
        places, frames = retiming
        warp = warping.warp(frames, full_motion)
        np.testing.assert_allclose(warp(np.arange(len(frames))), places, atol=0.5)
        back = warping.warp(full_motion, frames)
        assert back.dist == warp.dist
        assert back.first[-1] == 39
        assert back.second[-1] == 29

    def test_all_pairs_are_the_single_ones(self, pose, motions):
        warping = rh.motions.VelocityTimeWarping(pose, n_jobs=2)
        unequal = [motions[0], motions[1][:7], motions[2], motions[3][2:]]
        distances = warping.dist_pairwise(unequal)
        for i, j in itertools.combinations(range(4), 2):
            single = warping.dist(unequal[i], unequal[j])
            assert distances[i, j] == distances[j, i] == pytest.approx(single, rel=1e-9)
        assert not distances.diagonal().any()

    def test_components_change_distances_little(self, warping, pose, motions):
        projected = rh.motions.VelocityTimeWarping(pose, n_components=30).dist_pairwise(motions)
        np.testing.assert_allclose(projected, warping.dist_pairwise(motions), atol=0.05)

    def test_motions_are_averaged_on_its_clock(self, space, pose, motions):
        motion_space = rh.motions.MotionSpace(space, n_times=3)
        alignment = rh.motions.VelocityTimeWarping(pose)
        mean = rh.motions.MotionMean(motion_space, alignment=alignment, n_iterations=1)
        held = np.repeat(motions[0], [1, 2, 1, 1, 1, 1, 3, 1, 1, 1], axis=0)
        mean.fit([motions[0], held])
        assert mean.variance_ < 1e-3


class TestBadInput:
    def test_one_frame(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match="m2 must have at least 2 frames; found 1"):
            rh.motions.VelocityTimeWarping(pose).dist(motions[0], motions[0][:1])

    def test_frame_that_is_not_finite_is_named(self, pose, motions):
        damaged = motions[0].copy()
        damaged[4, 0, 0] = np.nan
        with pytest.raises(rh.RiemhumanError, match=r"frame 4 of motions\[1\] holds NaN"):
            rh.motions.VelocityTimeWarping(pose).dist_pairwise([motions[0], damaged])

    @pytest.mark.parametrize("options", [{"n_steps": 0}, {"n_components": 0}, {"n_jobs": 0}])
    def test_parameter_out_of_range(self, pose, options):
        with pytest.raises(rh.RiemhumanError, match=next(iter(options))):
            rh.motions.VelocityTimeWarping(pose, **options)
