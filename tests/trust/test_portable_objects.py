"""Public objects pickle, copy and compare the same before and after every public call."""

import copy
import json
import pickle

import numpy as np
import pytest
from cases import CASES, name_of, sphere_template, surfaces

import riemhuman as rh
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.vector_space import VectorSpace
from riemhuman.solvers import (
    BasisMean,
    BasisPath,
    DiscreteExponential,
    DiscreteLogarithm,
    GradientDescentMean,
    LinearPath,
    PathStraightening,
    PoleLadder,
)
from riemhuman.storage.fingerprint import describe

TEMPLATE = sphere_template()
POINTS = surfaces(TEMPLATE, 4, rng=1, size=0.05)
BASIS = rh.DeformationBasis.from_laplacian(TEMPLATE, 6)


def twins(value):
    """Return a value as it comes out of a pickle, and its copies."""
    return pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)


def use(case):
    """Call what a metric offers, and return what it says."""
    metric, points, vectors = case.metric, case.points, case.tangent_vecs
    found = [metric.inner_product(vectors[0], vectors[1], points[0])]
    found += [metric.norm(vectors[0], points[0]), metric.energy(points[:3])]
    found.append(metric.energy_and_gradient(points[:3])[1])
    if "dist" in case.can:
        found += [metric.dist(points[0], points[1]), metric.dist_pairwise(points)]
    if "geodesic" in case.can:
        found.append(metric.geodesic(points[0], points[1])(0.3))
    if "log" in case.can:
        found.append(metric.log(points[1], points[0]))
    return [np.asarray(each) for each in found]


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_metrics_before_and_after_their_use(case):
    described, number = json.dumps(describe(case.metric)), hash(case.metric)
    unused = pickle.loads(pickle.dumps(case.metric))
    expected = use(case)
    assert (json.dumps(describe(case.metric)), hash(case.metric)) == (described, number)
    pickled, copied, deep = twins(case.metric)
    for metric in (pickled, copied, deep):
        assert json.dumps(describe(metric)) == described
    for metric in (unused, pickled, deep):
        for one, other in zip(use(replaced(case, metric)), expected, strict=True):
            np.testing.assert_array_equal(one, other)


def replaced(case, metric):
    """Return a case with another metric."""
    other = copy.copy(case)
    object.__setattr__(other, "metric", metric)
    return other


def test_a_copy_does_not_keep_what_another_metric_is():
    """Energies of a copy come from its own template and weights."""
    metric = ElasticMetric(AlignedSurfaces(TEMPLATE, equip=False), 1.0, 1.0, 0.0)
    metric.energy(POINTS)
    copied = copy.deepcopy(metric)
    assert copied.space is not metric.space
    for cached in vars(copied).values():
        assert getattr(cached, "__self__", copied) is not metric


SURFACES = AlignedSurfaces(TEMPLATE, equip=False).equip_with_metric(
    ElasticMetric, a=1.0, lam=1.0, c=0.0
)
METRIC = SURFACES.metric
CALLS = {
    "template": (TEMPLATE, lambda t: t.differential_operator @ t.vertices),
    "space": (SURFACES, lambda s: s.to_fields(POINTS[0])[0]),
    "basis": (BASIS, lambda b: b.project(POINTS[1] - POINTS[0])),
    "basis path": (BasisPath(BASIS, 4), lambda s: s.solve(METRIC, *POINTS[:2]).path),
    "linear path": (LinearPath(4), lambda s: s.solve(METRIC, *POINTS[:2]).path),
    "path straightening": (
        PathStraightening(4),
        lambda s: s.solve(METRIC, *POINTS[:2]).path,
    ),
    "basis mean": (BasisMean(BASIS), lambda s: s.solve(METRIC, POINTS).point),
    "exponential": (
        DiscreteExponential(BASIS, 3),
        lambda s: s.solve(METRIC, 0.1 * (POINTS[1] - POINTS[0]), POINTS[0]).path,
    ),
    "logarithm": (
        DiscreteLogarithm(BASIS, 3),
        lambda s: s.solve(METRIC, POINTS[1], POINTS[0]).tangent_vec,
    ),
    "ladder": (
        PoleLadder(2),
        lambda s: (
            s.solve(
                VectorSpace((2,)).metric, np.ones(2), np.zeros(2), end_point=np.arange(2.0)
            ).tangent_vec
        ),
    ),
    "mean": (
        rh.FrechetMean(VectorSpace((2,)), GradientDescentMean()),
        lambda e: e.fit(POINTS[:, 0, :2]).estimate_,
    ),
    "components": (
        rh.TangentPCA(SURFACES, 1),
        lambda e: e.fit(POINTS, base_point=POINTS[0]).components_,
    ),
    "neighbors": (
        rh.NearestNeighbors(METRIC, 2, n_pivots=2),
        lambda e: e.fit(POINTS).kneighbors()[0],
    ),
}


@pytest.mark.parametrize("name", CALLS)
@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
def test_other_objects_before_and_after_their_use(name):
    value, call = CALLS[name]
    before, number = twins(value), hash(value)
    expected = call(value)
    assert hash(value) == number
    for other in (before[0], *twins(value)[::2]):
        np.testing.assert_array_equal(call(other), expected)


@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
def test_results_and_fitted_estimators_travel():
    result = BasisPath(BASIS, 4).solve(METRIC, *POINTS[:2])
    for twin in twins(result):
        np.testing.assert_array_equal(twin.path, result.path)
        assert twin.message == result.message
    neighbors = rh.NearestNeighbors(METRIC, 2, n_pivots=2).fit(POINTS)
    for twin in twins(neighbors):
        np.testing.assert_array_equal(twin.kneighbors()[1], neighbors.kneighbors()[1])
