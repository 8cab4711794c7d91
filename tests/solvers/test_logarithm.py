"""The discrete logarithm, and that it is the inverse of the discrete exponential."""

from dataclasses import dataclass

import autograd.numpy as anp
import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import CASES, cases_that, deformations, name_of

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import (
    ArgumentError,
    ArgumentTypeError,
    ConvergenceWarning,
    NotDefinedError,
)
from riemhuman.geometry import AlignedSurfaces, ElasticMetric, RiemannianMetric
from riemhuman.solvers import (
    BasisPath,
    ClosedFormGeodesic,
    DiscreteExponential,
    DiscreteLogarithm,
    LinearPath,
    logarithm,
)
from riemhuman.solvers._geodesic_equation import MiddleEquation
from riemhuman.solvers.results import PathResult
from riemhuman.surfaces import DeformationBasis

CLOSED_FORM = [
    case
    for case in cases_that("dist", "exp", "log", "geodesic")
    if case.name not in ("product", "product of one", "flat")
]
OTHERS = [
    CASES[name] for name in ("mixed sphere", "all open", "srnf triangle", "half-plane, distance")
]


def orders(errors):
    """Return the orders at which errors fall where the step is halved."""
    errors = np.asarray(errors)
    return np.log2(errors[:-1] / errors[1:])


@pytest.mark.parametrize("case", CLOSED_FORM, ids=name_of)
def test_second_order_against_closed_forms(case):
    start, end = case.points[:2]
    exact = case.metric.log(end, start)
    errors = []
    for n_steps in (8, 16, 32):
        solver = DiscreteLogarithm(geodesic_solver=ClosedFormGeodesic(n_steps + 1))
        result = solver.solve(case.metric, end, start)
        assert result.converged
        errors.append(np.abs(result.tangent_vec - exact).max())
    assert np.all(orders(errors) > 1.85)
    assert result.energy == pytest.approx(float(case.metric.squared_dist(start, end)), rel=1e-8)


@pytest.mark.parametrize("case", OTHERS, ids=name_of)
def test_inverse_of_the_exponential_in_all_coordinates(case):
    start = case.points[0]
    velocity = 0.25 * (case.points[1] - start)
    forward = DiscreteExponential(n_steps=6, tolerance=1e-10).solve(case.metric, velocity, start)
    back = DiscreteLogarithm(n_steps=6).solve(case.metric, forward.end, start)
    size = float(case.metric.norm(velocity, start))
    error = float(case.metric.norm(back.tangent_vec - velocity, start))
    assert back.converged
    assert error < 1e-4 * size
    if case.name != "srnf triangle":
        # Even translations, which the metrics do not see: 1e-4 and more where the path drifts.
        assert np.abs(back.tangent_vec - velocity).max() < 3e-5
    assert back.energy == pytest.approx(forward.energy, rel=1e-6)


@pytest.mark.sampled(3)
@pytest.mark.parametrize(
    ("weights", "end"),
    [
        ((1.0, 1.0, 0.0), "arm raised"),
        ((0.0, 0.0, 1.0), "elbow bent"),
        ((1.0, 0.1, 0.1), "other build"),
    ],
)
def test_inverse_of_the_exponential_on_bodies(weights, end):
    """With one time step exp∘log is the identity; with another it is to the second order."""
    metric = ElasticMetric(bodies.space(), *weights)
    basis = bodies.basis(30)
    start, end = bodies.body("resting"), bodies.body(end)
    gaps = []
    for n_steps in (5, 10):
        log = DiscreteLogarithm(basis, n_steps=n_steps).solve(metric, end, start)
        assert log.converged
        joined = basis.extend(log.path[1:] - start)
        forward = DiscreteExponential(joined, n_steps=n_steps).solve(metric, log.tangent_vec, start)
        # A tenth of a millimetre, of displacements of decimetres.
        assert np.abs(forward.end - end).max() < 1e-4
        finer = DiscreteExponential(joined, n_steps=2 * n_steps)
        gaps.append(np.abs(finer.solve(metric, log.tangent_vec, start).end - end).max())
    again = DiscreteLogarithm(basis, n_steps=n_steps).solve(metric, forward.end, start)
    assert np.abs(again.tangent_vec - log.tangent_vec).max() < 1e-4
    assert orders(gaps) > 1.4


