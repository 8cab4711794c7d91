"""scikit-learn on our distances: its neighbours and its classifier agree with ours."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.retrieval.neighbors import NearestNeighbors

neighbors = pytest.importorskip("sklearn.neighbors")
cluster = pytest.importorskip("sklearn.cluster")


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


@pytest.fixture(scope="module", params=[(1.0, 1e-4, 0.0), (0.0, 0.0, 1.0)], ids=["shape", "pose"])
def metric(request, bodies):
    return rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), *request.param)


@pytest.fixture(scope="module")
def distances(metric, bodies):
    return metric.dist_pairwise(bodies.points)


def test_nearest_neighbors(metric, bodies, distances):
    theirs = neighbors.NearestNeighbors(n_neighbors=5, metric="precomputed").fit(distances)
    expected, indices = theirs.kneighbors()
    found, ours = NearestNeighbors(metric, 5).fit(bodies.points).kneighbors()
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    np.testing.assert_array_equal(ours, indices)


def test_nearest_neighbor_score(bodies, distances):
    for labels in (bodies.subject, bodies.pose):
        hits = 0
        for i in range(len(labels)):
            others = np.delete(np.arange(len(labels)), i)
            one = neighbors.KNeighborsClassifier(1, metric="precomputed")
            one.fit(distances[np.ix_(others, others)], labels[others])
            hits += int(one.predict(distances[i, others][None])[0] == labels[i])
        scores = rh.retrieval.scores(distances, labels)
        assert scores.nn == pytest.approx(100 * hits / len(labels))


def test_clusters_are_people_or_poses(metric, bodies, distances):
    labels = bodies.subject if metric.a else bodies.pose
    found = cluster.AgglomerativeClustering(10, metric="precomputed", linkage="average")
    clusters = found.fit_predict(distances)
    same = clusters[:, None] == clusters
    # Guessing agrees in 0.82 of the pairs; people are closer to each other than poses are.
    agreement = np.mean(same == (labels[:, None] == labels))
    assert agreement > (0.9 if metric.a else 0.97)
