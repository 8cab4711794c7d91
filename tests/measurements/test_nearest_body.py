"""The nearest body with another waist: it has it, and no body near it is nearer."""

import numpy as np
import pytest

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, ConvergenceWarning
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, SobolevMetric
from riemhuman.measurements import Measurements, nearest_body


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse")


@pytest.fixture(scope="module")
def own(bodies):
    return Measurements(bodies.model, ["waist girth", "hip girth", "stature", "head girth"])


@pytest.fixture(scope="module", params=["first order", "second order"])
def metric(request, bodies):
    space = AlignedSurfaces(bodies.template)
    if request.param == "first order":
        return ElasticMetric(space, a=1.0, lam=1.0, c=1.0)
    return SobolevMetric(space, a0=1.0, a2=0.01)


def test_a_waist_of_five_centimetres_less(bodies, own, metric):
    body = bodies.points[0]
    waist = float(own.measure(body)["waist girth"]) - 0.05
    result = nearest_body(own, metric, body, {"waist girth": waist})
    assert result.converged
    assert abs(result.after["waist girth"] - waist) < 1e-4
    assert abs(result.changes["waist girth"] + 0.05) < 1e-4
    assert abs(result.changes["head girth"]) < 5e-4
    squared, _ = metric.energy_and_gradient(np.stack([body, result.point]))
    np.testing.assert_allclose(result.distance**2, squared, rtol=1e-9)
    # At the nearest body, the gradient of the squared distance is a multiple of the waist's, as
    # far as the hull of the waist has one.
    _, slopes = metric.energy_and_gradient(np.stack([body, result.point]))
    slope = slopes[1].ravel()
    waist_only = Measurements(own.definitions, ["waist girth"])
    gradient = waist_only.measure(result.point, gradient=True).gradient[0].ravel()
    multiplier = slope @ gradient / (gradient @ gradient)
    assert np.linalg.norm(slope - multiplier * gradient) < 0.2 * np.linalg.norm(slope)


def test_values_that_are_held_are_held(bodies, own, metric):
    body = bodies.points[0]
    now = own.measure(body)
    wanted = {"waist girth": now["waist girth"] - 0.03, "hip girth": now["hip girth"]}
    result = nearest_body(own, metric, body, wanted)
    assert abs(result.changes["hip girth"]) < 2e-4
    free = nearest_body(own, metric, body, {"waist girth": wanted["waist girth"]})
    assert free.distance < result.distance


def test_what_it_has_already_costs_nothing(bodies, own, metric):
    body = bodies.points[0]
    result = nearest_body(own, metric, body, {"stature": own.measure(body)["stature"]})
    assert result.distance < 1e-8
    np.testing.assert_allclose(result.point, body, atol=1e-8)


def test_what_is_refused(bodies, own, metric):
    body = bodies.points[0]
    with pytest.raises(ArgumentError, match="did you mean 'waist girth'"):
        nearest_body(own, metric, body, {"waist grith": 0.7})
    with pytest.raises(ArgumentError, match="must have a metric_matrix"):
        nearest_body(own, object(), body, {"waist girth": 0.7})
    with pytest.warns(ConvergenceWarning, match="not met: waist girth"):
        nearest_body(own, metric, body, {"waist girth": 0.4}, max_iter=1)
