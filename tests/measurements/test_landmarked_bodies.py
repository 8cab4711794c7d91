"""Surfaces with landmarks: where the lines of measurements lie, sizes, and written derivatives."""

import numpy as np
import pytest
from autograd.core import make_vjp

from riemhuman.datasets import load_open_bodies, load_open_model
from riemhuman.measurements import Measurements
from riemhuman.measurements._sections import section
from riemhuman.measurements.landmarked_bodies import LandmarkedBodies


@pytest.fixture(scope="module")
def bodies():
    return load_open_bodies("coarse")


@pytest.fixture(scope="module")
def measurements(bodies):
    return Measurements(bodies)


@pytest.mark.slow
def test_lines_of_the_coarse_model_lie_where_those_of_the_full_one_do(measurements):
    """Among adults, the planes of the coarse bodies' girths cut the full bodies alike.

    The rest of the difference is of the surfaces: a chord lies inside the arc that it replaces, so
    that the limbs of the coarse model are thinner.
    """
    betas = np.random.default_rng(0).normal(size=(2, 32))
    pose = measurements.definitions.standard_pose_vector
    full, coarse = (load_open_model(resolution) for resolution in ("full", "coarse"))
    fine = Measurements(full)
    surfaces, simpler = full(betas, pose), coarse(betas, pose)
    truth, values = (
        fine.measure(surfaces, axes="space"),
        measurements.measure(simpler, axes="space"),
    )
    gaps = (values.values - truth.values)[:, [unit == "m" for unit in measurements.units]]
    assert np.median(np.abs(gaps)) < 0.005
    assert gaps.max() < 0.03
    assert gaps.min() > -0.045
    bodies = LandmarkedBodies(measurements.definitions, simpler, "space")
    bodies_in_full = LandmarkedBodies(fine.definitions, surfaces, "space")
    for name in ("forearm girth", "mid-thigh girth", "chest girth", "calf girth"):
        number = measurements.names.index(name)
        girth, simple = (
            own_set.definitions.measurements[number] for own_set in (fine, measurements)
        )
        cutter = bodies_in_full.cutter(girth.parts, girth.leave_out)
        normals = bodies.axis(simple.normal)
        moved = section(surfaces, bodies.place(simple.at), normals, cutter).hulls(normals).lengths
        np.testing.assert_allclose(moved, truth[name], atol=0.006, err_msg=name)


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
