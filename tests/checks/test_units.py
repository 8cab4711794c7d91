"""Units of length: recognised from sizes, and surfaces of different ones told apart."""

import numpy as np
import pytest
from open_bodies import coarse_bodies

import riemhuman as rh
from riemhuman.checks import UNITS, check_same_scale, likely_units
from riemhuman.checks.sizes import longest_side
from riemhuman.errors import ArgumentError


@pytest.mark.parametrize(
    ("extent", "units"),
    [
        (1.8, ["metres"]),
        (0.5, ["metres"]),
        (180.0, ["centimetres"]),
        (70.9, ["centimetres", "inches"]),
        (1800.0, ["millimetres"]),
        (0.02, []),
        (1e6, []),
    ],
)
def test_units_of_bodies(extent, units):
    assert likely_units(extent) == units


def test_bodies_of_one_unit_pass(bodies):
    check_same_scale(bodies.points, longest_side(bodies.template.vertices), "points", "template")
    for factor in (0.3, 1.9):  # a child, and a giant with raised arms
        check_same_scale(
            factor * bodies[0], longest_side(bodies.template.vertices), "points", "template"
        )
    check_same_scale(0.0 * bodies[0], longest_side(bodies.template.vertices), "points", "template")


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "metres"])
def test_other_units_are_named(unit, bodies):
    points = UNITS[unit] * bodies.points[::10]
    reference = bodies.points[55]
    with pytest.raises(ArgumentError, match=rf"f\[0\] is .* large as T, as if one were in {unit}"):
        check_same_scale(points, longest_side(reference), "f", "T")
    with pytest.raises(ArgumentError, match="as small as T, as if one were in metres"):
        check_same_scale(reference, longest_side(points[0]), "f", "T")


def meetings(bodies, space, far):
    """Return all ways by which a body meets others, in which `far` is in another unit."""
    one, other = bodies[:2]
    metric, solvers = space.metric, rh.solvers
    basis = rh.DeformationBasis.from_laplacian(space.template, n_components=4)
    several = np.stack([one, other, far])
    return {
        "dist": lambda: metric.dist(one, far),
        "dist_pairwise": lambda: metric.dist_pairwise(several),
        "LinearPath": lambda: solvers.LinearPath().solve(metric, one, far),
        "BasisPath": lambda: solvers.BasisPath(basis, n_nodes=3).solve(metric, one, far),
        "ShapeTransfer": lambda: solvers.ShapeTransfer().solve(space, one, far, other),
        "MotionTransfer": lambda: solvers.MotionTransfer().solve(space, several[:2], far),
        "FrechetMean": lambda: rh.FrechetMean(space).fit(several),
        "TangentPCA": lambda: rh.TangentPCA(space, 1).fit(several),
        "NearestNeighbors": lambda: rh.NearestNeighbors(metric).fit(several),
        "procrustes": lambda: rh.procrustes(far, to=one),
        "generalized_procrustes": lambda: rh.generalized_procrustes(several),
        "fit": lambda: bodies.model.fit(far),
        "from_motions": lambda: rh.DeformationBasis.from_motions(
            [several[:2], np.stack([far, far])], n_components=1, step=1
        ),
    }


def test_units_are_told_apart_wherever_bodies_meet(bodies):
    space = rh.AlignedSurfaces(bodies.template)
    ways = meetings(bodies, space, 39.37 * bodies[2])
    for meet in ways.values():
        with pytest.raises(ArgumentError, match="times as large as .*as if one were in"):
            meet()


# Sizes that no human body has.


def sized(bodies, factor):
    return factor * bodies.points[20]


DOORS = {
    "measure": lambda b, f: rh.measurements.Measurements(b.model).measure(f),
    "a stack": lambda b, f: rh.measurements.Measurements(b.model).measure(f[None], missing="nan"),
    "lines": lambda b, f: rh.measurements.Measurements(b.model).lines(f),
    "standard pose": lambda b, f: rh.measurements.in_standard_pose(
        rh.measurements.open_measurements("coarse"), f
    ),
    "fit": lambda b, f: b.model.fit(f),
}


@pytest.mark.parametrize("door", DOORS)
@pytest.mark.parametrize(
    ("factor", "message"),
    [
        (
            3.2808,
            r"5\.\d+ m long and encloses \d+ litres, .* but a body in feet would be; .*in metres",
        ),
        (
            0.3,
            r"0\.\d+ m long and encloses 1\.\d+ litres, which no human body is; .* 2 to 650 litres",
        ),
    ],
)
def test_sizes_that_no_human_has_are_refused(door, factor, message, bodies):
    with pytest.raises(ArgumentError, match=rf"(points|surface).* is .*{message}"):
        DOORS[door](bodies, sized(bodies, factor))


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "metres"])
def test_the_unit_of_an_impossible_body_is_suspected(unit, bodies):
    measurements = rh.measurements.Measurements(bodies.model)
    for number in (0, 55):
        with pytest.raises(ArgumentError, match=f"but a body in .*{unit}"):
            measurements.measure(UNITS[unit] * bodies.points[number])


def test_children_and_giants_are_measured(bodies):
    measurements = rh.measurements.Measurements(bodies.model, ["stature", "volume"])
    for factor in (0.35, 0.6, 1.6):  # newborn to the tallest of men
        for number in (7, 35, 91):
            values = measurements.measure(factor * bodies.points[number]).values
            assert np.isfinite(values).all()


def test_what_is_no_body_has_any_size():
    """A template that is no body in metres, such as a hand, does not say how large others are."""
    bodies = coarse_bodies()
    template = rh.Template(0.1 * bodies.template.vertices, bodies.template.faces)
    girth = rh.measurements.Volume(name="all")
    measurements = rh.measurements.MeasurementSet(template, [girth], {})
    measured = rh.measurements.Measurements(measurements).measure(0.05 * bodies[0])
    assert 0 < measured["all"] < 1e-4


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"stature": 5.74}, "stature must be in m.* found 5.74, which nobody has: is it in feet"),
        ({"stature": 174}, "is it in centimetres"),
        ({"stature": 2.9}, "stature .* is it in feet"),
        ({"stature": 0.3}, "stature .* nobody has$"),
        ({"waist girth": 2.8}, "waist girth must be in m.* is it in feet"),
        ({"hip girth": 1020}, "is it in millimetres"),
        ({"body mass": 2268.5}, "body mass must be in kg.* nobody has$"),
        ({"body mass": 1.7}, "body mass must be in kg"),
        ({"body mass": 600, "stature": 1.7}, "between 17.3 and 592 kg with a stature of 1.7 m"),
        ({"volume": 0.01, "stature": 1.7}, "between 0.0173 and 0.592 m³"),
        ({"hip height": 1.5, "stature": 1.4}, "hip height must be smaller than the stature"),
    ],
)
def test_values_that_nobody_has_are_refused_wherever_values_are_taken(values, message):
    bodies = rh.datasets.load_open_bodies("coarse", people=1)
    measurements = rh.measurements.Measurements(bodies.model)
    metric = rh.ElasticMetric(rh.AlignedSurfaces(bodies.template), 1.0, 1.0, 0.1)
    calls = (
        lambda: rh.measurements.model_from_measurements(values, resolution="coarse"),
        lambda: rh.measurements.predict_measurements(values),
        lambda: rh.measurements.percentiles({"stature": 1.6, **values}),
        lambda: rh.measurements.nearest_body(measurements, metric, bodies[0], values),
    )
    for call in calls:
        with pytest.raises(ArgumentError, match=message):
            call()