def squat(rng):
    """Return a body that stands and squats, arms raised, each joint a little off."""
    model = bodies.model()
    legs = {f"{side}_{joint}": (angle, 0, 0) for side in ("left", "right") for joint, angle in LEGS}
    arms = {"left_shoulder": (0, 0, 60), "right_shoulder": (0, 0, -60)}
    poses = np.stack([bodies.pose(), bodies.pose(**legs, **arms)])
    poses += rng.normal(0.0, 0.05, poses.shape)
    return model(betas=rng.normal(size=model.n_betas), pose=poses)


LEGS = (("hip", -70), ("knee", 90), ("ankle", -20))


@pytest.mark.sampled(5)
@pytest.mark.parametrize("weights", [(1.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.1, 0.1)])
@pytest.mark.parametrize("change", ["squat", "arms"])
def test_large_changes_of_pose(weights, change):
    """The path that turns limbs is not given up for one within the basis, and can be followed."""
    metric, basis = ElasticMetric(bodies.space(), *weights), bodies.basis()
    start, end = bodies.swung_arms(4) if change == "arms" else squat(np.random.default_rng(1))
    found = DiscreteLogarithm(basis).solve(metric, end, start)
    assert found.converged
    assert found.energy <= 1.011 * BasisPath(basis).solve(metric, start, end).energy
    assert metric.norm(found.tangent_vec, start) == pytest.approx(np.sqrt(found.energy), rel=0.03)
    joined = basis.extend(found.path[1:] - start)
    forward = DiscreteExponential(joined).solve(metric, found.tangent_vec, start)
    assert forward.converged
    # Millimetres, of half a metre.
    assert np.linalg.norm(forward.end - end, axis=1).mean() < 1e-3


@pytest.mark.sampled(2)
@pytest.mark.parametrize("weights", [(1.0, 0.1, 0.1), (1.0, 1.0, 1.0)])
def test_large_changes_of_pose_over_all_vertices(weights):
    """Translations, which the metric does not see, go on uniformly: else millimetres are lost."""
    metric = ElasticMetric(bodies.space(), *weights)
    start, end = squat(np.random.default_rng(1))
    found = DiscreteLogarithm().solve(metric, end, start)
    forward = DiscreteExponential().solve(metric, found.tangent_vec, start)
    assert found.converged
    assert forward.converged
    # Micrometres, of half a metre.
    assert np.linalg.norm(forward.end - end, axis=1).mean() < 2e-5


def test_half_a_turn_says_what_is_the_matter():
    """Of normals alone, within a basis that does not hold the turn: the size was named."""
    data = load_open_bodies("coarse")
    metric = ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    basis, start = DeformationBasis.from_laplacian(data.template, 20), data.points[0]
    # The path may be found or not, and be another with other rounding errors.
    with pytest.warns(ConvergenceWarning) as told:
        found = DiscreteLogarithm(basis, n_steps=4).solve(metric, start * [-1, 1, -1], start)
    assert not found.converged
    assert "step before the start: triangle" in str(told[-1].message)
    assert "turned over" in str(told[-1].message)


def test_velocities_that_do_not_fit_the_path_are_no_logarithms():
    """A path that dawdles at first."""
    case = CASES["mixed triangle"]
    shares = np.array([0.0, 0.1, 0.5, 1.0])[:, None, None]
    path = case.points[0] + 0.2 * shares * (case.points[1] - case.points[0])
    solver = DiscreteLogarithm(geodesic_solver=Given(case.metric, path))
    with pytest.warns(ConvergenceWarning, match="the velocity has norm .* the path length"):
        found = solver.solve(case.metric, path[-1], path[0])
    assert not found.converged


def test_energy_is_the_squared_norm_to_second_order():
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.0)
    start, end = bodies.body("resting"), bodies.body("arm raised")
    errors = []
    for n_steps in (5, 10):
        straight = BasisPath(
            bodies.basis(30).extend((end - start)[None]),
            n_steps + 1,
            initial=LinearPath(n_steps + 1),
            tolerance=1e-11,
            remove_drift=False,
        )
        solver = DiscreteLogarithm(bodies.basis(30), n_steps, straight)
        found = solver.solve(metric, end, start)
        errors.append(abs(found.energy / metric.squared_norm(found.tangent_vec, start) - 1))
    assert orders(errors) > 1.7
    assert found.energy >= metric.squared_dist(start, end)


def test_a_solver_may_be_given():
    metric = ElasticMetric(bodies.space(), 1.0, 1.0, 0.0)
    start, end = bodies.body("resting"), bodies.body("arm raised")
    solver = BasisPath(bodies.basis(30), n_nodes=4)
    found = DiscreteLogarithm(bodies.basis(30), geodesic_solver=solver).solve(metric, end, start)
    path = solver.solve(metric, start, end).path
    np.testing.assert_array_equal(found.path, path)
    first = 3.0 * (path[1] - path[0])
    assert metric.norm(found.tangent_vec - first, start) < 0.5 * metric.norm(first, start)


