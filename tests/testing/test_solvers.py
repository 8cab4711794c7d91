"""Checks of solvers: those of the library pass, and broken twins do not."""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from cases import CASES

from riemhuman.errors import ArgumentError, ArgumentTypeError
from riemhuman.geometry import VectorSpace
from riemhuman.geometry.strategies import (
    ExpSolver,
    GeodesicSolver,
    LogSolver,
    MeanSolver,
    TransportSolver,
)
from riemhuman.solvers import (
    ClosedFormGeodesic,
    DiscreteExponential,
    DiscreteLogarithm,
    GradientDescentMean,
    LinearPath,
    PathStraightening,
    PoleLadder,
)
from riemhuman.testing import check_solver

EBIN, NORMALS = CASES["ebin 1 sphere"], CASES["normals triangle"]
SURFACES = CASES["mixed triangle"]
GOOD = {
    "linear": (LinearPath(5), SURFACES),
    "linear of two nodes": (LinearPath(2), SURFACES),
    "linear on spheres": (LinearPath(5), NORMALS),
    "closed form": (ClosedFormGeodesic(5), EBIN),
    "straightening": (PathStraightening(5, tolerance=1e-9), SURFACES),
    "exponential": (DiscreteExponential(n_steps=4), SURFACES),
    "logarithm": (DiscreteLogarithm(n_steps=4), SURFACES),
    "pole ladder": (PoleLadder(), EBIN),
    "pole ladder of segments": (PoleLadder(geodesic_solver=LinearPath(4)), SURFACES),
    "mean": (GradientDescentMean(tolerance=1e-10), NORMALS),
}


@pytest.mark.parametrize(("solver", "case"), GOOD.values(), ids=GOOD)
def test_solvers_of_the_library_pass(solver, case):
    report = check_solver(solver, case.metric, case.points)
    assert report.passed, report
    assert report.name == type(solver).__name__


PLANE = VectorSpace((2,))
POINTS = PLANE.random_point(4, rng=1)


@dataclass
class Geodesic:
    """Straight lines in the plane, with one thing wrong."""

    broken: str = ""
    calls: int = 0

    def solve(self, metric, start, end):
        self.calls += 1
        path = np.linspace(start, end, 5)
        if self.broken == "shape":
            path = path[..., None]
        elif self.broken == "one node":
            path = path[:1]
        elif self.broken == "ends":
            path = path[:-1]
        elif self.broken == "outside":
            path[2] = np.nan
        elif self.broken == "restless":
            path[2] += 1.0
        elif self.broken == "random":
            path[2] += 1e-3 * self.calls
        elif self.broken == "greedy":
            start += 1.0
        energy = (
            1.0 if self.broken in ("shape", "one node", "outside") else float(metric.energy(path))
        )
        if self.broken == "energy":
            energy *= 2.0
        return SimpleNamespace(path=path, energy=energy)


@dataclass
class Exp:
    """Addition, with one thing wrong."""

    broken: str = ""

    def solve(self, metric, tangent_vec, base_point):
        if self.broken == "greedy":
            tangent_vec *= 2.0
        if self.broken == "swapped":
            return SimpleNamespace(end=base_point)
        return SimpleNamespace(end=base_point + tangent_vec + (self.broken == "adrift"))


@dataclass
class Log:
    """Subtraction, with one thing wrong."""

    broken: str = ""

    def solve(self, metric, point, base_point):
        if self.broken == "greedy":
            point += 1.0
        if self.broken == "swapped":
            return SimpleNamespace(tangent_vec=base_point - point)
        return SimpleNamespace(tangent_vec=point - base_point + (self.broken == "adrift"))


@dataclass
class Transport:
    """Nothing to do in the plane, with one thing wrong."""

    broken: str = ""

    def solve(self, metric, tangent_vec, base_point, direction=None, end_point=None):
        if self.broken == "greedy":
            tangent_vec += 1.0
        carried: Any = tangent_vec
        if self.broken == "turning":
            carried = -tangent_vec
        elif self.broken == "bent" and np.any(end_point != base_point):
            carried = tangent_vec**3
        elif self.broken == "adrift" and np.any(end_point != base_point):
            carried = tangent_vec + 1.0
        return SimpleNamespace(tangent_vec=carried)


