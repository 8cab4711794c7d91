"""Skinning vertex by vertex against the dense product of weights and motions, and derivatives."""

import autograd
import autograd.numpy as anp
import numpy as np
import pytest

from riemhuman.bodies import joint_motions, joints_between, rotation_matrix, skin_surface
from riemhuman.bodies.skinning import JointMotions, Skeleton, skinning_derivatives
from riemhuman.datasets import load_open_model
from riemhuman.errors import ArgumentError, RiemhumanError

N_VERTICES, N_JOINTS = 11, 6


def dense(surface, weights, joints, rotations, positions):
    """Return Σ_j w_vj (R_j (x_v − J_j) + p_j), all joints for every vertex."""
    levers = surface[..., :, None, :] - joints[..., None, :, :]
    turned = anp.matmul(rotations[..., None, :, :, :], levers[..., None])[..., 0]
    return anp.sum(weights[..., None] * (turned + positions[..., None, :, :]), axis=-2)


def some_weights(n_followed, rng):
    """Return weights of which so many are not zero at each vertex."""
    weights = rng.uniform(0.1, 1.0, size=(N_VERTICES, N_JOINTS))
    ranks = rng.permuted(np.tile(np.arange(N_JOINTS), (N_VERTICES, 1)), axis=1)
    weights[ranks >= n_followed] = 0.0
    return weights / weights.sum(axis=1, keepdims=True)


def arguments(n_followed=3, leads=((), (), (), ())):
    rng = np.random.default_rng(21)
    of_surface, of_joints, of_rotations, of_positions = leads
    return (
        rng.normal(size=(*of_surface, N_VERTICES, 3)),
        some_weights(n_followed, rng),
        rng.normal(size=(*of_joints, N_JOINTS, 3)),
        rotation_matrix(rng.normal(size=(*of_rotations, N_JOINTS, 3))),
        rng.normal(size=(*of_positions, N_JOINTS, 3)),
    )


@pytest.mark.parametrize(
    ("n_followed", "leads"),
    [
        (1, ((), (), (), ())),
        (4, ((2, 3),) * 4),
        (4, ((3,), (), (2, 1), (2, 1))),
        (N_JOINTS, ((), (), (3,), (3,))),
    ],
)
def test_agrees_with_dense_weights(n_followed, leads):
    given = arguments(n_followed, leads)
    found, expected = skin_surface(*given), dense(*given)
    assert found.shape == expected.shape
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)


def test_agrees_with_dense_weights_on_the_open_model():
    model, rng = load_open_model("coarse"), np.random.default_rng(22)
    betas = rng.normal(size=(3, model.n_betas))
    rotations = rotation_matrix(rng.normal(scale=0.5, size=(3, model.n_joints, 3)))
    joints, surface = model.joints(betas), model(betas)
    np.testing.assert_allclose(joints, model.joint_regressor @ surface, rtol=0, atol=1e-14)
    motions = joint_motions(joints, rotations, model.parents)
    expected = dense(surface, model.weights, joints, *motions)
    found = skin_surface(surface, model.weights, joints, *motions)
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-15)
    # The bits of a body do not depend on the bodies beside it.
    alone = [a[1] for a in (joints, *motions)]
    np.testing.assert_array_equal(found[1], skin_surface(surface[1], model.weights, *alone))


def test_a_vertex_without_weights_goes_to_the_origin():
    surface, weights, *motions = arguments()
    weights[4] = 0.0
    assert not skin_surface(surface, weights, *motions)[4].any()


@pytest.mark.parametrize("number", range(5))
def test_derivatives_agree_with_those_of_dense_weights(number):
    given = arguments(3, ((3,), (), (2, 1), (2, 1)))
    scales = np.random.default_rng(23).normal(size=dense(*given).shape)

    def slope(skin):
        return autograd.grad(lambda *a: anp.sum(scales * skin(*a) ** 2), number)

    np.testing.assert_allclose(slope(skin_surface)(*given), slope(dense)(*given), atol=1e-12)

    # The derivative of the slope along a direction, again by every argument.
    direction = np.random.default_rng(24).normal(size=given[number].shape)
    for other in range(5):
        second, expected = (
            autograd.grad(lambda *a, s=skin: anp.sum(direction * slope(s)(*a)), other)(*given)
            for skin in (skin_surface, dense)
        )
        np.testing.assert_allclose(second, expected, atol=1e-11)


@pytest.mark.parametrize("number", range(5))
def test_derivatives_along_a_direction(number):
    given = arguments()
    direction = np.random.default_rng(25).normal(size=given[number].shape)
    found, expected = (
        autograd.make_jvp(skin, number)(*given)(direction)[1] for skin in (skin_surface, dense)
    )
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_derivatives_by_rotations_betas_and_translation_are_those_of_the_definition():
    model, rng = load_open_model("coarse"), np.random.default_rng(6)
    skeleton, chosen = Skeleton(model, with_hands=True), np.arange(0, model.n_vertices, 40)
    rotations = rotation_matrix(0.4 * rng.standard_normal((model.n_joints, 3)))
    motions = JointMotions(skeleton, rotations, rng.standard_normal(skeleton.n_betas))
    weights, directions = model.weights[chosen], skeleton.directions[chosen]
    rest = model.template.vertices[chosen]
    shaped, blended, _ = motions.skin(rest, directions, None, weights)
    # For every point and joint, the sum of the motions by all joints below it, from its place.
    places = np.einsum("jxy,ny->njx", motions.rotations, shaped) + motions.shifts
    levers = np.einsum("nk,kj,nkx->njx", weights, skeleton.below, places)
    levers -= np.einsum("nk,kj,jx->njx", weights, skeleton.below, motions.positions)
    by_rotations = np.cross(np.eye(3), levers[:, :, np.newaxis])
    shapes = motions.shift_shapes.reshape(model.n_joints, 3, -1)
    by_betas = blended @ directions + np.einsum("nj,jxb->nxb", weights, shapes)
    by_trans = np.broadcast_to(np.eye(3), (len(chosen), 3, 3))
    turned = by_rotations.transpose(0, 3, 2, 1).reshape(len(chosen), 3, -1)
    expected = np.concatenate([turned, by_betas, by_trans], axis=2)
    arguments = motions, shaped, blended, weights, directions, skeleton.below
    derivatives = skinning_derivatives(*arguments)
    np.testing.assert_allclose(derivatives, expected, rtol=1e-10, atol=1e-12)
    single = skinning_derivatives(*arguments, real=np.float32)
    np.testing.assert_array_equal(single, derivatives.astype(np.float32))


@pytest.mark.parametrize(
    "parents", [[1, 0], [-1, 1], [-1, 5], [], [-1, 0.5]],
    ids=["a cycle", "its own parent", "a parent that is missing", "no joint", "fractions"],
)  # fmt: skip
def test_joints_that_are_no_tree_are_refused(parents):
    with pytest.raises(RiemhumanError, match="parents"):
        joint_motions(np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), parents)


def test_paths_between_joints_and_arrays_of_other_joints():
    assert joints_between([-1, 0, 1, 0], 2, 3) == [2, 1, 0, 3]
    joints, still = np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1))
    for arguments, name in (((joints[:1], still), "joints"), ((joints, joints), "rotations")):
        with pytest.raises(ArgumentError, match=rf"{name} must have shape \(..., 2, 3"):
            joint_motions(*arguments, [-1, 0])
