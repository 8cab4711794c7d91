"""The rate-invariant distance: re-timing does not change it, and it is a metric."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import riemhuman as rh
from riemhuman.motions.transported_velocities import TransportedVelocities
from riemhuman.motions.velocity_kernels import best_gain, trace_gain


def squared_dist(segments_a, segments_b, n_steps=8):
    """Return the squared distance of polygons in a flat space, and the best matching."""
    directions, length = [], 0.0
    for segments in (segments_a, segments_b):
        lengths = np.linalg.norm(segments, axis=1)
        directions.append(segments / np.sqrt(np.where(lengths > 0, lengths, 1))[:, None])
        length += lengths.sum()
    products = directions[0] @ directions[1].T
    n, m = products.shape
    lower, left = np.empty((n + 1, m, n_steps + 1)), np.empty((n, m + 1, n_steps + 1))
    gain = best_gain(products, n_steps, lower, left)
    path = np.empty((n + m + 2, 2))
    count = trace_gain(products, n_steps, lower, left, path)
    return length - 2.0 * gain, path[:count][::-1], products, gain


seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=25, deadline=None)
@given(seed=seeds)
def test_distance_to_a_finer_polygon_of_the_same_image_is_zero(seed):
    rng = np.random.default_rng(seed)
    segments = rng.standard_normal((5, 3))
    parts = [
        np.repeat(s[None] / k, k, axis=0) for s, k in zip(segments, [2, 1, 4, 1, 8], strict=True)
    ]
    still = np.zeros((1, 3))
    finer = np.concatenate([*parts[:2], still, *parts[2:]])
    squared, *_ = squared_dist(segments, finer)
    assert squared == pytest.approx(0.0, abs=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=seeds)
def test_gain_is_that_of_the_path_that_is_traced(seed):
    """Every piece of the matching is straight within one pair of segments."""
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((6, 2)), rng.standard_normal((4, 2))
    _, path, products, gain = squared_dist(a, b)
    assert path[0].tolist() == [0, 0]
    assert path[-1].tolist() == [6, 4]
    assert (np.diff(path, axis=0) >= 0).all()
    total = 0.0
    for one, other in itertools.pairwise(path):
        cell = tuple(np.minimum((one + other).astype(float) / 2, [5.999, 3.999]).astype(int))
        total += max(products[cell], 0.0) * np.sqrt(np.prod(other - one))
    assert total == pytest.approx(gain, rel=1e-12)


def test_gain_against_a_search_over_a_fine_grid():
    """Matchings that step from point to point of a grid of 16 steps a segment, in any slope."""
    rng = np.random.default_rng(5)
    for _ in range(3):
        a, b = rng.standard_normal((3, 2)), rng.standard_normal((2, 2))
        _, _, products, gain = squared_dist(a, b, n_steps=16)
        n_fine = 16
        best = np.zeros((3 * n_fine + 1, 2 * n_fine + 1))
        slopes = [(p, q) for p in range(1, 6) for q in range(1, 6) if np.gcd(p, q) == 1]
        for i, j in np.ndindex(*best.shape):
            options = [best[i - 1, j]] if i else []
            options += [best[i, j - 1]] if j else []
            for p, q in slopes:
                if i < p or j < q or (i - 1) // n_fine != (i - p) // n_fine:
                    continue
                if (j - 1) // n_fine != (j - q) // n_fine:
                    continue
                product = max(products[(i - 1) // n_fine, (j - 1) // n_fine], 0.0)
                options.append(best[i - p, j - q] + product * np.sqrt(p * q) / n_fine)
            best[i, j] = max(options, default=0.0)
        assert gain >= best[-1, -1] - 1e-12
        assert gain == pytest.approx(best[-1, -1], rel=5e-3)


@settings(max_examples=30, deadline=None)
@given(seed=seeds)
def test_triangle_inequality_of_polygons(seed):
    rng = np.random.default_rng(seed)
    polygons = [rng.standard_normal((rng.integers(2, 7), 2)) for _ in range(2)]
    # A third between them, where the inequality is tight.
    polygons.append(polygons[0] + 0.2 * rng.standard_normal(polygons[0].shape))
    dist = {
        (i, j): np.sqrt(max(squared_dist(polygons[i], polygons[j])[0], 0.0))
        for i, j in itertools.combinations(range(3), 2)
    }
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        way_round = sum(dist[tuple(sorted(pair))] for pair in ((i, k), (k, j)))
        assert dist[(i, j)] <= way_round * (1 + 1e-3)


@pytest.fixture(scope="module")
def motion_space(space):
    return rh.motions.MotionSpace(space, n_times=10)


@pytest.fixture(scope="module")
def metric(motion_space):
    return rh.motions.RateInvariantMetric(motion_space)


class TestVelocities:
    @pytest.mark.parametrize("name", ["normals", "elastic", "srnf", "rotations"])
    def test_coordinates_are_orthonormal(self, space, motions, name):
        """Lengths and angles of transported velocities are those of the metric of fields."""
        metric = {
            "normals": rh.ElasticMetric(space, a=0.0, lam=0.0, c=2.0),
            "elastic": rh.ElasticMetric(space, a=1.0, lam=0.5, c=0.3),
            "srnf": rh.SRNFMetric(space),
            "rotations": rh.RotationMetric(space),
        }[name]
        reference = motions[1][0]
        segments = TransportedVelocities(metric, reference).segments(motions[0][:3])
        fields = metric.target_metric
        images = metric.map(motions[0][:3])
        middles = fields.exp(0.5 * fields.log(images[1:], images[:-1]), images[:-1])
        velocities = 2.0 * fields.log(images[1:], middles)
        base = metric.map(reference)
        carried = fields.parallel_transport(velocities, middles, end_point=np.stack([base, base]))
        expected = fields.inner_product(carried[:1], carried, base[None])
        np.testing.assert_allclose(segments[0] @ segments.T, np.ravel(expected), rtol=1e-8)
        lengths = np.linalg.norm(segments, axis=1)
        np.testing.assert_allclose(
            lengths, metric.dist(*np.stack([motions[0][:2], motions[0][1:3]]))
        )

    def test_metric_without_fields(self, motion_space):
        with pytest.raises(rh.RiemhumanError, match="SRNFMetric; found FlatMetric"):
            rh.motions.RateInvariantMetric(motion_space, rh.VectorSpace((1202, 3)).metric)


class TestMotions:
    def test_it_is_symmetric_and_zero_on_the_diagonal(self, metric, motions):
        there, back = metric.dist(motions[0], motions[1]), metric.dist(motions[1], motions[0])
        assert there == pytest.approx(back, rel=1e-12)
        assert metric.dist(motions[0], motions[0]) == pytest.approx(0.0, abs=1e-6)

    def test_frames_that_are_held_change_nothing(self, metric, motions):
        held = np.repeat(motions[0], [1, 3, 1, 2, 1, 1, 1, 1, 1, 4], axis=0)
        assert metric.dist(motions[0], held) == pytest.approx(0.0, abs=1e-6)

    def test_re_timing_is_less_than_another_person(self, metric, motion_space, open_motions):
        arms, other = open_motions[2], open_motions[5]
        sharp = rh.motions.RateInvariantMetric(motion_space, smoothing=0.0)
        shares = [
            each.dist(arms[:101], arms[:101:2]) / each.dist(arms[:101:2], other[:101:2])
            for each in (metric, sharp)
        ]
        assert shares[0] < 0.6 * shares[1] < 0.09

    def test_known_re_timing_is_recovered(self, metric, full_motion, retiming):
        places, frames = retiming
        warp = metric.warp(frames, full_motion)
        assert np.median(np.abs(warp(np.arange(len(frames))) - places)) <= 1.0
        assert warp.dist == pytest.approx(float(metric.dist(frames, full_motion)))

    def test_all_pairs_are_the_single_ones(self, metric, motions):
        unequal = [motions[0], motions[1][:7], motions[2], motions[3][2:]]
        distances = metric.dist_pairwise(unequal, n_jobs=2)
        for i, j in itertools.combinations(range(4), 2):
            single = metric.dist(unequal[i], unequal[j])
            assert distances[i, j] == distances[j, i] == pytest.approx(single, rel=1e-9)

    def test_components_lower_distances_and_little(self, motion_space, metric, motions):
        reduced = rh.motions.RateInvariantMetric(motion_space, n_components=40)
        exact, low = metric.dist_pairwise(motions), reduced.dist_pairwise(motions)
        assert (low <= exact * (1 + 1e-9)).all()
        assert (low >= 0.9 * exact).all()

    def test_neighbours_and_other_rooms_take_it(self, metric, motions):
        points = np.stack(motions)
        distances = metric.dist_pairwise(points)
        np.testing.assert_allclose(metric.cdist(points[:2], points), distances[:2], atol=1e-6)
        neighbors = rh.NearestNeighbors(metric, n_neighbors=2, n_pivots=2).fit(points)
        _, indices = neighbors.kneighbors()
        expected = np.argsort(distances + np.diag([np.inf] * len(points)), axis=1)[:, :2]
        assert indices.tolist() == expected.tolist()
        found = rh.statistics.KMedoids(3).fit(distances).labels_
        assert len(set(found[[0, 3]])) == len(set(found[[1, 4]])) == 1

    def test_jobs_take_motions(self, metric, motion_space, motions, tmp_path):
        points = np.stack(motions[:3])
        for each in (metric, motion_space.metric):
            found = rh.pairwise_job(each, points, tmp_path / type(each).__name__)
            np.testing.assert_allclose(found, each.dist_pairwise(points), atol=1e-12)

    def test_start_counts_by_its_weight(self, motion_space, metric, motions):
        without = rh.motions.RateInvariantMetric(motion_space, start_weight=0.0)
        gap = metric.squared_dist(motions[0], motions[1]) - without.squared_dist(*motions[:2])
        start = metric.metric.squared_dist(motions[0][0], motions[1][0])
        assert gap == pytest.approx(float(start), rel=1e-9)


class TestBadInput:
    def test_one_frame(self, metric, motions):
        with pytest.raises(rh.RiemhumanError, match="point_b must have at least 2 frames"):
            metric.dist(motions[0], motions[0][:1])

    def test_frame_that_is_not_finite_is_named(self, metric, motions):
        damaged = motions[0].copy()
        damaged[4, 0, 0] = np.inf
        with pytest.raises(rh.RiemhumanError, match=r"frame 4 of points\[1\] holds NaN"):
            metric.dist_pairwise([motions[0], damaged])

    def test_smoothing_below_zero(self, motion_space):
        with pytest.raises(rh.RiemhumanError, match="smoothing must be"):
            rh.motions.RateInvariantMetric(motion_space, smoothing=-0.1)

    def test_reference_without_area(self, motion_space):
        with pytest.raises(rh.RiemhumanError, match="reference must have an area"):
            rh.motions.RateInvariantMetric(motion_space, reference=np.zeros((1202, 3)))
