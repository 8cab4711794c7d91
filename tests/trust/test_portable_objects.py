"""Public objects pickle, copy and compare the same before and after every public call."""

import copy
import json
import pickle

import numpy as np
import pytest
from cases import CASES, name_of, sphere_template, surfaces

import riemhuman as rh
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, VectorSpace
from riemhuman.io.fingerprint import describe
from riemhuman.kernels.surface import derivatives
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


@pytest.mark.sampled(4)
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
                VectorSpace((2,)).metric,
                np.ones(2),
                np.zeros(2),
                end_point=np.arange(2.0),
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


BODIES = rh.datasets.load_open_bodies("coarse")
MODEL = BODIES.model
MOTION = next(iter(rh.datasets.load_open_motions("coarse")))


def distances_by(term):
    """Return squared distances of the points' fields, by a term."""
    fields = term.fields(derivatives(POINTS, TEMPLATE.differential_operator))
    return term.squared_dist([f[:2] for f in fields], [f[2:] for f in fields])


USED = {
    "body model": (lambda: MODEL, lambda m: m(pose=np.full((m.n_joints, 3), 0.1))),
    "model fit": (lambda: MODEL.fit(BODIES[0]), lambda f: f.pose),
    "bodies": (lambda: BODIES, lambda b: b.points[:2]),
    "some bodies": (lambda: BODIES[:3], lambda b: b.points),
    "motion": (lambda: MOTION, lambda m: m[0]),
    "shape dna": (
        lambda: rh.descriptors.ShapeDNA(n_eigenvalues=4),
        lambda d: d.describe(TEMPLATE.vertices, TEMPLATE.faces),
    ),
    "heat kernel": (
        lambda: rh.descriptors.HeatKernelSignature(n_eigenvalues=20),
        lambda d: d.describe(TEMPLATE.vertices, TEMPLATE.faces),
    ),
    "wave kernel": (
        lambda: rh.descriptors.WaveKernelSignature(n_eigenvalues=20),
        lambda d: d.describe(TEMPLATE.vertices, TEMPLATE.faces),
    ),
    "projected areas": (
        lambda: rh.descriptors.AreaProjectionTransform(voxel_size=0.1),
        lambda d: d.describe(TEMPLATE.vertices, TEMPLATE.faces),
    ),
    "ebin term": (lambda: rh.terms.EbinTerm(1.0, lam=0.5), distances_by),
    "normal term": (lambda: rh.terms.NormalTerm(0.1), distances_by),
    "root normal term": (lambda: rh.terms.RootNormalTerm(0.1), distances_by),
    "neighbors": (
        lambda: rh.NearestNeighbors(METRIC, 2, n_pivots=2).fit(POINTS),
        lambda e: e.kneighbors(POINTS[:2])[0],
    ),
    "components": (
        lambda: rh.TangentPCA(SURFACES, 1).fit(POINTS, base_point=POINTS[0]),
        lambda e: e.transform(POINTS),
    ),
    "mean": (
        lambda: rh.FrechetMean(VectorSpace((2,))).fit(POINTS[:, 0, :2]),
        lambda e: e.estimate_,
    ),
    "median": (
        lambda: rh.GeometricMedian(VectorSpace((2,))).fit(POINTS[:, 0, :2]),
        lambda e: e.estimate_,
    ),
    "regression": (
        lambda: rh.GeodesicRegression(VectorSpace((2,))).fit(np.arange(4.0), POINTS[:, 0, :2]),
        lambda e: e.predict(np.arange(2.0)),
    ),
}


@pytest.mark.parametrize("name", USED)
def test_what_was_made_and_used_travels(name):
    make, call = USED[name]
    value = make()
    unused, expected = twins(value), call(value)
    for other in (*unused, *twins(value)):
        assert type(other) is type(value)
        np.testing.assert_array_equal(call(other), expected)
