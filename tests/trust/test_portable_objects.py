"""Public objects pickle and copy, and compute the same before and after every public call."""

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from cases import KINDS, name_of, sphere_template, surfaces
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman import solvers
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, VectorSpace
from riemhuman.io.fingerprint import describe

TEMPLATE = sphere_template()
POINTS = surfaces(TEMPLATE, 4, rng=1, size=0.05)
BASIS = rh.DeformationBasis.from_laplacian(TEMPLATE, 6)
SURFACES = AlignedSurfaces(TEMPLATE, equip=False).equip_with_metric(
    ElasticMetric, a=1.0, lam=1.0, c=0.0
)
METRIC = SURFACES.metric
PLANE, IN_PLANE = VectorSpace((2,)), POINTS[:, 0, :2]
BODIES = coarse_bodies()


def copies(value):
    """Return a value as it comes out of a pickle, and its copies."""
    return pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value)


def use(case):
    """Call the methods of a metric, and return their results."""
    metric, points, vectors = case.metric, case.points, case.tangent_vecs
    results = [metric.inner_product(vectors[0], vectors[1], points[0])]
    results += [metric.norm(vectors[0], points[0]), metric.energy(points[:3])]
    results.append(metric.energy_and_gradient(points[:3])[1])
    if "dist" in case.can:
        results += [metric.dist(points[0], points[1]), metric.dist_pairwise(points)]
    if "geodesic" in case.can:
        results.append(metric.geodesic(points[0], points[1])(0.3))
    if "log" in case.can:
        results.append(metric.log(points[1], points[0]))
    return [np.asarray(result) for result in results]


@pytest.mark.parametrize("case", KINDS, ids=name_of)
def test_metrics(case):
    described, number = json.dumps(describe(case.metric)), hash(case.metric)
    unused = pickle.loads(pickle.dumps(case.metric))
    expected = use(case)
    assert (json.dumps(describe(case.metric)), hash(case.metric)) == (described, number)
    pickled, copied, deep = copies(case.metric)
    for metric in (pickled, copied, deep):
        assert json.dumps(describe(metric)) == described
    for metric in (unused, pickled, deep):
        for result, wanted in zip(use(replace(case, metric=metric)), expected, strict=True):
            np.testing.assert_array_equal(result, wanted)


OBJECTS = {
    "template": (lambda: TEMPLATE, lambda t: t.differential_operator @ t.vertices),
    "space": (lambda: SURFACES, lambda s: s.to_fields(POINTS[0])[0]),
    "basis": (lambda: BASIS, lambda b: b.project(POINTS[1] - POINTS[0])),
    "basis path": (
        lambda: solvers.BasisPath(BASIS, 4),
        lambda s: s.solve(METRIC, *POINTS[:2]).path,
    ),
    "linear path": (lambda: solvers.LinearPath(4), lambda s: s.solve(METRIC, *POINTS[:2]).path),
    "neighbors": (
        lambda: rh.NearestNeighbors(METRIC, 2, algorithm="index").fit(POINTS),
        lambda e: e.kneighbors(POINTS[:2])[0],
    ),
    "body model": (lambda: BODIES.model, lambda m: m(pose=np.full((m.n_joints, 3), 0.1))),
}


@pytest.mark.parametrize("name", OBJECTS)
@pytest.mark.filterwarnings("ignore::riemhuman.errors.ConvergenceWarning")
def test_other_objects(name):
    make, call = OBJECTS[name]
    value = make()
    unused, expected = copies(value), call(value)
    for twin in (*unused, *copies(value)):
        assert type(twin) is type(value)
        np.testing.assert_array_equal(call(twin), expected)