def test_path_stays_in_the_basis_and_the_difference():
    case = CASES["mixed sphere"]
    start, end = case.points[0], 0.7 * case.points[0] + 0.3 * case.points[1]
    basis = DeformationBasis(deformations(case.space.template, 4, rng=9), orthonormalize=True)
    found = DiscreteLogarithm(basis, n_steps=4).solve(case.metric, end, start)
    assert found.converged
    assert len(found.path) == 5
    joined = basis.extend((end - start)[None])
    assert len(joined) == 5
    for deformation in (*(found.path - start), found.tangent_vec):
        np.testing.assert_allclose(joined.project(deformation), deformation, atol=1e-10)


class Given:
    """A solver with its result."""

    def __init__(self, metric, path, converged=True):
        energy = float(metric.energy(path))
        self.result = PathResult(
            path,
            energy,
            np.array([energy]),
            n_iterations=70,
            n_evaluations=900,
            converged=converged,
            message="as given",
        )

    def solve(self, metric, start, end):
        return self.result


def test_counts_of_path_and_velocity_are_added():
    case = CASES["mixed triangle"]
    path = np.linspace(case.points[0], 0.8 * case.points[0] + 0.2 * case.points[1], 4)
    given = Given(case.metric, path)
    found = DiscreteLogarithm(geodesic_solver=given).solve(case.metric, path[-1], path[0])
    backward = MiddleEquation(case.metric).next_point(path[1], path[0])
    assert found.n_iterations == 70 + backward.n_iterations > 70
    assert found.n_evaluations == 900 + backward.n_evaluations > 900
    assert found.energy == case.metric.energy(path)
    assert (found.converged, found.message) == (True, "as given")
    np.testing.assert_array_equal(found.path, path)
    np.testing.assert_allclose(found.tangent_vec, 1.5 * (path[1] - backward.points[2]))


def test_a_path_that_was_not_found_is_no_geodesic():
    case = CASES["mixed triangle"]
    solver = DiscreteLogarithm(geodesic_solver=Given(case.metric, case.points[:2], False))
    with pytest.warns(ConvergenceWarning, match="as given"):
        found = solver.solve(case.metric, *case.points[1::-1])
    assert not found.converged
    assert "as given" in found.message


class VertexDistance(RiemannianMetric):
    """Surfaces as vectors: straight lines are geodesics, wherever they lead."""

    def squared_dist(self, point_a, point_b):
        """Return Σ ‖a − b‖²."""
        return anp.sum((point_a - point_b) ** 2, axis=(-2, -1))


def test_says_when_the_step_before_the_start_turns_triangles_over():
    case = CASES["mixed open"]
    path = np.stack([case.points[0]] * 3)
    # By as much as the first step widens the surface, the one before it takes away.
    path *= np.array([[1.0, 1.0, 1.0], [3.0, 1.0, 1.0], [5.0, 1.0, 1.0]])[:, None]
    metric = VertexDistance(case.space)
    given = Given(metric, path)
    with pytest.warns(ConvergenceWarning, match="before the start: triangle [0-9]+ degen"):
        found = DiscreteLogarithm(geodesic_solver=given).solve(metric, path[-1], path[0])
    assert not found.converged
    np.testing.assert_allclose(found.tangent_vec, path[-1] - path[0], atol=1e-6)


def test_the_step_before_the_start_is_compared_with_the_start():
    """A plane that turns by 100 degrees was 24 degrees behind, if its vertices move straight on."""
    space, angle = CASES["mixed open"].space, np.radians(100.0)
    plane = space.template.vertices
    turned = plane * [1.0, np.cos(angle), 0.0] + plane[:, [0, 2, 1]] * [0.0, 0.0, np.sin(angle)]
    path = np.stack([plane, turned, 2.0 * turned - plane])
    metric = VertexDistance(space)
    solver = DiscreteLogarithm(geodesic_solver=Given(metric, path))
    found = solver.solve(metric, path[-1], path[0])
    assert (found.converged, found.message) == (True, "as given")


