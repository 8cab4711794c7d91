"""Plane sections against cylinders, ellipsoids and tori, whose sections are known."""

import numpy as np
import pytest
from known_surfaces import ellipsoid, set_at, torus, tube
from scipy.special import ellipe

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.measurements import Breadth, Depth, Girth, Measurements, MeasurementSet, Volume


def _ellipse(a, b):
    """Return the circumference of an ellipse with these half axes."""
    a, b = max(a, b), min(a, b)
    return 4 * a * ellipe(1 - (b / a) ** 2)


def _value(template, measurement, **places):
    return Measurements(set_at(template, [measurement], **places)).measure(template.vertices).values


def _tube_value(n, measurement):
    template = tube(n, n)
    # The normal of an oblique plane runs from the left of the tube to a place higher on its right.
    return _value(
        template, measurement, here=[0, 0.4, 0.15], end=[0.15, 0.6, 0], on=[-0.15, 0.2, 0]
    )


CASES = {
    "tube": (_tube_value, Girth(name="g", at="here"), 2 * np.pi * 0.15),
    "oblique tube": (
        _tube_value,
        Girth(name="g", at="here", normal=("on", "end")),
        _ellipse(0.15, 0.15 * np.hypot(0.3, 0.4) / 0.4),
    ),
    "ellipsoid": (
        lambda n, m: _value(ellipsoid(n // 2), m, here=[0, 0.25, 0.12 * np.sqrt(0.75)]),
        Girth(name="g", at="here"),
        np.sqrt(0.75) * _ellipse(0.2, 0.12),
    ),
    "around the tube of a torus": (
        lambda n, m: _value(torus(n, 3 * n)[0], m, here=[0.0, 0.12, 0.4]),
        Girth(name="g", at="here", normal="left"),
        2 * np.pi * 0.12,
    ),
    "breadth of an ellipsoid": (
        lambda n, m: _value(ellipsoid(n // 2), m, here=[0, 0, 0.12]),
        Breadth(name="b", at="here"),
        0.4,
    ),
    "depth of an ellipsoid": (
        lambda n, m: _value(ellipsoid(n // 2), m, here=[0.2, 0, 0]),
        Depth(name="d", at="here"),
        0.24,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_known_sections_to_second_order(name):
    measure, measurement, truth = CASES[name]
    errors = [abs(float(measure(n, measurement)[0]) / truth - 1) for n in (24, 48, 96)]
    assert errors[-1] < 1e-3
    # Where vertices lie on the truth itself, there is no order to be seen.
    if errors[-1] > 1e-8:
        assert errors[0] / errors[-1] > 10


def test_hull_of_a_torus_spans_its_hole():
    template = torus(48, 96)[0]
    level = {"at": "here", "normal": "up"}
    loop = _value(template, Girth(name="g", **level), here=[0.52, 0.001, 0])
    hull = _value(template, Girth(name="g", hull=True, **level), here=[0.28, 0.001, 0])
    inner = _value(template, Girth(name="g", **level), here=[0.28, 0.001, 0])
    np.testing.assert_allclose(loop, 2 * np.pi * 0.52, rtol=1e-3)
    # The loop through the landmark alone is spanned: of two, the inner one.
    np.testing.assert_allclose([hull, inner], 2 * np.pi * 0.28, rtol=1e-3)


@pytest.mark.parametrize("hull", [False, True])
@pytest.mark.parametrize("normal", ["up", ("here", "there")])
def test_taylor_slopes(hull, normal):
    rng = np.random.default_rng(5)
    template = torus(20, 40)[0]
    girth = Girth(name="g", at="here", normal=normal, hull=hull)
    measurements = Measurements(
        set_at(
            template,
            [girth, Depth(name="d", at="here", normal=normal)],
            here=[0.51, 0.02, 0.05],
            there=[0.1, 0.12, 0.4],
        )
    )
    points = template.vertices + 1e-3 * rng.normal(size=template.vertices.shape)
    measured = measurements.measure(points, gradient=True)
    direction = rng.normal(size=points.shape)
    slope = np.sum(measured.gradient * direction, axis=(-2, -1))
    steps = np.array([1e-5, 1e-6])
    moved = measurements.measure(points + steps[:, None, None] * direction).values
    misses = np.abs(moved - measured.values - steps[:, None] * slope)
    # What a first-order expansion misses falls with the square of the step: a hundredfold.
    assert (misses[1] < 0.02 * misses[0] + 1e-14).all()
    assert (misses[0] < 1e-2 * np.abs(steps[0] * slope) + 1e-8).all()


def test_a_plane_that_misses():
    template = tube(12, 5)
    girth = Girth(name="g", at="off", parts=["lower end"])
    landmarks = {"off": (np.array([0, 48]), np.array([0.1, 0.9]))}
    measurements = Measurements(
        MeasurementSet(template, [girth], landmarks, {"lower end": np.arange(6)})
    )
    with pytest.raises(ArgumentError, match="'g' cannot be taken of body 0: its plane misses"):
        measurements.measure(template.vertices)
    measured = measurements.measure(template.vertices, missing="nan")
    assert np.isnan(measured.values).all()
    assert measured.why_missing == {(0, "g"): "its plane misses lower end"}


def test_a_loop_that_meets_another_part():
    template = tube(12, 5)
    half = np.flatnonzero(template.vertices[template.faces].mean(axis=1)[:, 0] > 0)
    girth = Girth(name="g", at="here", parts=["left"])
    landmarks = {"here": (template.faces[half[4]], np.array([0.3, 0.3, 0.4]))}
    measurements = MeasurementSet(template, [girth], landmarks, {"left": half})
    with pytest.raises(ArgumentError, match="leaves left and meets another part"):
        Measurements(measurements).measure(template.vertices)


def test_parts_left_out_are_cut_away():
    template = tube(48, 5)
    left = template.vertices[template.faces].mean(axis=1)[:, 0] > 0
    parts = {"left": np.flatnonzero(left), "right": np.flatnonzero(~left)}
    girth = Girth(name="g", at="here", parts=["left"], leave_out=["right"], hull=True)
    face = parts["left"][10]
    landmarks = {"here": (template.faces[face], np.array([0.3, 0.3, 0.4]))}
    measurements = MeasurementSet(template, [girth], landmarks, parts)
    value = Measurements(measurements).measure(template.vertices).values
    # Half a circle and its diameter.
    np.testing.assert_allclose(value, 0.15 * (np.pi + 2), rtol=2e-3)


def test_open_surfaces():
    template = tube(12, 5)
    along = Girth(name="along", at="here", normal="forward")
    measurements = set_at(template, [along], here=[0.15, 0.41, 0.001])
    with pytest.raises(ArgumentError, match="'along' .* meets a boundary"):
        Measurements(measurements).measure(template.vertices)
    with pytest.raises(DegenerateSurfaceError, match="'v' needs a closed surface"):
        Measurements(measurements.with_measurements([Volume(name="v")])).measure(template.vertices)
