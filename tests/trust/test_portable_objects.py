"""Public objects pickle and copy, and compute the same before and after every public call."""

import copy
import json
import pickle
from dataclasses import replace

import numpy as np
import pytest
from cases import KINDS, name_of

from riemhuman.io.fingerprint import describe


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
