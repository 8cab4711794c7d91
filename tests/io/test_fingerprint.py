"""Descriptions by which jobs recognise their inputs."""

import json
from functools import partial

import numpy as np
from cases import sphere_template

import riemhuman as rh
from riemhuman.io.fingerprint import describe, digest
from riemhuman.solvers import LinearPath


def test_order_in_memory_and_of_sets_does_not_matter():
    array = np.arange(6.0).reshape(2, 3)
    assert digest(array) == digest(np.asfortranarray(array)) == digest(array[:, ::-1][:, ::-1])
    assert describe(array) != describe(array.astype(np.float32))
    assert describe(array) != describe(array.reshape(3, 2))
    words = ["a", "bc", "d", "ef"]
    assert describe({*words}) == describe({*reversed(words)}) != describe({*words, "g"})


def test_descriptions_are_kept_as_json():
    """Also of what is not finite, of functions and their arguments, and of what holds itself."""
    circle = {"nan": np.nan, "function": partial(np.clip, a_min=0.0), "class": np.ndarray}
    circle["itself"] = [circle]
    described = describe(circle)
    assert json.loads(json.dumps(described)) == described
    assert described["function"] != describe(partial(np.clip, a_min=1.0))


def test_solvers_matter_to_metrics_without_closed_forms_alone():
    space = rh.AlignedSurfaces(sphere_template(), equip=False)

    def descriptions(make):
        return [describe(make(solver)) for solver in (LinearPath(3), LinearPath(5))]

    first, second = descriptions(
        lambda s: rh.ElasticMetric(space, 1.0, 1.0, 1.0, geodesic_solver=s)
    )
    assert first == second
    first, second = descriptions(lambda s: rh.SobolevMetric(space, geodesic_solver=s))
    assert first != second
    text = repr(rh.SobolevMetric(space, geodesic_solver=LinearPath(3)))
    assert "geodesic_solver=LinearPath(n_nodes=3)" in text