@dataclass
class Mean:
    """The arithmetic mean, with one thing wrong."""

    broken: str = ""

    def solve(self, metric, points, weights=None, initial_point=None):
        if self.broken == "greedy":
            points += 1.0
        used = None if self.broken == "unweighted" else weights
        point = np.average(points, axis=0, weights=used) + 9.0 * (self.broken == "far")
        squares = metric.squared_dist(points, point)
        variance = np.average(squares, weights=weights) + (self.broken == "boasting")
        return SimpleNamespace(point=point, variance=variance)


CONTRACTS = {
    Geodesic: GeodesicSolver,
    Exp: ExpSolver,
    Log: LogSolver,
    Transport: TransportSolver,
    Mean: MeanSolver,
}
UNCHANGED = "arguments are not changed"
BROKEN = [
    (Geodesic, "greedy", UNCHANGED),
    (Geodesic, "shape", "paths have shape (n_nodes, *shape of a point)"),
    (Geodesic, "one node", "paths have shape (n_nodes, *shape of a point)"),
    (Geodesic, "ends", "paths run from start to end"),
    (Geodesic, "outside", "paths stay on the manifold"),
    (Geodesic, "energy", "the energy is that of the path"),
    (Geodesic, "restless", "the path from a point to itself is constant"),
    (Geodesic, "random", "a second search finds the same path"),
    (Exp, "greedy", UNCHANGED),
    (Exp, "swapped", "geodesics start with their initial velocity"),
    (Exp, "adrift", "with velocity 0 they stay in place"),
    (Log, "greedy", UNCHANGED),
    (Log, "swapped", "logarithms of nearby points lead to these points"),
    (Log, "adrift", "the logarithm of the base point is 0"),
    (Transport, "greedy", UNCHANGED),
    (Transport, "turning", "transport from a point to itself does not change vectors"),
    (Transport, "bent", "transport is linear"),
    (Transport, "adrift", "the vector 0 stays 0"),
    (Mean, "greedy", UNCHANGED),
    (Mean, "far", "the mean is no worse than any of the points"),
    (Mean, "boasting", "the variance is that of the mean"),
    (Mean, "unweighted", "if one point has all the weight, it is the mean"),
]


@pytest.mark.parametrize(("solver", "broken", "name"), BROKEN)
def test_every_property_tells_a_broken_twin(solver, broken, name):
    contract = CONTRACTS[solver]
    assert check_solver(solver(), PLANE.metric, POINTS, contract=contract).passed
    failures = check_solver(solver(broken), PLANE.metric, POINTS.copy(), contract=contract).failures
    assert name in [check.name for check in failures]


@pytest.mark.parametrize("solver", CONTRACTS)
def test_every_property_is_told(solver):
    expected = {name for cls, _, name in BROKEN if cls is solver}
    report = check_solver(solver(), PLANE.metric, POINTS, contract=CONTRACTS[solver])
    assert {check.name for check in report.checks} == expected


def test_the_contract_is_that_of_the_class():
    """Which it inherits from; a solver that inherits from none is one of geodesics."""

    class DeclaredExp(Exp, ExpSolver):
        pass

    names = {check.name for check in check_solver(DeclaredExp(), PLANE.metric, POINTS).checks}
    assert "geodesics start with their initial velocity" in names
    names = {check.name for check in check_solver(Geodesic(), PLANE.metric, POINTS).checks}
    assert "paths run from start to end" in names


def test_bad_input():
    with pytest.raises(ArgumentTypeError, match="solver must be an object with a method solve"):
        check_solver(3, PLANE.metric, POINTS)
    with pytest.raises(ArgumentError, match="contract must be one of .*GeodesicSolver"):
        check_solver(Geodesic(), PLANE.metric, POINTS, contract=Geodesic)
    with pytest.raises(ArgumentError, match="points must hold two points or more; found 1"):
        check_solver(Geodesic(), PLANE.metric, POINTS[:1])
    assert check_solver(Geodesic(), PLANE.metric, POINTS[:2]).passed
