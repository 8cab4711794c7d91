"""The rate-invariant distance: best matchings of polygons, and a metric of motions."""

import itertools

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.motions._velocity_curves import TransportedVelocities, best_matching


def squared_dist(segments_a, segments_b, n_steps=8):
    """Return the squared distance of polygons in a flat space, and the best matching."""
    directions, length = [], 0.0
    for segments in (segments_a, segments_b):
        lengths = np.linalg.norm(segments, axis=1)
        directions.append(segments / np.sqrt(np.where(lengths > 0, lengths, 1))[:, None])
        length += lengths.sum()
    products = directions[0] @ directions[1].T
    gain, path = best_matching(products, n_steps)
    return length - 2.0 * gain, path, products, gain


@pytest.mark.parametrize("seed", range(3))
def test_polygons(seed):
    """A finer polygon of one image is at 0, gains are those of the path, distances are a metric."""
    rng = np.random.default_rng(seed)
    segments = rng.standard_normal((5, 3))
    parts = [
        np.repeat(s[None] / k, k, axis=0) for s, k in zip(segments, [2, 1, 4, 1, 8], strict=True)
    ]
    finer = np.concatenate([*parts[:2], np.zeros((1, 3)), *parts[2:]])
    assert squared_dist(segments, finer)[0] == pytest.approx(0.0, abs=1e-9)

    _, path, products, gain = squared_dist(rng.standard_normal((6, 2)), rng.standard_normal((4, 2)))
    assert path[0].tolist() == [0, 0]
    assert path[-1].tolist() == [6, 4]
    assert (np.diff(path, axis=0) >= 0).all()
    total = 0.0
    for a, b in itertools.pairwise(path):
        cell = tuple(np.minimum((a + b).astype(float) / 2, [5.999, 3.999]).astype(int))
        total += max(products[cell], 0.0) * np.sqrt(np.prod(b - a))
    assert total == pytest.approx(gain, rel=1e-12)

    polygons = [rng.standard_normal((rng.integers(2, 7), 2)) for _ in range(2)]
    # The triangle inequality is nearly tight for a third polygon close to the first.
    polygons.append(polygons[0] + 0.2 * rng.standard_normal(polygons[0].shape))
    dist = {
        (i, j): np.sqrt(max(squared_dist(polygons[i], polygons[j])[0], 0.0))
        for i, j in itertools.combinations(range(3), 2)
    }
    for i, j, k in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        detour = sum(dist[tuple(sorted(pair))] for pair in ((i, k), (k, j)))
        assert dist[(i, j)] <= detour * (1 + 1e-3)


def test_gain_against_a_search_over_a_fine_grid():
    """Matchings that step from point to point of a grid of 16 steps a segment, in any slope."""
    rng = np.random.default_rng(5)
    n_fine = 16
    slopes = [(p, q) for p in range(1, 6) for q in range(1, 6) if np.gcd(p, q) == 1]
    for _ in range(3):
        a, b = rng.standard_normal((3, 2)), rng.standard_normal((2, 2))
        _, _, products, gain = squared_dist(a, b, n_steps=n_fine)
        best = np.zeros((3 * n_fine + 1, 2 * n_fine + 1))
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


METRICS = {
    "normals": lambda space: rh.ElasticMetric(space, a=0.0, lam=0.0, c=2.0),
    "elastic": lambda space: rh.ElasticMetric(space, a=1.0, lam=0.5, c=0.3),
    "srnf": rh.SRNFMetric,
    "rotations": rh.RotationMetric,
}


@pytest.mark.parametrize("name", METRICS)
def test_coordinates_of_velocities_are_orthonormal(space, motions, name):
    """Lengths and angles of transported velocities are those of the metric of fields."""
    metric, reference = METRICS[name](space), motions[1][0]
    segments = TransportedVelocities(metric, reference).segments(motions[0][:3])
    fields = metric.target_metric
    images = metric.map(motions[0][:3])
    middles = fields.exp(0.5 * fields.log(images[1:], images[:-1]), images[:-1])
    velocities = 2.0 * fields.log(images[1:], middles)
    base = metric.map(reference)
    transported = fields.parallel_transport(velocities, middles, end_point=np.stack([base, base]))
    expected = fields.inner_product(transported[:1], transported, base[None])
    np.testing.assert_allclose(segments[0] @ segments.T, np.ravel(expected), rtol=1e-8)
    lengths = np.linalg.norm(segments, axis=1)
    np.testing.assert_allclose(lengths, metric.dist(*np.stack([motions[0][:2], motions[0][1:3]])))


def test_metric_without_fields(space):
    with pytest.raises(rh.RiemhumanError, match="SRNFMetric; found FlatMetric"):
        rh.motions.RateInvariantMetric(
            rh.motions.MotionSpace(space), rh.VectorSpace((1202, 3)).metric
        )


def test_the_start_counts(space, pose, motions):
    metric = rh.motions.RateInvariantMetric(rh.motions.MotionSpace(space), heading=True)
    still = [np.repeat(motion[:1], 3, axis=0) for motion in motions[:2]]
    assert metric.dist(*still) == pytest.approx(pose.dist(motions[0][0], motions[1][0]), rel=1e-9)
