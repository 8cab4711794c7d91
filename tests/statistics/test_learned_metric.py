"""A metric learned from labels, on people who were left out, and its properties."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist
from sklearn.covariance import LedoitWolf
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

import riemhuman as rh
from riemhuman.errors import ArgumentError, NotDefinedError
from riemhuman.retrieval import local_scaling, scores


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse", "natural")


@pytest.fixture(scope="module")
def metrics(bodies):
    space = rh.AlignedSurfaces(bodies.template)
    return {
        "pose": rh.ElasticMetric(space, a=0.0, lam=0.0, c=1.0),
        "rotations": rh.RotationMetric(space),
        "subject": rh.AreaMetric(space),
    }


@pytest.mark.parametrize(("name", "what"), [("rotations", "pose"), ("subject", "subject")])
def test_people_left_out_are_retrieved_better_than_without_labels(bodies, metrics, name, what):
    labels = getattr(bodies, what)
    learned = rh.LearnedMetric(metrics[name])
    found = scores(learned.held_out_distances(bodies.points, labels, bodies.subject), labels)
    plain = scores(metrics[name].dist_pairwise(bodies.points), labels)
    assert found.nn >= max(97.0, plain.nn)
    assert found.first_tier >= max(95.0, plain.first_tier)
    assert found.second_tier >= 99.4


def test_distances_across_and_within_folds(bodies, metrics):
    """Across folds, those of a metric fitted to the others; within, the mean of such metrics."""
    points, labels = bodies.points[:60], bodies.pose[:60]
    folds = bodies.subject[:60] % 5
    learned = rh.LearnedMetric(metrics["pose"])
    distances = learned.held_out_distances(points, labels, bodies.subject[:60])
    within = []
    for other in (1, 2, 3, 4):
        fitted = ~np.isin(folds, [0, other])
        metric = rh.LearnedMetric(metrics["pose"]).fit(points[fitted], labels[fitted])
        codes, others = (metric.transform(points[folds == fold]) for fold in (0, other))
        expected = cdist(codes, others)
        np.testing.assert_allclose(distances[folds == 0][:, folds == other], expected, atol=1e-4)
        within.append(cdist(codes, codes))
    training = distances[np.ix_(folds == 0, folds == 0)]
    np.testing.assert_allclose(training, np.mean(within, axis=0), atol=1e-4)
    np.testing.assert_array_equal(distances, distances.T)
    assert not distances.diagonal().any()


def test_the_metric_is_a_metric_as_others_are(bodies, metrics):
    learned = rh.LearnedMetric(metrics["pose"]).fit(bodies.points[:80], bodies.pose[:80])
    metric, new = learned.metric_, bodies.points[80:]
    codes = learned.transform(new)
    expected = cdist(codes, codes)
    np.testing.assert_allclose(metric.dist_pairwise(new), expected, atol=1e-4)
    np.testing.assert_allclose(metric.dist(new[0], new[1:]), expected[0, 1:], rtol=1e-9)
    distances, indices = rh.NearestNeighbors(metric, 3).fit(bodies.points).kneighbors(new[:2])
    all_codes = learned.transform(bodies.points)
    wanted = np.sort(cdist(codes[:2], all_codes), axis=1)[:, :3]
    np.testing.assert_allclose(distances, wanted, atol=1e-4)
    assert indices[:, 0].tolist() == [80, 81]
    # ‖(differential of the coordinates) h‖, by finite differences.
    h = 1e-6 * np.random.default_rng(1).standard_normal(new[0].shape)
    change = learned.transform((new[0] + h)[None]) - learned.transform((new[0] - h)[None])
    np.testing.assert_allclose(metric.norm(h, new[0]), np.linalg.norm(change) / 2, rtol=1e-4)


def test_agrees_with_scikit_learn(bodies, metrics):
    """Distances of linear discriminant analysis with the same shrinkage, and Ledoit and Wolf's."""
    points, labels = bodies.points[::4], bodies.subject[::4]
    learned = rh.LearnedMetric(metrics["subject"]).fit(points, labels)
    coordinates = metrics["subject"].lower_bound_coordinates(points)
    principal = np.linalg.svd(coordinates - coordinates.mean(axis=0), full_matrices=False)[0]
    centered = coordinates - coordinates.mean(axis=0)
    reduced = principal.T @ centered @ np.linalg.svd(centered, full_matrices=False)[2].T
    reduced = (principal * np.diag(reduced))[:, :-1]
    means = np.stack([reduced[labels == label].mean(axis=0) for label in labels])
    within = reduced - means
    scatter = within.T @ within / len(within)
    share = LedoitWolf(assume_centered=True).fit(within).shrinkage_
    assert learned.shrinkage_ == pytest.approx(share)
    ridge = np.trace(scatter) / len(scatter) * np.eye(len(scatter))
    shrunk = (1.0 - share) * scatter + share * ridge
    difference = reduced[0] - reduced[1:]
    expected = np.sqrt(np.sum(difference * np.linalg.solve(shrunk, difference.T).T, axis=1))
    codes = learned.transform(points)
    np.testing.assert_allclose(np.linalg.norm(codes[0] - codes[1:], axis=1), expected, rtol=1e-6)
    lda = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=share).fit(reduced, labels)
    centres = np.stack([codes[labels == label].mean(axis=0) for label in lda.classes_])
    nearest = lda.classes_[cdist(codes, centres).argmin(axis=1)]
    np.testing.assert_array_equal(nearest, lda.predict(reduced))


def test_refusals(bodies, metrics):
    with pytest.raises(ArgumentError, match="X must hold at least two points; found none"):
        rh.LearnedMetric(metrics["pose"]).fit(bodies.points[:0], [])
    points, labels = bodies.points[:20], bodies.pose[:20]
    learned = rh.LearnedMetric(metrics["pose"])
    with pytest.raises(ArgumentError, match="must be fitted first"):
        learned.transform(points)
    for arguments, message in (
        ((points, np.zeros(20)), "at least two classes"),
        ((points, np.arange(20)), "same class to two different points"),
    ):
        with pytest.raises(ArgumentError, match=message):
            learned.fit(*arguments)
    with pytest.raises(ArgumentError, match="at least 5 groups; found 2"):
        learned.held_out_distances(points, labels, bodies.subject[:20])
    sobolev = rh.SobolevMetric(rh.AlignedSurfaces(bodies.template))
    with pytest.raises(NotDefinedError, match="SobolevMetric does not define lower_bound"):
        rh.LearnedMetric(sobolev).fit(points, labels)


def test_local_scaling(bodies, metrics):
    """Scaling helps where people overlap; by lam = 1e-4, all their surfaces are first already."""
    space = metrics["pose"].space
    shape = rh.ElasticMetric(space, a=1.0, lam=1e-2, c=0.0)
    distances = shape.dist_pairwise(bodies.points)
    plain, scaled = (
        scores(distances, bodies.subject),
        scores(local_scaling(distances), bodies.subject),
    )
    assert scaled.first_tier > plain.first_tier