@pytest.mark.parametrize("collapsing", [False, True])
def test_the_path_is_sought_from_what_the_basis_has_of_the_first(monkeypatch, collapsing):
    case = CASES["mixed sphere"]
    start, end = case.points[0], 0.7 * case.points[0] + 0.3 * case.points[1]
    vectors = np.eye(start.size) if collapsing else start / np.linalg.norm(start)
    basis = DeformationBasis(vectors.reshape(-1, *start.shape))
    straight = np.linspace(start, end, 4)
    first, sought = straight.copy(), []
    # What collapses has no energy; of what is added otherwise, a part lies across the basis.
    first[2] = 0.0 if collapsing else straight[2] + 0.1 * start + 0.1 * case.tangent_vecs[0]

    @dataclass(frozen=True)
    class Scripted:
        basis: DeformationBasis
        n_nodes: int
        remove_drift: bool
        tolerance: float = 1e-4

        def solve(self, metric, start, end, initial_path=None):
            sought.append(initial_path)
            return PathResult(first, 1.0, np.ones(1))

    monkeypatch.setattr(logarithm, "BasisPath", Scripted)
    with pytest.warns(ConvergenceWarning, match="the velocity has norm"):
        DiscreteLogarithm(basis, n_steps=3).solve(case.metric, end, start)
    joined = basis.extend((end - start)[None])
    expected = straight if collapsing else start + joined.project(first - start)
    assert sought[0] is None
    np.testing.assert_allclose(sought[1], expected, atol=1e-12)
    assert np.abs(sought[1] - first).max() > 1e-3


def test_metrics_take_it_as_log_solver():
    case = CASES["mixed triangle"]
    solver = DiscreteLogarithm(n_steps=4)
    metric = ElasticMetric(case.space, 1.0, 0.1, 0.1, log_solver=solver)
    velocities = metric.log(case.points[1:3], case.points[0])
    assert velocities.shape == (2, 3, 3)
    found = solver.solve(metric, case.points[1], case.points[0])
    np.testing.assert_array_equal(velocities[0], found.tangent_vec)
    with pytest.raises(NotDefinedError, match="log_solver=riemhuman.solvers.DiscreteLogarithm"):
        case.metric.log(*case.points[:2])


def test_of_the_point_itself_is_zero():
    case = CASES["mixed open"]
    found = DiscreteLogarithm(n_steps=3).solve(case.metric, case.points[0], case.points[0])
    np.testing.assert_allclose(found.tangent_vec, 0.0, atol=1e-9)


def test_says_when_it_has_not_converged():
    case = CASES["mixed sphere"]
    solver = DiscreteLogarithm(n_steps=3, max_iter=1)
    with pytest.warns(ConvergenceWarning, match="the step before the start: error"):
        found = solver.solve(case.metric, *case.points[1::-1])
    assert not found.converged


@pytest.mark.parametrize(
    ("settings", "error"),
    [
        ({"n_steps": 0}, ArgumentError),
        ({"n_steps": "many"}, ArgumentTypeError),
        ({"tolerance": -1.0}, ArgumentError),
        ({"max_iter": 0}, ArgumentError),
    ],
)
def test_settings_are_checked(settings, error):
    with pytest.raises(error, match=next(iter(settings))):
        DiscreteLogarithm(**settings)


def test_bad_input():
    case = CASES["mixed triangle"]
    start, end = case.points[:2]
    with pytest.raises(ArgumentError, match="start must have shape"):
        DiscreteLogarithm().solve(case.metric, end, start[:2])
    with pytest.raises(ArgumentError, match="end holds 9 NaN"):
        DiscreteLogarithm().solve(case.metric, np.nan * end, start)
    with pytest.raises(ArgumentError, match="the basis belongs to another template"):
        DiscreteLogarithm(bodies.basis(20)).solve(case.metric, end, start)


def test_a_fold_that_snaps_within_one_step():
    """Where a triangle turns too far within a step, the path goes where no exponential follows.

    Seen to fail with five steps throughout: the exponential stopped 89 mm before the other body.
    """
    natural = load_open_bodies("coarse", variant="natural")
    own, names = natural.points[30:40], list(natural.pose_names)
    start, end = own[names.index("a_stance")], own[names.index("squat")]
    metric = ElasticMetric(AlignedSurfaces(natural.template), 1.0, 0.1, 0.1)
    found = DiscreteLogarithm(n_steps=5).solve(metric, end, start)
    assert (len(found.path), found.converged) == (11, True)
    there = DiscreteExponential(n_steps=5).solve(metric, found.tangent_vec, start)
    assert (there.n_steps, there.converged) == (10, True)
    assert np.linalg.norm(there.end - end, axis=1).mean() < 1e-5
    with pytest.warns(ConvergenceWarning, match="degenerates"):
        DiscreteExponential(n_steps=5, n_doublings=0).solve(metric, found.tangent_vec, start)
