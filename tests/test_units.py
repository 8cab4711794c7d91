"""Units of length: recognised from sizes, and surfaces of different ones told apart."""

import numpy as np
import pytest

import riemhuman as rh
from riemhuman.checks import UNITS, check_same_scale, likely_units
from riemhuman.errors import ArgumentError, FileFormatError


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


@pytest.fixture(scope="module")
def bodies():
    return rh.datasets.load_open_bodies("coarse")


def test_bodies_of_one_unit_pass(bodies):
    check_same_scale(bodies.points, bodies.template.vertices, "points", "template")
    for factor in (0.3, 1.9):  # a child, and a giant with raised arms
        check_same_scale(factor * bodies[0], bodies.template.vertices, "points", "template")
    check_same_scale(0.0 * bodies[0], bodies.template.vertices, "points", "template")


@pytest.mark.parametrize("unit", [unit for unit in UNITS if unit != "metres"])
@pytest.mark.parametrize("person", range(0, 100, 10))
def test_other_units_are_named(unit, person, bodies):
    points = UNITS[unit] * bodies.points[person : person + 10]
    reference = bodies.points[55]
    with pytest.raises(ArgumentError, match=rf"f\[0\] is .* large as T, as if one were in {unit}"):
        check_same_scale(points, reference, "f", "T")
    with pytest.raises(ArgumentError, match="as small as T, as if one were in metres"):
        check_same_scale(reference, points[0], "f", "T")


def test_sizes_of_no_unit_are_refused_without_one():
    surface = np.random.default_rng(0).normal(size=(30, 3))
    with pytest.raises(FileFormatError, match="f is 300 times as large as T; bring both"):
        check_same_scale(300 * surface, surface, "f", "T", error=FileFormatError)


def meetings(bodies, space, far):
    """Return all ways by which a body meets others, in which `far` is in another unit."""
    one, other = bodies[:2]
    metric, solvers = space.metric, rh.solvers
    pose = rh.ElasticMetric(space, 0.0, 0.0, 1.0)
    basis = rh.DeformationBasis.from_laplacian(space.template, n_components=4)
    several = np.stack([one, other, far])
    return {
        "dist": lambda: metric.dist(one, far),
        "dist_pairwise": lambda: metric.dist_pairwise(several),
        "cdist": lambda: metric.cdist(several[:2], several),
        "length": lambda: metric.length(np.stack([one, far])),
        "map": lambda: metric.map(far),
        "LinearPath": lambda: solvers.LinearPath().solve(metric, one, far),
        "BasisPath": lambda: solvers.BasisPath(basis, n_nodes=3).solve(metric, one, far),
        "Disentangling": lambda: solvers.Disentangling().solve(metric, pose, one, far),
        "ShapeTransfer": lambda: solvers.ShapeTransfer().solve(space, one, far, other),
        "MotionTransfer": lambda: solvers.MotionTransfer().solve(space, several[:2], far),
        "a motion": lambda: solvers.MotionTransfer().solve(space, several, one),
        "FrechetMean": lambda: rh.FrechetMean(space).fit(several),
        "GeometricMedian": lambda: rh.GeometricMedian(space).fit(several),
        "TangentPCA": lambda: rh.TangentPCA(space, 1).fit(several),
        "GeodesicRegression": lambda: rh.GeodesicRegression(space).fit(np.arange(3.0), several),
        "NearestNeighbors": lambda: rh.NearestNeighbors(metric).fit(several),
        "procrustes": lambda: rh.procrustes(far, to=one),
        "generalized_procrustes": lambda: rh.generalized_procrustes(several),
        "fit": lambda: bodies.model.fit(far),
        "from_motions": lambda: rh.DeformationBasis.from_motions(
            [several[:2], np.stack([far, far])], n_components=1, step=1
        ),
    }


@pytest.mark.parametrize("factor", [1000.0, 100.0, 39.37])
def test_units_are_told_apart_wherever_bodies_meet(factor, bodies):
    space = rh.AlignedSurfaces(bodies.template)
    ways = meetings(bodies, space, factor * bodies[2])
    for meet in ways.values():
        with pytest.raises(ArgumentError, match="times as large as .*as if one were in"):
            meet()


def test_children_are_no_other_unit(bodies):
    space = rh.AlignedSurfaces(bodies.template)
    ways = meetings(bodies, space, 0.5 * bodies[2])
    for name in ("dist", "length", "LinearPath", "ShapeTransfer", "procrustes", "from_motions"):
        ways[name]()


def test_other_objects_are_taken_as_they_are_once_that_is_said(bodies):
    space = rh.AlignedSurfaces(bodies.template, scale=None)
    ways = meetings(bodies, space, 100.0 * bodies[2])
    for name in ("dist", "dist_pairwise", "length", "map", "LinearPath", "MotionTransfer"):
        ways[name]()
    far = rh.procrustes(100.0 * bodies[2], to=bodies[0], scale=None)
    assert np.ptp(far[:, 1]) > 50
