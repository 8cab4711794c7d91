"""Searches for paths of least energy: what they reach, where they start, how they stop."""

import autograd.numpy as anp
import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import (
    CASES,
    HalfPlane,
    HyperbolicInnerProduct,
    cases_that,
    name_of,
    sphere_template,
)
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import (
    ElasticMetric,
    FlatMetric,
    NormalFields,
    RiemannianMetric,
    VectorSpace,
)
from riemhuman.solvers import (
    BasisPath,
    ClosedFormGeodesic,
    LinearPath,
    PathStraightening,
    PoissonPath,
    SegmentEnergy,
)
from riemhuman.solvers._alignment import align_ends, turn_from_template
from riemhuman.solvers.path_search import refine_path
from riemhuman.solvers.paths import linear_path
from riemhuman.surfaces import DeformationBasis

# With λ = 1e-4 nearly all triangles of two surfaces are at θ = π, where d² has a corner.
# Gauge-invariant metrics let surfaces slide along themselves: in all vertices nothing holds them.
SMOOTH = [case for case in CASES.values() if not case.name.startswith(("shape", "gauge-invariant"))]
WEIGHTS = [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)]
PAIRS = [
    ("resting", "arm raised"),
    ("resting", "other build"),
    ("resting", "elbow bent"),
    ("other build", "knee raised"),
]


def elastic(*weights):
    return ElasticMetric(bodies.space(), *weights)


def over_basis(n_nodes=11, **settings):
    return BasisPath(bodies.basis(), n_nodes, **settings)


def solve(case, **settings):
    return PathStraightening(**settings).solve(case.metric, *case.points[:2])


both_solvers = pytest.mark.parametrize(
    "make", [over_basis, PathStraightening], ids=["basis", "all"]
)


def check_result(metric, result, start, end):
    """Check what holds for every path that a search returns."""
    assert result.converged
    np.testing.assert_array_equal(result.path[[0, -1]], [start, end])
    assert np.all(metric.space.belongs(result.path))
    straight = LinearPath(len(result.path)).solve(metric, start, end).energy
    assert result.energy <= straight * (1 + 1e-12)
    if metric.has_closed_form_dist:
        assert result.lower_bound == metric.squared_dist(start, end)
        assert result.energy >= result.lower_bound * (1 - 1e-12)
    np.testing.assert_allclose(metric.energy(result.path), result.energy, rtol=1e-9)
    assert result.energies[-1] == pytest.approx(result.energy)
    assert len(result.energies) == result.n_iterations + 1 <= result.n_evaluations + 1
    assert np.all(np.diff(result.energies) <= 1e-12 * result.energies[0])


# What they reach.


@pytest.mark.everyday("ebin 0.05 sphere", "ebin 0.5 triangle", "rotations sphere")
@pytest.mark.parametrize("case", cases_that("dist", "geodesic"), ids=name_of)
def test_the_geodesic_where_it_has_a_closed_form(case):
    # A product does not tell which coordinates belong together: its search takes many steps.
    n_nodes = 3 if case.name == "product" else 4
    result = solve(case, n_nodes=n_nodes, tolerance=1e-9)
    squared_dist = case.metric.squared_dist(*case.points[:2])
    assert squared_dist * (1 - 1e-10) <= result.energy <= squared_dist * (1 + 1e-7)
    geodesic = ClosedFormGeodesic(n_nodes).solve(case.metric, *case.points[:2]).path
    assert case.metric.dist(result.path, geodesic).max() < 1e-3 * np.sqrt(squared_dist)


@pytest.mark.parametrize("case", SMOOTH, ids=name_of)
def test_on_any_manifold(case):
    result = solve(case, n_nodes=7)
    check_result(case.metric, result, *case.points[:2])


@pytest.mark.everyday("resting-other build-weights1", "other build-knee raised-weights0")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("pair", PAIRS, ids="-".join)
def test_between_bodies_over_a_basis(weights, pair):
    metric, ends = elastic(*weights), [bodies.body(name) for name in pair]
    check_result(metric, over_basis().solve(metric, *ends), *ends)


@pytest.mark.everyday("4-weights0")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("seed", [1, 4])
def test_below_the_path_over_a_basis(weights, seed):
    """Of arms that turn; from the straight path it ends up to a fifth above."""
    metric, ends = elastic(*weights), bodies.swung_arms(seed)
    result = PathStraightening(4).solve(metric, *ends)
    check_result(metric, result, *ends)
    assert result.energy < over_basis(4).solve(metric, *ends).energy


