"""Dynamic time warping against the least of all paths, re-timings that are known, and bad input."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import riemhuman as rh
from riemhuman.motions.dtw_kernels import accumulate, lower_bound
from riemhuman.motions.dynamic_time_warping import best_path


def all_paths(n, m):
    """Yield every monotone path from corner to corner."""
    steps = [(1, 1), (1, 0), (0, 1)]
    unfinished = [[(0, 0)]]
    while unfinished:
        path = unfinished.pop()
        i, j = path[-1]
        if (i, j) == (n - 1, m - 1):
            yield path
        unfinished += [[*path, (i + a, j + b)] for a, b in steps if i + a < n and j + b < m]


def weighted_sum(costs, path):
    weights = [2] + [(b[0] - a[0]) + (b[1] - a[1]) for a, b in itertools.pairwise(path)]
    return sum(w * costs[cell] for w, cell in zip(weights, path, strict=True))


def in_window(path, shape, window):
    n, m = shape
    return all(abs(i / (n - 1) - j / (m - 1)) <= window + 1e-12 for i, j in path)


tables = st.tuples(st.integers(2, 5), st.integers(2, 5), st.integers(0, 2**32 - 1)).map(
    lambda drawn: np.random.default_rng(drawn[2]).uniform(size=drawn[:2])
)


@settings(max_examples=40, deadline=None)
@given(costs=tables, window=st.sampled_from([0.3, 0.6, math.inf]))
def test_best_path_is_the_least_of_all_paths(costs, window):
    paths = [p for p in all_paths(*costs.shape) if in_window(p, costs.shape, window)]
    if not paths:
        with pytest.raises(rh.RiemhumanError, match="admits no path"):
            best_path(costs, window)
        return
    total, cells = best_path(costs, window)
    least = min(weighted_sum(costs, path) for path in paths)
    assert total == pytest.approx(least, rel=1e-12)
    assert weighted_sum(costs, [tuple(cell) for cell in cells]) == pytest.approx(least, rel=1e-12)
    assert lower_bound(costs, window) <= least * (1 + 1e-12)


@settings(max_examples=40, deadline=None)
@given(costs=tables)
def test_window_that_an_error_names_admits_a_path(costs):
    try:
        best_path(costs, 0.0)
    except rh.RiemhumanError as error:
        wide = float(str(error).split("; ")[1].split()[0])
        assert best_path(costs, wide)[0] < math.inf


def test_work_is_given_up_once_all_sums_are_too_large():
    costs = np.ones((6, 6))
    assert accumulate(costs, math.inf, 5.0, np.empty((6, 6))) == 5


class TestMotions:
    def test_a_motion_is_nothing_from_itself_held_longer(self, pose, motions):
        held = np.repeat(motions[0], [1, 3, 1, 2, 1, 1, 1, 1, 1, 4], axis=0)
        warping = rh.motions.DynamicTimeWarping(pose)
        assert warping.dist(motions[0], held) == 0.0
        warp = warping.warp(motions[0], held)
        assert warp.first[0] == warp.second[0] == 0
        assert (warp.first[-1], warp.second[-1]) == (9, 15)
        assert warp(1.0) == 2.0  # frames 1, 2 and 3

    def test_it_is_symmetric(self, pose, motions):
        warping = rh.motions.DynamicTimeWarping(pose, n_times=12, centered=True)
        there, back = (
            warping.dist(motions[0], motions[1]),
            warping.dist(motions[1], motions[0]),
        )
        assert there == pytest.approx(back, rel=1e-12)

    def test_known_re_timing_is_recovered(self, pose, full_motion, retiming):
        places, frames = retiming
        warp = rh.motions.DynamicTimeWarping(pose).warp(frames, full_motion)
        assert np.median(np.abs(warp(np.arange(len(frames))) - places)) <= 1.0

    def test_re_timing_is_nearly_nothing_where_places_between_frames_count(
        self, pose, open_motions
    ):
        knees, other = open_motions[0][:60], open_motions[3][:60]
        hasty = np.delete(knees, range(3, 40, 3), axis=0)
        warping = rh.motions.DynamicTimeWarping(pose, between_frames=True)
        plain = rh.motions.DynamicTimeWarping(pose)
        assert warping.dist(knees, hasty) < 0.03 * warping.dist(knees, other)
        assert warping.dist(knees, hasty) < 0.5 * plain.dist(knees, hasty)

    @pytest.mark.parametrize(
        "options", [{"between_frames": True}, {"n_times": 15, "centered": True}, {"window": 0.3}]
    )
    def test_all_pairs_are_the_single_ones(self, pose, motions, options):
        warping = rh.motions.DynamicTimeWarping(pose, n_jobs=2, **options)
        distances = warping.dist_pairwise(motions)
        for i, j in itertools.combinations(range(len(motions)), 2):
            single = warping.dist(motions[i], motions[j])
            assert distances[i, j] == distances[j, i] == pytest.approx(single, rel=1e-9)
        assert not distances.diagonal().any()

    def test_projected_distances_are_below_and_near(self, pose, motions):
        exact = rh.motions.DynamicTimeWarping(pose).dist_pairwise(motions)
        projected = rh.motions.DynamicTimeWarping(pose, n_components=20).dist_pairwise(motions)
        assert (projected <= exact * (1 + 1e-9)).all()
        assert (projected >= 0.8 * exact).all()

    def test_neighbours_are_those_of_all_distances(self, pose, motions):
        warping = rh.motions.DynamicTimeWarping(pose)
        found, indices = warping.kneighbors(motions[:2], motions, 3)
        distances = warping.dist_pairwise(motions)
        assert indices.tolist() == np.argsort(distances[:2], axis=1, kind="stable")[:, :3].tolist()
        np.testing.assert_allclose(found, np.sort(distances[:2], axis=1)[:, :3], rtol=1e-9)

    def test_centring_takes_off_what_a_person_adds_to_every_frame(self):
        """In a flat space a constant added to all frames changes nothing."""
        rng = np.random.default_rng(3)
        space = rh.VectorSpace((4, 3))
        one, other = rng.standard_normal((2, 9, 4, 3)).cumsum(axis=1)
        warping = rh.motions.DynamicTimeWarping(space.metric, centered=True, n_times=20)
        moved = other + 10.0 * rng.standard_normal((4, 3))
        assert warping.dist(one, moved) == pytest.approx(warping.dist(one, other), rel=1e-9)
        plain = rh.motions.DynamicTimeWarping(space.metric, n_times=20)
        assert plain.dist(one, moved) > 1.1 * plain.dist(one, other)

    def test_interpolation_is_that_of_coordinates_in_a_flat_space(self):
        from scipy.interpolate import CubicSpline

        rng = np.random.default_rng(4)
        space = rh.VectorSpace((2, 3))
        one, other = rng.standard_normal((7, 2, 3)), rng.standard_normal((5, 2, 3))
        finer = [
            CubicSpline(np.arange(len(m)), m)(np.linspace(0, len(m) - 1, 16)) for m in (one, other)
        ]
        interpolated = rh.motions.DynamicTimeWarping(space.metric, n_times=16).warp(one, other)
        expected = rh.motions.DynamicTimeWarping(space.metric).warp(*finer)
        assert interpolated.dist == pytest.approx(expected.dist, rel=1e-9)
        np.testing.assert_allclose(interpolated.first, expected.first * 6 / 15)


class TestBadInput:
    def test_one_frame(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match="m2 must have at least 2 frames; found 1"):
            rh.motions.DynamicTimeWarping(pose).dist(motions[0], motions[0][:1])

    def test_no_frame(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match=r"motions\[1\] must have at least one frame"):
            rh.motions.DynamicTimeWarping(pose).dist_pairwise([motions[0], motions[0][:0]])

    def test_frame_that_is_not_finite_is_named(self, pose, motions):
        damaged = np.concatenate([motions[0], motions[0]])
        damaged[17, 3, 1] = np.nan
        with pytest.raises(rh.RiemhumanError, match="frame 17 of m1 holds NaN"):
            rh.motions.DynamicTimeWarping(pose).dist(damaged, motions[0])

    def test_other_template(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match=r"frames 0 to 9 of m2 must have shape"):
            rh.motions.DynamicTimeWarping(pose).dist(motions[0], motions[0][:, :-1])

    def test_window_without_a_path(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match="window=0.01 admits no path between 10 and 7"):
            rh.motions.DynamicTimeWarping(pose, window=0.01).dist(motions[0], motions[0][:7])

    def test_one_motion_in_place_of_several(self, pose, motions):
        with pytest.raises(rh.RiemhumanError, match=r"give it in a list"):
            rh.motions.DynamicTimeWarping(pose).dist_pairwise(motions[0])

    def test_metric_without_lower_bounds(self, motions):
        warping = rh.motions.DynamicTimeWarping(rh.VectorSpace((1202, 3)).metric, n_components=3)
        with pytest.raises(rh.RiemhumanError, match="lower_bound_coordinates"):
            warping.dist_pairwise(motions)
