"""Path energies: bounds, convergence to each other, gradients."""

import numpy as np
import pytest
from cases import CASES, cases_that, name_of
from oracles import taylor_slope

from riemhuman.errors import ArgumentError
from riemhuman.solvers.paths import FiniteDifferenceEnergy, SegmentEnergy

SEGMENT, DIFFERENCE = SegmentEnergy(), FiniteDifferenceEnergy()

# Points so near on the path that every θ stays far below π, where d² is smooth.
FINE = [case for case in cases_that("dist") if case.metric.has_inner_product]
NEAR = {"shape": 1e-3, "ebin 0.0001": 0.03, "stretch": 0.1}


def curve(case, n_segments, size=1.0):
    """Return n + 1 points of a smooth curve from the first point."""
    t = np.linspace(0, 1, n_segments + 1).reshape((-1,) + (1,) * len(case.space.shape))
    start, end, third = case.points[:3]
    return case.space.projection(
        start + size * t * (end - start) + 0.3 * size * t * (1 - t) * (third - start)
    )


def size_of(case):
    return next((size for name, size in NEAR.items() if case.name.startswith(name)), 1.0)


@pytest.mark.parametrize("case", cases_that("dist"), ids=name_of)
def test_segment_energy_is_never_below_squared_dist(case):
    bound = case.metric.squared_dist(case.points[0], case.points[-1])
    zigzag = np.concatenate([case.points[:3], case.points])
    for path in (zigzag, zigzag[[0, 2, 1, -1]], curve(case, 9)):
        energy = SEGMENT.value(case.metric, path)
        assert energy >= case.metric.squared_dist(path[0], path[-1]) * (1 - 1e-12)
    assert SEGMENT.value(case.metric, zigzag) >= bound


@pytest.mark.parametrize("case", cases_that("dist"), ids=name_of)
def test_segment_energy_rises_under_refinement(case):
    energies = [SEGMENT.value(case.metric, curve(case, n)) for n in (1, 2, 4, 8, 16, 32)]
    assert np.all(np.diff(energies) >= -1e-12 * energies[-1])


def slope_of_difference(energy, case):
    """Return the order at which an energy tends to that of closed-form segments."""
    counts = np.array([32, 64, 128])
    paths = [curve(case, n, size_of(case)) for n in counts]
    exact = np.array([SEGMENT.value(case.metric, path) for path in paths])
    gaps = np.abs([energy.value(case.metric, path) for path in paths] / exact - 1.0)
    if np.all(gaps < 1e-11):
        return np.inf
    return -np.polyfit(np.log(counts), np.log(gaps), 1)[0]


@pytest.mark.parametrize("case", FINE, ids=name_of)
def test_finite_differences_converge_at_second_order(case):
    slope = slope_of_difference(DIFFERENCE, case)
    # Where the metric is flat both agree.
    assert 1.9 < slope < 2.1 or (slope == np.inf and case.name in ("flat", "edges"))


class AtTheStart(FiniteDifferenceEnergy):
    """A broken twin: the inner product at the start of each segment, of first order only."""

    def _energy(self, metric, path):
        return (len(path) - 1) * np.sum(metric.squared_norm(path[1:] - path[:-1], path[:-1]))


@pytest.mark.parametrize("name", ["ebin 1 sphere", "all sphere", "pose open"])
def test_broken_twin_is_of_first_order(name):
    assert slope_of_difference(AtTheStart(), CASES[name]) < 1.5


def check_gradient(energy, case):
    def value(points):
        return energy.value(case.metric, case.space.projection(points))

    found, gradient = energy.value_and_gradient(case.metric, case.points)
    np.testing.assert_allclose(found, energy.value(case.metric, case.points), rtol=1e-12)
    assert gradient.shape == case.points.shape
    direction = case.space.to_tangent(case.tangent_vecs, case.points)
    assert taylor_slope(value, case.points, direction, gradient) >= 1.9


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_gradients_of_segment_energy(case):
    check_gradient(SEGMENT, case)


@pytest.mark.parametrize(
    "case", [case for case in CASES.values() if case.metric.has_inner_product], ids=name_of
)
def test_gradients_of_finite_difference_energy(case):
    check_gradient(DIFFERENCE, case)


class HalfAGradient(SegmentEnergy):
    def value_and_gradient(self, metric, path):
        value, gradient = super().value_and_gradient(metric, path)
        return value, 0.999 * gradient


def test_wrong_gradient_is_seen():
    with pytest.raises(AssertionError):
        check_gradient(HalfAGradient(), CASES["all sphere"])


def test_without_closed_form_both_energies_agree():
    case = CASES["half-plane, inner product"]
    assert SEGMENT.value(case.metric, case.points) == DIFFERENCE.value(case.metric, case.points)


@pytest.mark.parametrize("energy", [SEGMENT, DIFFERENCE], ids=["segment", "difference"])
def test_bad_paths_are_refused(energy):
    case = CASES["all triangle"]
    for path, found in (
        (case.points[0], r"found \(3, 3\)"),
        (np.full_like(case.points, np.nan), "36 NaN"),
    ):
        with pytest.raises(ArgumentError, match=found):
            energy.value(case.metric, path)
        with pytest.raises(ArgumentError, match=found):
            energy.value_and_gradient(case.metric, path)