@pytest.mark.everyday("7-weights2")
@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("n_nodes", [3, 6, 7])
def test_a_body_turned_by_half_a_turn_turns(weights, n_nodes):
    """The straight path is short, and flat in the middle; no surface lies there."""
    metric, start = elastic(*weights), bodies.body("resting")
    end = Rotation.from_rotvec(np.pi * np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)).apply(start)
    line = LinearPath(n_nodes).solve(elastic(1, 1, 0), start, end).path
    assert np.all(metric.space.belongs(line)) == (n_nodes % 2 == 0)
    turned = PoissonPath(n_nodes).solve(metric, start, end)
    for solver in (
        BasisPath(bodies.basis(20), n_nodes, tolerance=1e-2),
        PathStraightening(n_nodes, tolerance=1e-2),
    ):
        result = solver.solve(metric, start, end)
        assert result.converged
        assert np.all(metric.space.belongs(result.path))
        assert metric.squared_dist(start, end) <= result.energy <= turned.energy * (1 + 1e-12)


def test_searches_go_on_where_a_triangle_all_but_vanishes():
    """Its normal jumps on the way, and rounding errors of the ends decide which minimum is found.

    Eight of them ended within 0.17 %, all converged.
    """
    (start, end), energies = bodies.swung_arms(1), []
    for seed in range(2):
        noise = 1e-13 * np.random.default_rng(seed).normal(size=start.shape)
        result = PathStraightening(n_nodes=6).solve(
            elastic(0.0, 0.0, 1.0), start * (1.0 + noise), end
        )
        assert result.converged
        energies.append(result.energy)
    assert np.ptp(energies) < 5e-3 * max(energies)


class Counting(SegmentEnergy):
    """The energy, counting its gradients."""

    def __init__(self):
        object.__setattr__(self, "counts", [])

    def value_and_gradient(self, metric, path):
        self.counts.append(len(path))
        return super().value_and_gradient(metric, path)


def test_evaluations_are_counted_and_iterations_seen():
    metric, energy, seen = FlatMetric(bodies.space()), Counting(), []
    ends = bodies.body("resting"), bodies.body("arm raised")
    few = bodies.basis().truncate(5)
    bulge = LinearPath(5).solve(metric, *ends).path
    bulge[1:-1] += few.combine(np.outer([0.1, 0.2, 0.1], np.ones(5)))
    solver = BasisPath(few, n_nodes=5, energy=energy, callback=lambda *state: seen.append(state))
    result = solver.solve(metric, *ends, initial_path=bulge)
    assert result.energies[0] == pytest.approx(metric.energy(bulge), rel=1e-12)
    assert result.energy == pytest.approx(np.sum((ends[1] - ends[0]) ** 2), rel=1e-5)
    assert result.energy < result.energies[0] / 1.02
    assert result.n_evaluations == len(energy.counts)
    check_seen(metric, result, seen)


def check_seen(metric, result, seen):
    assert [iteration for iteration, _, _ in seen] == list(range(1, result.n_iterations + 1))
    for iteration, energy, path in seen:
        assert energy == pytest.approx(result.energies[iteration], rel=1e-12)
        assert metric.energy(path) == pytest.approx(energy, rel=1e-10)


@both_solvers
def test_a_single_segment_has_no_search(make):
    ends = bodies.body("resting"), bodies.body("arm raised")
    found = make(2).solve(elastic(1, 1, 0), *ends)
    assert (found.n_iterations, found.n_evaluations, found.converged) == (0, 1, True)
    assert (found.message, found.gap) == ("a single segment", 0.0)
    assert found.energy == pytest.approx(elastic(1, 1, 0).squared_dist(*ends))
    np.testing.assert_array_equal(found.path, ends)


# Where they start.


@pytest.mark.parametrize("initial", [PoissonPath(), LinearPath()], ids=["poisson", "linear"])
def test_a_path_differs_from_the_initial_one_by_the_basis(initial):
    metric, ends = elastic(1, 1, 0), (bodies.body("resting"), bodies.body("arm raised"))
    path = over_basis(initial=initial, remove_drift=False).solve(metric, *ends).path
    difference = path - initial.solve(metric, *ends).path
    assert np.abs(difference).max() > 1e-3
    # Deformations are turned as the ends stand.
    turn = turn_from_template(metric, align_ends(metric, *ends))
    basis = DeformationBasis(bodies.basis().vectors @ turn)
    np.testing.assert_allclose(basis.project(difference), difference, atol=1e-12)


class Hill(RiemannianMetric):
    """The plane with a hill beside the straight way from (0, 0) to (1, 0)."""

    def inner_product(self, tangent_vec_a, tangent_vec_b, base_point):
        squared = anp.sum((base_point - np.array([0.5, 0.1])) ** 2, axis=-1)
        return (1.0 + 8.0 * anp.exp(-10.0 * squared)) * anp.sum(
            tangent_vec_a * tangent_vec_b, axis=-1
        )


