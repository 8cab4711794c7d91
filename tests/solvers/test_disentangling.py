"""One body's shape with another's pose: against the model's truth and its own definition."""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import CASES, deformations, sphere_template
from disentangled_bodies import PARTS, Disentangled, natural_people, random_pairs
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_bodies
from riemhuman.errors import ArgumentError, ArgumentTypeError, ConvergenceWarning
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.geometry.elastic_metric import ElasticMetric
from riemhuman.geometry.srnf import SRNFMetric
from riemhuman.solvers import Disentangling
from riemhuman.solvers.quasi_newton import _ROUND
from riemhuman.surfaces import DeformationBasis


def metrics(space):
    """Return the metric of shape and that of pose."""
    return ElasticMetric(space, 1.0, 1.0, 0.0), ElasticMetric(space, 0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def solved():
    """Return the body of another build with a raised knee, of its own start."""
    shape, pose = bodies.body("other build"), bodies.body("knee raised")
    return Disentangling(tolerance=1e-5).solve(*metrics(bodies.space()), shape, pose)


def centred(surface):
    """Return a surface with its centroid at the origin."""
    return surface - surface.mean(axis=0)


def error(surface, truth):
    """Return the mean distance of vertices, translations aside."""
    return np.linalg.norm(centred(surface - truth), axis=-1).mean()


def test_a_third_of_the_better_inputs_error():
    """Mean over pairs of two people in two poses of the open bodies."""
    data = load_open_bodies("coarse")
    solver = Disentangling()
    rng = np.random.default_rng(0)
    errors = []
    for _ in range(8):
        one, other = rng.choice(10, 2, replace=False)
        a, b = 10 * one + rng.integers(10), 10 * other + rng.integers(10)
        truth = data.model(data.betas[a], data.pose_vectors[b])
        found = solver.solve(*metrics(bodies.space()), data.points[a], data.points[b])
        better = min(error(data.points[k], truth) for k in (a, b))
        errors.append((error(found.surface, truth), better))
    ours, theirs = np.mean(errors, axis=0)
    assert ours < theirs / 3


def test_the_person_is_kept_whoever_holds_the_pose():
    """On people who hold poses otherwise, with faces and flesh of their own."""
    measure = Disentangled(*natural_people("coarse")).measure
    found = [measure(*pair) for pair in random_pairs(6)]
    for part in PARTS:
        assert all(one.nearer[part] for one in found)
    assert max(one.edges for one in found) < 0.06
    # At most half of what it is by B's own normals in place of the smooth turn, 4.62 mm.
    assert np.mean([one.segments for one in found]) < 0.5 * 4.62
    ratios = [one.performed / one.nearer_input for one in found]
    assert np.mean(ratios) < 0.3


@pytest.mark.slow
def test_full_bodies_converge():
    """Where heat flowed six times as long along bones, and triangles of sharp joints gave way to
    all strain, the search ended at triangles without area."""
    measured = Disentangled(*natural_people("full", 31))
    for a, p, b, q in [random_pairs(10, 31)[k] for k in (1, 9)]:
        for pose in (measured.points[b, q], measured.points[a, q]):
            found = measured.solver.solve(*measured.metrics, measured.points[a, p], pose)
            assert found.converged
            assert found.n_evaluations < 100


def test_result_is_of_the_definition(solved):
    shape_metric, pose_metric = metrics(bodies.space())
    shape, pose = bodies.body("other build"), bodies.body("knee raised")
    assert solved.converged
    assert solved.shape_dist == pytest.approx(shape_metric.dist(shape, solved.surface))
    assert solved.pose_dist == pytest.approx(pose_metric.dist(pose, solved.surface))
    assert solved.value == pytest.approx(value(solved, shape, solved.surface))
    assert solved.values[-1] == pytest.approx(solved.value)
    assert np.all(np.diff(solved.values) <= 1e-12)
    assert len(solved.values) == solved.n_iterations + 1
    assert solved.shape_dist < 0.5 * shape_metric.dist(shape, pose)
    assert solved.pose_dist < 0.6 * pose_metric.dist(shape, pose)
    np.testing.assert_allclose(solved.surface.mean(axis=0), pose.mean(axis=0), atol=1e-12)


def value(found, shape, surface, pose_weight=1000.0):
    """Return the weighted sum that is minimised."""
    shape_metric, pose_metric = metrics(bodies.space())
    turned = pose_metric.squared_dist(found.turned, surface)
    return shape_metric.squared_dist(shape, surface) + pose_weight * turned


def test_no_surface_near_is_better(solved):
    shape = bodies.body("other build")
    for direction in bodies.basis().vectors[:5]:
        for size in (-0.05, 0.05):
            assert value(solved, shape, solved.surface + size * direction) > solved.value


def test_in_a_basis(solved):
    """The result differs from the shape body by the basis and a translation alone."""
    shape, pose = bodies.body("other build"), bodies.body("knee raised")
    basis = bodies.basis()
    found = Disentangling(basis, tolerance=1e-5).solve(*metrics(bodies.space()), shape, pose)
    difference = found.surface - shape
    shifts = np.tile(np.eye(3)[:, None], (1, len(shape), 1)).reshape(3, -1)
    span = np.concatenate([basis.flat, shifts])
    weights = np.linalg.lstsq(span.T, difference.ravel(), rcond=None)[0]
    np.testing.assert_allclose(span.T @ weights, difference.ravel(), atol=1e-10)
    np.testing.assert_array_equal(found.values, solved.values)
    assert found.value == pytest.approx(value(found, shape, found.surface))
    assert found.value > solved.value
    np.testing.assert_allclose(found.surface.mean(axis=0), pose.mean(axis=0), atol=1e-12)


def test_a_basis_keeps_the_build():
    """In place it is nearer to the model's truth than without, and hardly farther in shape."""
    betas = np.random.default_rng(3).normal(size=(5, bodies.model().n_betas))
    pose = bodies.pose(left_shoulder=(0, 0, 50), left_elbow=(0, -30, 0))
    truth = bodies.model()(betas=betas[1], pose=pose)
    # How three other people raise an arm.
    turns = np.linspace(0, 1, 11)[:, None, None] * pose
    motions = [bodies.model()(betas=betas[k], pose=turns) for k in (2, 3, 4)]
    basis = DeformationBasis.from_motions(motions, n_components=8, step=2)
    pair = metrics(bodies.space())
    free, kept = (
        Disentangling(allowed)
        .solve(*pair, bodies.body("other build"), bodies.body("arm raised"))
        .surface
        for allowed in (None, basis)
    )
    assert pair[0].dist(kept, truth) < 1.25 * pair[0].dist(free, truth)
    assert error(kept, truth) < 0.5 * error(free, truth)


def test_weights_pull_either_way():
    space = AlignedSurfaces(sphere_template(), equip=False)
    shape, pose = space.template.vertices + deformations(space.template, 2, rng=1, size=0.3)
    found = [
        Disentangling(pose_weight=weight, tolerance=1e-6).solve(*metrics(space), shape, pose)
        for weight in (0.1, 1.0, 10.0)
    ]
    assert np.all(np.diff([result.shape_dist for result in found]) > 0)
    from_turned = [metrics(space)[1].dist(one.turned, one.surface) for one in found]
    assert np.all(np.diff(from_turned) < 0)


@pytest.mark.parametrize("weight", [1.0, 50.0])
def test_a_body_with_itself_is_itself(weight):
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices + deformations(space.template, 1, rng=2, size=0.3)[0]
    found = Disentangling(pose_weight=weight).solve(*metrics(space), body, body)
    np.testing.assert_allclose(found.surface, body, atol=1e-9)


def test_the_shape_of_a_turned_body_is_its_shape():
    """Where the two differ by a rotation the result is the second, exactly: both terms vanish."""
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices + deformations(space.template, 1, rng=4, size=0.3)[0]
    turned = body @ Rotation.from_rotvec([0.5, -0.8, 0.3]).as_matrix() + [1.0, 0.0, 2.0]
    found = Disentangling().solve(*metrics(space), body, turned)
    np.testing.assert_allclose(found.surface, turned, atol=1e-7)


def test_other_metrics_and_starts():
    space = AlignedSurfaces(sphere_template(), equip=False)
    shape, pose = space.template.vertices + deformations(space.template, 2, rng=6, size=0.2)
    shape_metric, pose_metric = metrics(space)[0], SRNFMetric(space)
    found = [
        Disentangling(pose_weight=1.0, tolerance=1e-9).solve(
            shape_metric, pose_metric, shape, pose, initial=initial
        )
        for initial in (None, pose)
    ]
    assert found[0].value == pytest.approx(found[1].value, rel=1e-5)


def test_callback_and_iterations():
    seen = []
    shape, pose = bodies.body("other build"), bodies.body("knee raised")
    solver = Disentangling(max_iter=2, tolerance=1e-9, callback=lambda *s: seen.append(s))
    with pytest.warns(ConvergenceWarning, match="Disentangling stopped without converging"):
        found = solver.solve(*metrics(bodies.space()), shape, pose)
    assert [iteration for iteration, _, _ in seen] == [1, 2]
    assert seen[-1][1] == pytest.approx(found.values[-1])
    assert seen[-1][2].shape == shape.shape
    for _, reported, surface in seen:
        assert reported == pytest.approx(value(found, shape, surface), rel=1e-9)
    assert found.n_iterations == 2


class Noting(ElasticMetric):
    """A metric that notes where its matrix and its gradient are asked for."""

    def __init__(self, *parameters):
        super().__init__(*parameters)
        self.centres = []

    def metric_matrix(self, points):
        self.centres.append(points)
        return super().metric_matrix(points)


def test_rounds_begin_where_the_last_ended():
    """Iterations run in rounds; each is preconditioned at the surface it begins with."""
    space = AlignedSurfaces(sphere_template(), equip=False)
    shape, pose = space.template.vertices + deformations(space.template, 2, rng=1, size=0.7)
    metric, seen = Noting(space, 1.0, 1.0, 0.0), [(0, 0.0, shape)]
    solver = Disentangling(tolerance=1e-8, callback=lambda *state: seen.append(state))
    found = solver.solve(metric, metrics(space)[1], shape, pose, initial=shape)
    assert found.n_iterations > _ROUND
    assert len(metric.centres) == 1 + (found.n_iterations - 1) // _ROUND
    for k, centre in enumerate(metric.centres):
        np.testing.assert_allclose(centre, seen[k * _ROUND][2], atol=1e-10)
    for iteration, value, _ in seen[1:]:
        assert value == pytest.approx(found.values[iteration])


@pytest.mark.parametrize(("share", "is_met"), [(0.96, True), (1.04, False)])
def test_tolerance_is_the_share_that_a_newton_step_would_gain(share, is_met):
    """Between bodies so near to each other that the sum is a polynomial of second degree."""
    space = AlignedSurfaces(sphere_template(), equip=False)
    fields = deformations(space.template, 2, rng=1, size=1e-5)
    shape, pose = space.template.vertices + fields
    pair = metrics(space)
    best = Disentangling(pose_weight=2.0, tolerance=1e-10).solve(*pair, shape, pose)
    noise = np.random.default_rng(2).uniform(-1e-7, 1e-7, shape.shape)
    start = best.surface + noise

    def value(surface):
        turned = pair[1].squared_dist(best.turned, surface)
        return pair[0].squared_dist(shape, surface) + 2.0 * turned

    gain = 1.0 - best.value / value(start)
    solver = Disentangling(pose_weight=2.0, tolerance=float(gain) / share)
    found = solver.solve(*pair, shape, pose, initial=start)
    assert found.converged
    assert found.values[0] == pytest.approx(value(start), rel=1e-6)
    assert (found.n_iterations == 0) == is_met


@pytest.mark.parametrize(
    ("settings", "error"),
    [
        ({"shape_weight": 0.0}, ArgumentError),
        ({"pose_weight": -1.0}, ArgumentError),
        ({"tolerance": 0.0}, ArgumentError),
        ({"smoothing": 0.0}, ArgumentError),
        ({"max_iter": 1.5}, ArgumentTypeError),
    ],
)
def test_settings_are_checked(settings, error):
    with pytest.raises(error, match=next(iter(settings))):
        Disentangling(**settings)


def test_bad_input():
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices
    pair = metrics(space)
    with pytest.raises(ArgumentError, match="shape must have shape"):
        Disentangling().solve(*pair, body[:4], body)
    with pytest.raises(ArgumentError, match="pose must be one surface"):
        Disentangling().solve(*pair, body, np.stack([body, body]))
    with pytest.raises(ArgumentError, match="every triangle of pose must have an area"):
        Disentangling().solve(*pair, body, 0.0 * body)
    with pytest.raises(ArgumentError, match="the basis belongs to another template"):
        Disentangling(bodies.basis(20)).solve(*pair, body, body)
    with pytest.raises(ArgumentError, match="metrics on surfaces over one template"):
        Disentangling().solve(pair[0], metrics(bodies.space())[1], body, body)
    plane = CASES["half-plane, distance"].metric
    with pytest.raises(ArgumentError, match="metrics on surfaces over one template"):
        Disentangling().solve(plane, plane, body, body)


def test_a_body_is_itself_at_once():
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices + deformations(space.template, 1, rng=1, size=0.3)[0]
    found = Disentangling().solve(*metrics(space), body, body + [0.3, -1.0, 2.0])
    np.testing.assert_allclose(found.surface, body + [0.3, -1.0, 2.0], atol=1e-9)
    assert found.message == "the start is at no distance from either"
    assert found.converged
    assert (found.n_iterations, found.n_evaluations) == (0, 1)
    np.testing.assert_array_equal(found.values, [found.value])
    assert 0.0 <= found.value < 1e-20


def test_a_body_is_itself_at_once_for_metrics_blind_to_scale():
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices + deformations(space.template, 1, rng=1, size=0.3)[0]
    normals = metrics(space)[1]
    found = Disentangling().solve(normals, normals, body, body + [0.3, -1.0, 2.0])
    assert found.message == "the start is at no distance from either"


def test_where_the_bodies_are_makes_no_difference():
    space = AlignedSurfaces(sphere_template(), equip=False)
    shape, pose = space.template.vertices + deformations(space.template, 2, rng=1, size=0.3)
    vectors = deformations(space.template, 5, rng=2) + [0.4, -0.3, 0.2]
    basis = DeformationBasis(vectors, orthonormalize=True)
    here = Disentangling(basis, tolerance=1e-8).solve(*metrics(space), shape, pose)
    shift = np.array([3.0, -2.0, 1.0])
    for shape_moved, pose_moved in ((shift, 0.0), (0.0, shift)):
        there = Disentangling(basis, tolerance=1e-8).solve(
            *metrics(space), shape + shape_moved, pose + pose_moved
        )
        np.testing.assert_allclose(there.surface, here.surface + pose_moved, atol=1e-4)
        assert there.value == pytest.approx(here.value, rel=1e-4)
