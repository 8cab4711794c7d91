"""Motions and changes of shape replayed: exact cases, the model's own answer, bad input."""

from __future__ import annotations

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import CASES, deformations, sphere_template
from scipy.spatial.transform import Rotation

from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry import AlignedSurfaces, ElasticMetric
from riemhuman.solvers import Disentangling, MotionTransfer, ShapeTransfer
from riemhuman.solvers.transfer import PoseTransfer


@pytest.fixture(scope="module")
def space():
    """Return the surfaces over a deformed sphere."""
    return AlignedSurfaces(sphere_template(), equip=False)


@pytest.fixture(scope="module")
def motion(space):
    """Return a motion of four frames over the sphere."""
    waves = deformations(space.template, 1, rng=3, size=0.4)[0]
    return space.template.vertices + np.linspace(0, 1, 4)[:, None, None] * waves


def test_poses_onto_the_source_itself(space, motion):
    """A rigid motion of the source takes the target along, whatever its own pose."""
    turn = Rotation.from_rotvec([0.2, 1.0, -0.4]).as_matrix()
    path = np.stack([motion[0], motion[0] @ turn.T + [0.3, 0.0, -0.1]])
    moved = MotionTransfer(transfer="pose").solve(space, path, motion[0] @ turn)
    np.testing.assert_allclose(moved[0], motion[0], atol=1e-10)
    gap = moved[1] - path[1]
    np.testing.assert_allclose(gap, gap.mean(axis=0) + 0 * gap, atol=1e-10)


def test_rigid_motions_are_replayed(space, motion):
    """A turn of the source turns the target; a shift shifts it by as much."""
    turn = Rotation.from_rotvec([0.2, 1.0, -0.4]).as_matrix()
    target = motion[2] * [1.3, 0.9, 1.1]
    shifted = MotionTransfer().solve(space, [motion[0], motion[0] + [1.0, 2.0, 3.0]], target)
    np.testing.assert_allclose(shifted[1], target + [1.0, 2.0, 3.0], atol=1e-10)
    turned = MotionTransfer().solve(space, [motion[0], motion[0] @ turn.T], target)[1]
    expected = target @ turn.T
    np.testing.assert_allclose(
        turned - turned.mean(axis=0), expected - expected.mean(axis=0), atol=1e-10
    )


def test_axes_of_a_change_of_shape_turn_with_the_target(space, motion):
    turn = Rotation.from_rotvec([0.3, -1.1, 0.5]).as_matrix()
    moved = ShapeTransfer().solve(space, motion[0], motion[3], motion[0] @ turn.T)
    gap = moved - motion[3] @ turn.T
    np.testing.assert_allclose(gap, gap.mean(axis=0) + 0 * gap, atol=1e-10)


def test_what_is_still_on_the_source_is_still_on_the_target():
    start = bodies.body("resting")
    raised = bodies.body("arm raised")
    target = bodies.body("other build")
    moved = MotionTransfer().solve(bodies.space(), [start, raised], target)
    np.testing.assert_allclose(moved[0], target, atol=1e-10)
    still = np.linalg.norm(raised - start, axis=1) < 1e-6
    assert still.sum() > 100
    # Without more weight on what is still it would be 1.7 mm.
    assert np.linalg.norm(moved[1] - target, axis=1)[still].mean() < 1.2e-3
    assert np.linalg.norm(moved[1] - target, axis=1).max() > 0.3


def test_reference_and_streams(space, motion):
    target = motion[1] * 1.2
    whole = MotionTransfer().solve(space, motion, target)
    later = MotionTransfer().solve(space, iter(motion[1:]), target, reference=motion[0])
    np.testing.assert_allclose(later, whole[1:], atol=1e-12)


def test_bad_input(space, motion):
    with pytest.raises(ArgumentError, match="reference must be left out"):
        MotionTransfer(transfer="pose").solve(space, motion, motion[0], reference=motion[1])
    with pytest.raises(ArgumentError, match="motion must have at least one frame; found none"):
        MotionTransfer().solve(space, [], motion[0])
    with pytest.raises(ArgumentError, match=r"motion\[1\] must have shape"):
        MotionTransfer().solve(space, [motion[0], motion[0][:5]], motion[0])
    with pytest.raises(ArgumentError, match="target must be one surface"):
        MotionTransfer().solve(space, motion, motion)
    with pytest.raises(DegenerateSurfaceError, match="triangle 0"):
        MotionTransfer().solve(space, motion, 0.0 * motion[0])


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
    np.testing.assert_allclose(solved.surface.mean(axis=0), pose.mean(axis=0), atol=1e-12)


def value(found, shape, surface, pose_weight=1000.0):
    """Return the weighted sum that is minimised."""
    shape_metric, pose_metric = metrics(bodies.space())
    turned = pose_metric.squared_dist(found.posed, surface)
    return shape_metric.squared_dist(shape, surface) + pose_weight * turned


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


def test_bad_input_of_disentangling():
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices
    pair = metrics(space)
    with pytest.raises(ArgumentError, match="pose must be one surface"):
        Disentangling().solve(*pair, body, np.stack([body, body]))
    with pytest.raises(ArgumentError, match="every triangle of pose must have an area"):
        Disentangling().solve(*pair, body, 0.0 * body)
    with pytest.raises(ArgumentError, match="the basis belongs to another template"):
        Disentangling(bodies.basis(20)).solve(*pair, body, body)
    with pytest.raises(ArgumentError, match="metrics on surfaces over the same template"):
        Disentangling().solve(pair[0], metrics(bodies.space())[1], body, body)
    plane = CASES["half-plane, distance"].metric
    with pytest.raises(ArgumentError, match="metrics on surfaces over the same template"):
        Disentangling().solve(plane, plane, body, body)


def test_a_body_is_itself_at_once():
    space = AlignedSurfaces(sphere_template(), equip=False)
    body = space.template.vertices + deformations(space.template, 1, rng=1, size=0.3)[0]
    found = Disentangling().solve(*metrics(space), body, body + [0.3, -1.0, 2.0])
    np.testing.assert_allclose(found.surface, body + [0.3, -1.0, 2.0], atol=1e-9)
    assert "at the level of rounding errors" in found.message
    assert found.converged
    assert (found.n_iterations, found.n_evaluations) == (0, 1)
    np.testing.assert_array_equal(found.values, [found.value])
    assert 0.0 <= found.value < 1e-20


def test_size_is_no_pose(space):
    body = space.template.vertices + deformations(space.template, 1, rng=4, size=0.3)[0]
    found = PoseTransfer(space).solve(body, 1.3 * body)
    np.testing.assert_allclose(found, body + 0.3 * body.mean(axis=0), atol=1e-10)


def test_the_pose_is_taken_and_waves_of_the_skin_stay_with_their_owner():
    """Ripples on the body of the pose turn its normals, and hardly those of the result."""
    shape, pose = bodies.body("resting"), bodies.body("arm raised")
    ripples = 0.004 * np.sin(2 * np.pi * bodies.model().template.vertices / 0.12)
    turn, normals = PoseTransfer(bodies.space()), ElasticMetric(bodies.space(), 0.0, 0.0, 1.0)
    smooth, rippled = (turn.solve(shape, pose + wave) for wave in (0.0, ripples))
    assert normals.dist(smooth, rippled) < 0.35 * normals.dist(pose, pose + ripples)
    assert normals.dist(smooth, pose) < 0.3 * normals.dist(shape, pose)