def test_a_start_that_costs_more_may_end_lower():
    """A smooth way around the hill on its broad side, and a rough one on the other."""
    metric, times = Hill(VectorSpace((2,), equip=False)), np.linspace(0.0, 1.0, 11)
    smooth, rough = (np.stack([times, y * np.sin(np.pi * times)], axis=-1) for y in (0.8, -0.4))
    rough[1:-1, 1] += 0.1 * (-1.0) ** np.arange(9)
    assert metric.energy(smooth) < metric.energy(rough)
    solver = PathStraightening()
    one_way = solver.solve(metric, smooth[0], smooth[-1], initial_path=smooth)
    result = solver._best_of(metric, [smooth, rough])
    assert result.converged
    assert result.energy < 0.9 * one_way.energy
    assert result.path[5, 1] < 0.0 < one_way.path[5, 1]


def test_a_warm_start_over_a_basis_on_which_a_triangle_has_vanished():
    """As paths may have them at a small λ: the surface next to the start has no Gram matrix."""
    metric, ends = elastic(1.0, 0.01, 0.0), bodies.swung_arms(2)
    path = PoissonPath(5).solve(metric, *ends).path.copy()
    first, second, _ = bodies.space().template.faces[100]
    path[1, first] = path[1, second]
    solver = BasisPath(bodies.basis().truncate(20), n_nodes=5)
    result = solver.solve(metric, *ends, initial_path=path)
    assert result.converged
    assert result.energy < metric.energy(path)


def test_a_solver_gives_another_start():
    """It is taken where its path costs less than the others."""
    metric, ends = elastic(1.0, 0.1, 0.1), bodies.swung_arms(4)
    found = over_basis(4).solve(metric, *ends)
    settings = {"n_nodes": 4, "remove_drift": False}
    result = PathStraightening(initial=over_basis(4), **settings).solve(metric, *ends)
    assert result.energies[0] == pytest.approx(found.energy, rel=1e-12)
    assert result.energy < found.energy
    other = PathStraightening(initial=LinearPath(4), **settings).solve(metric, *ends)
    without = PathStraightening(**settings).solve(metric, *ends)
    np.testing.assert_array_equal(other.path, without.path)


@both_solvers
def test_warm_starts_need_next_to_nothing(make):
    metric, ends = elastic(1, 1, 0), (bodies.body("resting"), bodies.body("arm raised"))
    first = make(6).solve(metric, *ends)
    again = make(6).solve(metric, *ends, initial_path=first.path)
    # The first search needs 3 and 9 evaluations; this one needs one, at its start.
    assert again.n_iterations <= 3
    assert first.energy - again.energy <= 1e-4 * first.energy
    assert first.energy * (1 - 1e-4) <= again.energy <= first.energy * (1 + 1e-12)


@pytest.mark.parametrize("case", CASES.values(), ids=name_of)
def test_equal_ends(case):
    result = PathStraightening(n_nodes=4).solve(case.metric, case.points[0], case.points[0])
    assert 0 <= result.energy < 1e-24
    assert result.converged
    assert result.gap == 0.0
    assert (result.n_iterations, result.n_evaluations) == (0, 1)
    np.testing.assert_array_equal(result.energies, [result.energy])
    np.testing.assert_allclose(result.path, case.points[[0, 0, 0, 0]], rtol=1e-13, atol=1e-14)


# How they stop.


@both_solvers
@pytest.mark.parametrize(("share", "is_met"), [(0.96, True), (1.04, False)])
def test_the_tolerance_is_the_share_that_a_newton_step_would_gain(make, share, is_met):
    """Between flat points a bulge b of the path costs its own energy, and one step takes it off."""
    metric = FlatMetric(bodies.space())
    if make is PathStraightening:
        metric = FlatMetric(VectorSpace((20, 3)))
    rng, bulge = np.random.default_rng(5), np.zeros((6, *metric.space.shape))
    start, end = rng.standard_normal((2, *metric.space.shape))
    if make is over_basis:
        start, end = bodies.body("resting"), bodies.body("arm raised")
        bulge[1:-1] = bodies.basis().combine(rng.uniform(-0.2, 0.2, (4, 60)))
    else:
        bulge[1:-1] = 0.1 * rng.standard_normal((4, *metric.space.shape))
    path = linear_path(start, end, 6) + bulge
    gain = float(5.0 * np.sum(np.diff(bulge, axis=0) ** 2) / metric.energy(path))
    result = make(6, tolerance=gain / share).solve(metric, start, end, path)
    assert result.converged
    assert result.energies[0] == pytest.approx(metric.energy(path))
    assert (result.n_iterations == 0) == is_met
    if is_met:
        np.testing.assert_allclose(result.path, path, rtol=1e-14)
        assert result.n_evaluations == 1


