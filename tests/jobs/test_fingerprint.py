"""Descriptions of metrics: the same for the same metric, another for any other."""

import json

import numpy as np
import pytest
from cases import CASES, HalfPlane, bent_half_plane, name_of

from riemhuman.errors import ArgumentTypeError
from riemhuman.geometry.pullback import PullbackMetric
from riemhuman.jobs.fingerprint import describe, digest

DESCRIPTIONS = {name: json.dumps(describe(case.metric)) for name, case in CASES.items()}


def test_every_metric_has_a_description_of_its_own():
    assert len(set(DESCRIPTIONS.values())) == len(DESCRIPTIONS)


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_descriptions_outlive_json(case):
    description = describe(case.metric)
    assert json.loads(json.dumps(description)) == description


def test_same_metric_made_twice():
    assert describe(bent_half_plane(HalfPlane())) == describe(bent_half_plane(HalfPlane()))


def test_maps_are_told_apart_by_what_they_do():
    def scaled(factor):
        return lambda x: factor * x

    maps = [scaled(1.0), scaled(2.0), lambda x: 3.0 * x, lambda x: 4.0 * x, np.negative]
    target = CASES["half-plane, distance"].metric
    found = [describe(PullbackMetric(HalfPlane(), target, map)) for map in maps]
    assert all(a != b for i, a in enumerate(found) for b in found[:i])
    again = PullbackMetric(HalfPlane(), target, scaled(2.0))
    assert describe(again) == found[1]


def test_a_solver_is_no_part_of_a_metric():
    metric = CASES["pose sphere"].metric
    with_solver = type(metric)(metric.space, 0.0, 0.0, 1.0, geodesic_solver=object())
    assert describe(with_solver) == describe(metric)


class Forgetful:
    """An object that does not keep its parameter."""

    def __init__(self, scale):
        self.size = scale


def test_parameters_must_be_kept():
    with pytest.raises(ArgumentTypeError, match="Forgetful must keep its parameter scale"):
        describe(Forgetful(2.0))
    with pytest.raises(ArgumentTypeError, match="cannot tell from others"):
        describe([{"scale": 2.0}])


def test_digest_is_of_values_not_of_their_order_in_memory():
    array = np.arange(6.0).reshape(2, 3)
    assert digest(array) == digest(np.asfortranarray(array))
    assert digest(array) != digest(array + 1e-15)
    assert len(digest(array)) == 32
