"""The performer of a recording: a person with its bones, of its size, or of the model."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

import numpy as np

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel
from riemhuman.mocap._joint_names import BONES, model_joints
from riemhuman.mocap._skeletons import bones, leg_length
from riemhuman.mocap.skeleton_motion import SkeletonMotion

# Standard deviation of recorded bones about those of a person of the model, in lengths of the leg.
_LENGTH_DEVIATION = 0.01
# Standard deviation of legs about the mean leg, as a share of it: the unit may be unknown.
_LEG_DEVIATION = 0.03
# Largest shape coefficient.
_MOST_BETA = 2.5
# Lengths by which a person is found, besides that of the trunk.
_LENGTHS = (*BONES, ("left_shoulder", "right_shoulder"), ("left_hip", "right_hip"))
# A skeleton is one of the model's if its bones are this near to those of one of its people, metres.
_OWN_BONES = 2e-5
# Metres in the units that writers use.
_OWN_UNITS = (1.0, 0.01, 0.001)
_SMALLEST, _LARGEST = 0.2, 5.0
# Sizes nearer to 1 than this become 1.
_SAME_SIZE = 1e-6


class OwnPerson(NamedTuple):
    """A person of the model whose skeleton a file holds.

    Metres are those in the file's unit; the person may be larger than the model's by `size`.
    """

    betas: Array
    size: float
    metres: float
    joints: list[int]  # numbers of the model's joints in the file


def recorded_person(positions: Array, joints: Mapping[str, int], model: BodyModel) -> Array:
    """Return the shape coefficients of a person whose bones have the recorded proportions."""
    from scipy.optimize import least_squares  # takes long to import

    lengths = np.linalg.norm(bones(positions, joints, _LENGTHS), axis=-1)
    recorded = np.median(lengths, axis=0) / leg_length(positions, joints)
    mean, joint_numbers = model.joints(), model_joints(model)
    changes = np.tensordot(model.joint_regressor, model.shapedirs, axes=1)
    mean_leg = leg_length(mean, joint_numbers)

    def residuals(betas: Array) -> Array:
        rest = mean + changes @ betas
        leg = leg_length(rest, joint_numbers)
        apart = np.linalg.norm(bones(rest, joint_numbers, _LENGTHS), axis=1) / leg - recorded
        taller = leg / mean_leg - 1.0
        return np.concatenate([apart / _LENGTH_DEVIATION, [taller / _LEG_DEVIATION], betas])

    start = np.zeros(model.n_betas)
    return np.asarray(least_squares(residuals, start, bounds=(-_MOST_BETA, _MOST_BETA)).x)


def scaled_model(model: BodyModel, scale: float) -> BodyModel:
    """Return a model whose bodies are larger by a factor."""
    posedirs = None if model.posedirs is None else scale * model.posedirs
    return BodyModel(
        scale * model.template.vertices,
        model.faces,
        scale * model.shapedirs,
        model.joint_regressor,
        model.weights,
        np.stack([model.parents, np.arange(model.n_joints)]),
        posedirs=posedirs,
        joint_names=model.joint_names,
        hand_directions=scale * model.hand_directions,
        hand_poses=model.hand_poses,
    )


def own_person(recording: SkeletonMotion, model: BodyModel) -> OwnPerson | None:
    """Return the person whose skeleton a recording holds, if it is a skeleton of the model."""
    names = list(recording.joint_names)
    if not set(model.joint_names) <= set(names):
        return None
    joints = [names.index(name) for name in model.joint_names]
    limbs = np.flatnonzero(model.parents >= 0)
    root = model.joint_order[0]
    parents = recording.parents[joints]
    if parents[root] >= 0 or any(
        parents[limb] != joints[model.parents[limb]] for limb in limbs.tolist()
    ):
        return None
    offsets = recording.offsets[joints][limbs]
    moved = recording.translations[:, joints][:, limbs] - offsets
    mean = model.joints()
    changes = np.tensordot(model.joint_regressor, model.shapedirs, axes=1)
    mean_bones, bone_changes = (
        (values[limbs] - values[model.parents[limbs]]).reshape(3 * len(limbs), -1)
        for values in (mean, changes)
    )
    for is_scaled, metres in product((False, True), _OWN_UNITS):
        recorded_bones = metres * offsets.ravel()
        size, betas = _fitted_bones(recorded_bones, mean_bones, bone_changes, is_scaled)
        fitted_bones = size * (mean_bones[:, 0] + bone_changes @ betas)
        residual = np.abs(fitted_bones - recorded_bones).max()
        is_own = max(residual, metres * np.abs(moved).max()) < _OWN_BONES
        if is_own and _SMALLEST < size < _LARGEST:
            return OwnPerson(betas, size, metres, joints)
    return None


def model_of_size(model: BodyModel, betas: Array, rest: Array) -> BodyModel:
    """Return a model scaled so that a person of it has these joints in the rest pose."""
    joints = model.joints(betas)
    size = float(np.sum(rest * joints) / np.sum(joints**2))
    is_larger = size > 0.0 and abs(size - 1.0) > _SAME_SIZE
    return scaled_model(model, size) if is_larger else model


def _fitted_bones(
    recorded_bones: Array, mean_bones: Array, bone_changes: Array, is_scaled: bool
) -> tuple[float, Array]:
    """Return the size, or 1, and the coefficients with bones nearest to the recorded ones."""
    if not is_scaled:
        differences = recorded_bones - mean_bones[:, 0]
        return 1.0, np.asarray(np.linalg.lstsq(bone_changes, differences, rcond=None)[0])
    columns = np.hstack([mean_bones, bone_changes])
    products = np.linalg.lstsq(columns, recorded_bones, rcond=None)[0]
    size = float(products[0]) or 1.0
    return size, np.asarray(products[1:] / size)
