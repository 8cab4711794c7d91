"""Surfaces with landmarks: where the lines of measurements lie, sizes, and written derivatives."""

import numpy as np
import pytest
from autograd.core import make_vjp

from riemhuman.measurements.landmarked_bodies import LandmarkedBodies


@pytest.mark.parametrize("axes", ["space", "body"])
def test_written_derivatives_are_those_of_autograd(bodies, measurements, axes, monkeypatch):
    """On a bent body, whose axes are not those of the template, and on another one beside it."""
    points = bodies.points[[3, 14]]
    traced = []
    for measurement in measurements.definitions.measurements:
        pull_back, value = make_vjp(
            lambda f, one=measurement: one.value(
                LandmarkedBodies(measurements.definitions, f, axes)
            ),
            points,
        )
        traced.append((value, pull_back(np.ones(2))))
    monkeypatch.setattr("riemhuman.measurements.definitions.make_vjp", None)
    written = measurements.measure(points, axes=axes, gradient=True)
    for number, (value, slopes) in enumerate(traced):
        name, scale = measurements.names[number], np.abs(slopes).max()
        np.testing.assert_allclose(written.values[:, number], value, rtol=1e-12, err_msg=name)
        np.testing.assert_allclose(
            written.gradient[:, number], slopes, rtol=0, atol=1e-11 * scale, err_msg=name
        )


def test_volume_and_area_are_those_of_the_surface(bodies, measurements):
    mesh = bodies.template.to_trimesh(bodies.points[0])
    measured = measurements.measure(bodies.points[0])
    np.testing.assert_allclose(measured["volume"], mesh.volume, rtol=1e-9)
    np.testing.assert_allclose(measured["surface area"], mesh.area, rtol=1e-9)
    np.testing.assert_allclose(measured["body mass"], 1000.0 * mesh.volume, rtol=1e-9)
