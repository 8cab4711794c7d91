"""Estimators keep their parameters as scikit-learn expects, and work in its tools."""

import pickle

import numpy as np
import pandas
import pytest
from cases import sphere_template, surfaces, triangle_template
from sklearn.base import clone
from sklearn.model_selection import cross_val_score

from riemhuman.errors import ArgumentError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, NormalFields, VectorSpace
from riemhuman.learned import MetricCodes
from riemhuman.motions import MotionComponents, MotionMean, MotionSpace
from riemhuman.retrieval.neighbors import NearestNeighbors
from riemhuman.solvers import (
    BasisMean,
    FrechetMean,
    GeodesicRegression,
    GeometricMedian,
    GradientDescentMean,
    NearestSurface,
    TangentPCA,
)
from riemhuman.statistics import HierarchicalClustering, KMedoids, LearnedMetric

ESTIMATORS = [
    TangentPCA(VectorSpace((2,)), 1, mean=GradientDescentMean(), nearest=NearestSurface()),
    GeodesicRegression(VectorSpace((2,)), max_iter=3),
    KMedoids(3, rng=np.random.default_rng(2)),
    HierarchicalClustering(3, linkage="single"),
    LearnedMetric(VectorSpace((2,)).metric),
    FrechetMean(VectorSpace((2,)), GradientDescentMean()),
    NearestNeighbors(VectorSpace((2,)).metric, 3, n_components=2),
    MotionComponents(MotionMean(MotionSpace(AlignedSurfaces(triangle_template()))), 2),
    GeometricMedian(AlignedSurfaces(triangle_template()), BasisMean(tolerance=1e-3)),
]


@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_parameters_are_those_of_the_constructor(estimator):
    params = estimator.get_params(deep=False)
    other = type(estimator)(**params)
    assert all(getattr(other, name) is value for name, value in params.items())
    name = list(params)[-1]
    assert other.set_params(**{name: "new"}) is other
    assert getattr(other, name) == "new"
    assert not any(key.endswith("_") for key in vars(other))
    assert repr(other).startswith(f"{type(estimator).__name__}(")
    assert f"{name}='new'" in repr(other)
    # Cloned by scikit-learn, and pickled.
    assert clone(estimator).get_params().keys() == estimator.get_params().keys()
    twin = pickle.loads(pickle.dumps(estimator))
    shown = [repr(one.get_params()).split(" at 0x")[0] for one in (twin, estimator)]
    assert shown[0] == shown[1]


@pytest.mark.parametrize("kind", [FrechetMean, TangentPCA])
def test_fitted_estimators_of_surfaces_are_pickled(kind):
    template = sphere_template()
    space = AlignedSurfaces(template).equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    estimator = kind(space).fit(surfaces(template, 4, size=0.05))
    twin = pickle.loads(pickle.dumps(estimator))
    name = "estimate_" if kind is FrechetMean else "components_"
    np.testing.assert_array_equal(getattr(twin, name), getattr(estimator, name))
    again = twin.fit(surfaces(template, 4, size=0.05))
    np.testing.assert_array_equal(getattr(again, name), getattr(estimator, name))


def test_parameters_of_parameters():
    estimator = TangentPCA(VectorSpace((2,)), mean=KMedoids(3))
    assert estimator.get_params()["mean__n_clusters"] == 3
    assert "mean__n_clusters" not in estimator.get_params(deep=False)
    estimator.set_params(mean__n_clusters=5)
    assert estimator.mean.n_clusters == 5
    with pytest.raises(ArgumentError, match="no parameter 'colour'.*'n_components'"):
        estimator.set_params(colour="red")


def test_cross_validation_by_scikit_learn():
    space = NormalFields(triangle_template())
    point = space.random_point(rng=1)
    velocity = space.random_tangent_vec(point, rng=2)
    times = np.linspace(-0.5, 0.5, 12)
    points = space.metric.exp(times[:, None, None] * velocity, point)
    scores = cross_val_score(GeodesicRegression(space), times[:, None], points, cv=3)
    np.testing.assert_allclose(scores, 1.0, atol=1e-6)


def transformers():
    """Return each estimator with `transform`, and what it is fitted to."""
    template = sphere_template()
    space = AlignedSurfaces(template).equip_with_metric(ElasticMetric, a=1.0, lam=1.0, c=1.0)
    points = surfaces(template, 6, size=0.05)
    return [
        (TangentPCA(space, 2), points, None),
        (LearnedMetric(space.metric), points, [0, 0, 0, 1, 1, 1]),
        (MetricCodes(space.metric, n_codes=4), points, None),
    ]


@pytest.mark.parametrize(("estimator", "points", "labels"), transformers())
def test_rows_and_data_frames_are_taken_like_points(estimator, points, labels):
    rows = points.reshape(len(points), -1)
    expected = estimator.fit(points, labels).transform(points)
    np.testing.assert_array_equal(estimator.fit_transform(rows, labels), expected)
    np.testing.assert_array_equal(estimator.transform(pandas.DataFrame(rows)), expected)


def test_what_is_not_fitted_says_so():
    space = VectorSpace((2,))
    with pytest.raises(ArgumentError, match="TangentPCA must be fitted first"):
        TangentPCA(space).transform(np.zeros((1, 2)))
    with pytest.raises(ArgumentError, match="TangentPCA must be fitted first"):
        TangentPCA(space).sample()
    with pytest.raises(ArgumentError, match="GeodesicRegression must be fitted first"):
        GeodesicRegression(space).predict([0.0])
    with pytest.raises(ArgumentError, match="KMedoids must be fitted first"):
        KMedoids().predict(np.zeros((1, 2)))