@pytest.mark.everyday("weights2")
@pytest.mark.parametrize("weights", WEIGHTS)
def test_how_far_energies_are_above_the_minimum(weights):
    """Within a tenth of a per cent over a basis, half a per cent over all, and said so."""
    metric, gaps = elastic(*weights), []
    for seed in (2, 7):
        ends = bodies.swung_arms(seed)
        found = over_basis(7).solve(metric, *ends)
        least = over_basis(7, tolerance=1e-9).solve(metric, *ends, found.path).energy
        gaps.append((found.gap, 100.0 * (found.energy / least - 1.0)))
    stated, shown = np.array(gaps).T
    assert np.all(shown < 0.1)
    assert np.all(stated > shown / 3.0)
    assert np.all(stated < 10.0 * shown)
    ends = bodies.swung_arms(2)
    found = PathStraightening(n_nodes=5).solve(metric, *ends)
    solver = PathStraightening(n_nodes=5, tolerance=1e-6)
    shown = 100.0 * (found.energy / solver.solve(metric, *ends, found.path).energy - 1.0)
    assert shown < 0.5
    assert shown / 5.0 < found.gap < 10.0 * shown


@both_solvers
def test_drift_costs_nothing(make):
    metric, ends = elastic(1, 1, 0), (bodies.body("resting"), bodies.body("arm raised"))
    removed, kept = (make(4, remove_drift=drift).solve(metric, *ends) for drift in (True, False))
    assert removed.energy == kept.energy
    assert np.abs(kept.path - removed.path).max() > 1e-6
    np.testing.assert_allclose(removed.path, metric.remove_drift(kept.path), atol=1e-12)


# What they refuse.


@both_solvers
def test_ends_and_paths_that_do_not_fit(make):
    metric, start, end = (elastic(1, 1, 1), bodies.body("resting"), bodies.body("arm raised"))
    path = linear_path(start, end, 11)
    given = path.copy()
    for arguments, message in (
        ((start, end[:-1]), "end must have shape"),
        ((np.full_like(start, np.nan), end), "start.*NaN"),
        ((start, end, path[0]), "initial_path must have shape"),
        ((start, end, path[:-1]), "n_nodes = 11 times; found 10"),
        ((start, end, path[::-1]), "from start to end"),
    ):
        with pytest.raises(ArgumentError, match=message):
            make().solve(metric, *arguments)
    path[5] = 0.0
    with pytest.raises(DegenerateSurfaceError, match="triangle 0 of item .5"):
        make().solve(metric, start, end, path)
    path[5] = given[5]
    np.testing.assert_array_equal(path, given)
    with pytest.raises(ArgumentError, match="2"):
        BasisPath(DeformationBasis(np.eye(6).reshape(6, 2, 3))).solve(metric, start, end)


def test_every_point_of_the_start_must_lie_on_the_manifold():
    """Below the half-plane the inner product stays finite."""
    metric = HyperbolicInnerProduct(HalfPlane())
    start, end = np.array([0.0, 1.0]), np.array([1.0, 1.0])
    for place in (1, 2, 3):
        path = linear_path(start, end, 5)
        path[place, 1] = -0.3
        assert np.isfinite(metric.energy(path))
        with pytest.raises(ArgumentError, match=r"leaves the manifold.*pass another initial_path"):
            PathStraightening(n_nodes=5).solve(metric, start, end, path)
    # Between antipodal normals the straight path runs through 0.
    space = NormalFields(sphere_template())
    start = space.random_point(rng=0)
    with pytest.raises(ArgumentError, match=r"leaves the manifold.*pass another initial_path"):
        PathStraightening(n_nodes=5).solve(space.metric, start, -start)


# Refined paths, and flat triangles.


def test_paths_are_refined_along_cubics():
    def curve(n_segments):
        t = np.linspace(0.0, 1.0, n_segments + 1)[:, None, None]
        return np.array([[1.0, -2.0]]) * t**3 + [[0.3, 1.0]] * t**2 + [[0.5, 0.7]]

    for n_before, n_after in ((3, 8), (5, 7), (8, 3)):
        refined = refine_path(curve(n_before), n_after)
        np.testing.assert_allclose(refined, curve(n_after), atol=1e-12)
        np.testing.assert_array_equal(refined[[0, -1]], curve(n_before)[[0, -1]])
    np.testing.assert_allclose(refine_path(curve(1), 4), linear_path(*curve(1), 4 + 1), atol=1e-14)
