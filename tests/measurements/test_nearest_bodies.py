"""The nearest body with given measurements has them, and is the nearest."""

import numpy as np
import pytest
from open_bodies import coarse_bodies

from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SobolevMetric
from riemhuman.measurements import Measurements, nearest_body


@pytest.fixture(scope="module")
def body():
    return coarse_bodies().points[0]


@pytest.fixture(scope="module")
def few():
    measurements = Measurements(load_open_model("coarse"))
    names = ["waist girth", "hip girth", "stature", "head girth"]
    return Measurements(measurements.definitions, names)


@pytest.fixture(scope="module")
def metric():
    space = AlignedSurfaces(load_open_model("coarse").template)
    return SobolevMetric(space, a0=1.0, a2=0.01)


@pytest.fixture(scope="module")
def waist(body, few):
    """Return a waist that is five centimetres less than that of the body."""
    return float(few.measure(body)["waist girth"]) - 0.05


@pytest.fixture(scope="module")
def narrower(body, few, metric, waist):
    return nearest_body(few, metric, body, {"waist girth": waist})


@pytest.mark.parametrize("order", ["first", "second"])
def test_a_waist_of_five_centimetres_less(body, few, metric, waist, narrower, order):
    result = narrower
    if order == "first":
        metric = ElasticMetric(metric.space, a=1.0, lam=1.0, c=1.0)
        result = nearest_body(few, metric, body, {"waist girth": waist})
    assert result.converged
    assert abs(result.after["waist girth"] - waist) < 1e-4
    assert abs(result.changes["waist girth"] + 0.05) < 1e-4
    assert abs(result.changes["head girth"]) < 5e-4
    squared, slopes = metric.energy_and_gradient(np.stack([body, result.point]))
    np.testing.assert_allclose(result.distance**2, squared, rtol=1e-9)
    # At the nearest body, the gradient of the squared distance is a multiple of the waist's, as
    # far as the hull of the waist has one.
    slope = slopes[1].ravel()
    waist_only = Measurements(few.definitions, ["waist girth"])
    gradient = waist_only.measure(result.point, gradient=True).gradient[0].ravel()
    multiplier = slope @ gradient / (gradient @ gradient)
    assert np.linalg.norm(slope - multiplier * gradient) < 0.2 * np.linalg.norm(slope)


def test_the_message_says_how_a_search_ended(body, few, metric, waist, narrower):
    result, wanted = narrower, {"waist girth": waist}
    assert result.message == "the last step was smaller than the tolerance; the values are reached"
    # The last step that is allowed may be the one with which the search ends.
    again = nearest_body(few, metric, body, wanted, max_iter=result.n_iterations)
    assert again.converged
    assert again.message == result.message
    few_steps = result.n_iterations - 1
    with pytest.warns(ConvergenceWarning, match="stopped after the largest number of steps"):
        nearest_body(few, metric, body, wanted, max_iter=few_steps)


def test_requested_values_are_met_and_cost(body, few, metric, waist, narrower):
    now = few.measure(body)
    result = nearest_body(few, metric, body, {"waist girth": waist, "hip girth": now["hip girth"]})
    assert abs(result.changes["hip girth"]) < 2e-4
    assert narrower.distance < result.distance
    same = nearest_body(few, metric, body, {"stature": now["stature"]})
    assert same.distance < 1e-8
    np.testing.assert_allclose(same.point, body, atol=1e-8)


def test_wrong_arguments_and_too_few_steps(body, few, metric):
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        nearest_body(few, metric, body, {"waist grith": 0.7})
    with pytest.warns(ConvergenceWarning, match="not reached: waist girth"):
        nearest_body(few, metric, body, {"waist girth": 0.4}, max_iter=1)
    # On its way no step may lead to what is no body.
    with pytest.warns(ConvergenceWarning, match="not reached: stature"):
        nearest_body(few, metric, body, {"stature": 0.55}, max_iter=3)
