"""Motions and changes of shape replayed: exact cases, the model's own answer, bad input."""

import bodies_in_motion as bodies
import numpy as np
import pytest
from cases import deformations, sphere_template
from scipy.spatial.transform import Rotation

from riemhuman.datasets import load_open_motions
from riemhuman.errors import ArgumentError, DegenerateSurfaceError
from riemhuman.geometry.aligned_surfaces import AlignedSurfaces
from riemhuman.solvers import MotionTransfer, ShapeTransfer


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


@pytest.mark.parametrize("axes", ["world", "body"])
def test_onto_the_source_itself(space, motion, axes):
    moved = MotionTransfer(axes).solve(space, motion, motion[0])
    np.testing.assert_allclose(moved, motion, atol=1e-10)


@pytest.mark.parametrize("axes", ["world", "body"])
def test_a_source_at_rest_leaves_the_target_at_rest(space, motion, axes):
    target = motion[2] * [1.3, 0.9, 1.1]
    moved = MotionTransfer(axes).solve(space, motion[[0, 0]], target)
    np.testing.assert_allclose(moved, [target, target], atol=1e-10)


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


def test_a_shift_of_the_source_shifts_what_takes_its_pose(space, motion):
    target = motion[2] * [1.3, 0.9, 1.1]
    path = [motion[1], motion[1] + [1.0, 2.0, 3.0]]
    moved = MotionTransfer(transfer="pose").solve(space, path, target)
    np.testing.assert_allclose(moved[1], moved[0] + [1.0, 2.0, 3.0], atol=1e-10)


def test_axes_of_the_body_turn_with_it(space, motion):
    turn = Rotation.from_rotvec([0.3, -1.1, 0.5]).as_matrix()
    target = motion[0] @ turn.T
    moved = MotionTransfer("body").solve(space, motion, target)
    expected = motion @ turn.T
    gap = moved - expected
    np.testing.assert_allclose(gap, gap.mean(axis=1, keepdims=True) + 0 * gap, atol=1e-10)


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


