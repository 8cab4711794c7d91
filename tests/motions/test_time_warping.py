"""Time warping of frames and of velocities, against the least of all paths and known curves."""

import itertools

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions._warping_kernels import least_sums, match_chords, match_frames, trace_path


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


@pytest.mark.parametrize("shape", [(2, 2), (2, 5), (5, 2), (3, 4), (5, 5)])
def test_best_path_is_the_least_of_all_paths(shape):
    for seed in range(3):
        costs = np.random.default_rng(seed).uniform(size=shape)
        sums = least_sums(costs)
        least = min(weighted_sum(costs, path) for path in all_paths(*shape))
        found = weighted_sum(costs, [tuple(cell) for cell in trace_path(costs, sums)[::-1]])
        assert sums[-1, -1] == pytest.approx(least, rel=1e-12)
        assert found == pytest.approx(least, rel=1e-12)


class TestDynamicTimeWarping:
    def test_re_timing_is_nearly_nothing_where_positions_between_frames_count(
        self, pose, open_motions
    ):
        knees, other = open_motions[0][:60], open_motions[3][:60]
        hasty = np.delete(knees, range(3, 40, 3), axis=0)
        warping = rh.motions.DynamicTimeWarping(pose, between_frames=True)
        plain = rh.motions.DynamicTimeWarping(pose)
        assert warping.dist(knees, hasty) < 0.03 * warping.dist(knees, other)
        assert warping.dist(knees, hasty) < 0.5 * plain.dist(knees, hasty)

    def test_centring_removes_what_a_person_adds_to_every_frame(self):
        """In a flat space a constant added to all frames changes nothing."""
        rng = np.random.default_rng(3)
        space = rh.VectorSpace((4, 3))
        a, b = rng.standard_normal((2, 9, 4, 3)).cumsum(axis=1)
        warping = rh.motions.DynamicTimeWarping(space.metric, centered=True)
        moved = b + 10.0 * rng.standard_normal((4, 3))
        assert warping.dist(a, moved) == pytest.approx(warping.dist(a, b), rel=1e-9)
        plain = rh.motions.DynamicTimeWarping(space.metric)
        assert plain.dist(a, moved) > 1.1 * plain.dist(a, b)

    @pytest.mark.parametrize("name", ["pose", "shape"])
    def test_features_in_single_precision_lose_nothing(self, space, motions, name):
        """Frames of one motion that hardly differ are computed again in double precision."""
        metric = {
            "pose": rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
            "shape": rh.ElasticMetric(space, a=1.0, lam=1.0, c=0.0),
        }[name]
        warping = rh.motions.DynamicTimeWarping(metric, heading=True)
        a, b = motions[0][:6], motions[3][:5]
        costs = metric.cdist(a, b, precision="double") ** 2
        expected = np.sqrt(least_sums(costs)[-1, -1] / 11)
        assert warping.dist(a, b) == pytest.approx(expected, rel=1e-5)
        slow = np.repeat(a, 2, axis=0) + 1e-9 * np.arange(12)[:, None, None]
        assert warping.dist(a, slow) < 1e-5 * expected

    def test_metric_without_lower_bounds(self, space, motions):
        warping = rh.motions.DynamicTimeWarping(rh.SobolevMetric(space), n_components=3)
        with pytest.raises(rh.RiemhumanError, match="lower_bound_coordinates"):
            warping.dist_pairwise(motions)


def sum_at(steps, corners):
    """Return the sum that is minimised, from square root velocities as they are defined."""

    def roots(vectors):
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        return vectors / np.sqrt(np.where(lengths > 0.0, lengths, 1.0))

    v, w = np.diff(steps, axis=0), np.diff(corners, axis=0)
    opposed = np.sum(v * w, axis=1) < 0.0
    apart = np.sum((roots(v) - roots(w)) ** 2, axis=1)
    lengths = np.linalg.norm(v, axis=1) + np.linalg.norm(w, axis=1)
    return np.sum(np.where(opposed, lengths, apart))


def chord_tables(a, b):
    def squared(x, y):
        return np.sum((x[:, None] - y) ** 2, axis=-1)

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


@pytest.mark.parametrize("seed", range(0, 24, 5))
def test_chords_are_the_best_of_all_and_places_between_frames_lower_their_sum(seed):
    rng = np.random.default_rng(seed)
    n, m = 2 + seed % 4, 2 + seed // 4
    a, b = rng.standard_normal((n, 3)).cumsum(axis=0), rng.standard_normal((m, 3)).cumsum(axis=0)
    by_frames, places = match_frames(*chord_tables(a, b))
    inner = itertools.combinations_with_replacement(range(m), n - 2)
    least = min(sum_at(a, b[[0, *some, m - 1]]) for some in inner)
    assert by_frames == pytest.approx(least, rel=1e-9)
    assert sum_at(a, b[places.astype(int)]) == pytest.approx(least, rel=1e-9)
    total, places = match_chords(*chord_tables(a, b))
    assert total <= by_frames + 1e-12
    assert (np.diff(places) >= 0.0).all()
    assert places[[0, -1]].tolist() == [0.0, m - 1.0]
    assert total == pytest.approx(sum_at(a, at_places(b, places)), rel=1e-6, abs=1e-9)


def knot(times, n_turns=3):
    """Return points of a closed curve in three dimensions."""
    angles = 2.0 * np.pi * n_turns * times
    return np.stack([np.cos(angles), np.sin(angles), np.sin(2.0 * np.pi * times)], axis=1)[:, None]


FINE, FEW = np.linspace(0.0, 1.0, 201), np.linspace(0.0, 1.0, 15) ** 1.3


class TestVelocityTimeWarping:
    @pytest.fixture(scope="class")
    @staticmethod
    def flat():
        return rh.motions.VelocityTimeWarping(rh.VectorSpace((1, 3)).metric)

    def test_few_points_of_a_curve_are_near_the_curve(self, flat):
        """Chords of three turns in 15 points are far from the arcs that they replace."""
        warp = flat.warp(knot(FEW), knot(FINE))
        assert warp.dist < 1e-3
        np.testing.assert_allclose(warp(np.arange(15)), 200.0 * FEW, atol=0.05)

    def test_constants_change_nothing(self, flat):
        a, b = knot(FINE[::10]), knot(FINE[::8], 2)
        moved = b + np.array([3.0, -1.0, 2.0])
        assert flat.dist(a, moved) == pytest.approx(flat.dist(a, b), rel=1e-9)
        assert flat.dist(a, b) == flat.dist(b, a) > 0.2

    def test_standing_still_is_at_one_from_motion(self, flat, pose, motions):
        body = np.repeat(motions[0][:1], 5, axis=0)
        assert rh.motions.VelocityTimeWarping(pose).dist(body, body) == 0.0
        still = np.zeros((4, 1, 3))
        assert flat.dist(still, still[:2]) == 0.0
        assert flat.dist(still, knot(FEW)) == pytest.approx(1.0)
        assert flat.dist(knot(FEW), still) == pytest.approx(1.0)