@pytest.mark.parametrize(
    ("sequence", "other"), [("punching", 3), ("jumping_jacks", 5), ("running_on_spot", 7)]
)
def test_nearer_to_the_models_own_motion_than_offsets(sequence, other):
    """Mean vertex error under half of that of adding the source's vertex offsets."""
    motions = load_open_motions("coarse", sequences=sequence)
    source = motions[0]
    frames = list(range(0, len(source), len(source) // 5))
    seen = np.stack([source[k] for k in frames])
    own = source.model(motions[other].betas, source.pose_vectors[frames])
    # Both stand on the ground as their own feet do.
    own += standing(source, motions[other].betas, frames)[:, None]
    moved = MotionTransfer().solve(bodies.space(), seen, own[0])
    offsets = own[0] + (seen - seen[0])
    errors = [np.linalg.norm(path - own, axis=-1).mean() for path in (moved, offsets)]
    assert errors[0] < 0.6 * errors[1]
    shapes = [
        np.linalg.norm(gap - gap.mean(axis=1, keepdims=True), axis=-1).mean()
        for gap in (moved - own, offsets - own)
    ]
    assert shapes[0] < 0.5 * shapes[1]


def standing(source, betas, frames):
    """Return translations by which another body's lower foot keeps its height."""
    names = source.model.joint_names
    feet = [name.endswith(("ankle", "toes")) for name in names]

    def lowest(coefficients):
        return source.model.joints(coefficients, source.pose_vectors[frames])[:, feet, 1].min(1)

    change = lowest(source.betas) - lowest(betas)
    shift = source.translations[frames].copy()
    shift[:, 1] += change - change[0]
    return shift


def test_shape_transfer_in_a_pose():
    before, after = bodies.body("resting"), bodies.body("other build")
    betas = np.random.default_rng(3).normal(size=(5, bodies.model().n_betas))
    pose = bodies.pose(left_hip=(-80, 0, 0), left_knee=(90, 0, 0))
    target, own = (bodies.model()(betas=betas[k], pose=pose) for k in (0, 1))
    moved = ShapeTransfer().solve(bodies.space(), before, after, target)

    def error(surface):
        gap = surface - own
        return np.linalg.norm(gap - gap.mean(axis=0), axis=-1).mean()

    assert error(moved) < 0.5 * error(target + after - before)
    assert error(moved) < 0.25 * error(target)
    np.testing.assert_allclose(moved.mean(axis=0), target.mean(axis=0), atol=1e-10)


def test_shape_transfer_in_the_same_pose_is_the_other_body():
    before, after = bodies.body("resting"), bodies.body("other build")
    moved = ShapeTransfer().solve(bodies.space(), before, after, before)
    np.testing.assert_allclose(moved - moved.mean(axis=0), after - after.mean(axis=0), atol=1e-10)


def test_reference_and_streams(space, motion):
    target = motion[1] * 1.2
    whole = MotionTransfer().solve(space, motion, target)
    later = MotionTransfer().solve(space, iter(motion[1:]), target, reference=motion[0])
    np.testing.assert_allclose(later, whole[1:], atol=1e-12)


def test_a_pose_or_its_change():
    """A target that starts with an arm raised lets it fall where poses are transferred."""
    source = [bodies.body("resting"), bodies.body("elbow bent")]
    target = bodies.body("arm raised")
    ends = {
        transfer: MotionTransfer(transfer=transfer).solve(bodies.space(), source, target)[1]
        for transfer in ("change", "pose")
    }
    centred = {name: end - end.mean(axis=0) for name, end in ends.items()}
    expected = source[1] - source[1].mean(axis=0)
    apart = {name: np.linalg.norm(end - expected, axis=1) for name, end in centred.items()}
    # The raised hand is some half a metre too high; joints that bend smoothly miss by little.
    assert apart["change"].max() > 0.3
    assert apart["pose"].mean() < 0.25 * apart["change"].mean()
    changed = np.linalg.norm(ends["pose"] - target, axis=1)
    assert changed.max() > 0.3


def test_bad_input(space, motion):
    with pytest.raises(ArgumentError, match="transfer must be one of 'change', 'pose'"):
        MotionTransfer(transfer="both")
    with pytest.raises(ArgumentError, match='axes must be "world" where transfer="pose"'):
        MotionTransfer("body", "pose")
    with pytest.raises(ArgumentError, match="reference must be left out"):
        MotionTransfer(transfer="pose").solve(space, motion, motion[0], reference=motion[1])
    with pytest.raises(ArgumentError, match="axes must be one of 'world', 'body'"):
        MotionTransfer("hip")
    with pytest.raises(ArgumentError, match="motion must have at least one frame; found none"):
        MotionTransfer().solve(space, [], motion[0])
    with pytest.raises(ArgumentError, match=r"motion\[1\] must have shape"):
        MotionTransfer().solve(space, [motion[0], motion[0][:5]], motion[0])
    with pytest.raises(ArgumentError, match="target must be one surface"):
        MotionTransfer().solve(space, motion, motion)
    with pytest.raises(DegenerateSurfaceError, match="triangle 0"):
        MotionTransfer().solve(space, motion, 0.0 * motion[0])
    with pytest.raises(ArgumentError, match="after holds 126 NaN"):
        ShapeTransfer().solve(space, motion[0], np.nan * motion[1], motion[2])


@pytest.mark.parametrize("size", [0.003, 0.01, 0.3])
def test_the_place_is_that_of_what_moves_less_than_a_centimetre(space, motion, size):
    """A stretched source of half the target's size: the target's own stretch is twice as large."""
    stretch = np.eye(3) + size * np.array([[1.0, 0.3, 0.0], [0.3, 0.5, 0.0], [0.0, 0.0, -0.4]])
    source = motion[0] + [0.1, 0.0, -0.2]
    moved = MotionTransfer().solve(space, [source, source @ stretch], 2.0 * source)[1]
    offsets = source @ stretch - source
    weights = space.template.vertex_areas / (0.01**2 + np.sum(offsets**2, axis=1))
    place = np.average(-offsets, axis=0, weights=weights)
    np.testing.assert_allclose(moved, 2.0 * source @ stretch + place, atol=1e-10)
