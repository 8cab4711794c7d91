"""The axes of recorded joints, found from the positions of joints.

The rotation of a recorded joint is known up to a constant rotation: files use any axes, and in
their rest poses people may stand in a T-pose or all bones may point the same way. Axes are
therefore taken from positions alone, so that files with the same positions and other axes give the
same body. In the body part that moves with a joint, the model's axes are the mean over frames of

- pelvis, chest: the line of hips or shoulders and the trunk, above all while the person stands
  upright (a pelvis leans less than a trunk that bends);
- head: the axes of the body in a standing rest pose, in which it looks ahead;
- hands, toes: the axes of forearm or foot, as in a standing rest pose, in which they are straight;
- collars, and heads and hands without such a rest pose: the axes of chest or forearm, because their
  positions tell nothing more;
- limbs: the bone, and the axis in which its knee or elbow bends;
- feet: a level sole, while they stand still; in the air the axes of the shank.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from riemhuman.arrays import Array, Booleans
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import LIMBS
from riemhuman.kernels.rotations import log, nearest_rotations, shortest_rotations, transpose
from riemhuman.kernels.surface import unit_vectors as unit
from riemhuman.mocap._joint_names import SIDES, model_joints
from riemhuman.mocap._recorded_skeletons import RecordedSkeleton, stands_on
from riemhuman.mocap._skeletons import (
    body_frame,
    bone,
    frame,
    has_bone,
    leg_length,
    pelvis_frame,
    trunk,
    turned_towards,
)

_VERTICAL = np.array([0.0, 1.0, 0.0])
# A knee or elbow shows its axis where it bends by more than this, degrees.
BENT = 15.0
# Bends, degrees, whose axis counts as much as that of a limb that is not rotated about itself.
_TRUSTED_LEG, _TRUSTED_ARM = 35.0, 20.0
# Level feet on the floor in this share of frames show which direction is across.
_LEVEL_FEET = 0.02
# Feet whose toes point down by this many degrees more than at rest have raised heels.
_HEEL_RAISED = 15.0
# Largest mean rotation of a part, from where it is at rest, that a rest pose may imply.
_MOST_DEVIATION = np.radians(40.0)
# Share of frames in which nobody stands upright, beside those in which someone does.
_BENT_POSTURE = 0.02


@dataclass(frozen=True, eq=False)
class Figure:
    """A person of a model in the rest pose; the columns of its frame point up, left and back."""

    model: BodyModel
    betas: Array
    joints: dict[str, int]
    rest: Array
    leg: float
    frame: Array

    def bone(self, first: str, second: str) -> Array:
        """Return the vector between two joints in the rest pose."""
        return bone(self.rest, self.joints, first, second)


def make_figure(model: BodyModel, betas: Array) -> Figure:
    """Return a person of a model."""
    joints, rest = model_joints(model), model.joints(betas)
    across = bone(rest, joints, "right_hip", "left_hip")
    axes = frame(trunk(rest, joints), across)
    return Figure(model, betas, joints, rest, leg_length(rest, joints), axes)


def joint_axes(source: RecordedSkeleton, figure: Figure) -> dict[str, Array]:
    """Return the constant rotations of parts, by names of joints, shape (3, 3) each.

    The part of the model is rotated in space by R(t) C, where R(t) is the recorded rotation.
    """
    upright = _upright_weights(source)
    axes = {
        name: mean_axes(source.rotation(name), shown_rotations(source, figure, name), upright)
        for name in ("pelvis", "chest")
    }
    pelvis, chest = (source.rotation(name) @ axes[name] for name in ("pelvis", "chest"))
    if "head" in source.joints:
        axes["head"] = _axes_of_head(source, figure, chest, upright)
    for side in SIDES:
        collar = f"{side}_collar"
        if collar in source.joints and collar in figure.joints:
            lowered = upright * _lowered_arms(source, side)
            axes[collar] = mean_axes(source.rotation(collar), chest, lowered)
    for limb in LIMBS:
        is_leg = limb[0].endswith("hip")
        axes |= _axes_of_limb(source, figure, limb, pelvis if is_leg else chest)
        if is_leg:
            axes |= _axes_of_foot(source, figure, limb[0].split("_")[0], axes)
        else:
            forearm = source.rotation(limb[1]) @ axes[limb[1]]
            on_average = mean_axes(source.rotation(limb[2]), forearm, source.is_valid)
            axes[limb[2]] = _axes_at_rest(source, axes[limb[1]], on_average)
    return axes


def _axes_of_head(source: RecordedSkeleton, figure: Figure, chest: Array, upright: Array) -> Array:
    """Return the axes of the head, which looks ahead in the rest pose, or else on average."""
    on_average = mean_axes(source.rotation("head"), chest, upright)
    if source.standing_axes is None:
        return on_average
    ahead = frame(_VERTICAL, figure.bone("right_hip", "left_hip"))
    return _axes_at_rest(source, source.standing_axes @ ahead.T, on_average)


def _axes_at_rest(source: RecordedSkeleton, at_rest: Array, on_average: Array) -> Array:
    """Return the axes of a part in a standing rest pose, or those on average if it has none."""
    if source.standing_axes is None:
        return on_average
    # Nobody holds a part like that throughout: joints have other axes than in the rest pose.
    is_rest = np.linalg.norm(log(on_average, at_rest)) < _MOST_DEVIATION
    return at_rest if is_rest else on_average


def mean_axes(rotations: Array, targets: Array, weights: Array | Booleans) -> Array:
    """Return the rotation C for which rotations times C are nearest to the targets on average."""
    products = transpose(rotations) @ targets
    total = np.einsum("n,nij->ij", weights, products) / weights.sum()
    return np.asarray(nearest_rotations(total))


def _mean_vector(
    rotations: Array, vectors: Array, weights: Array | Booleans | None = None
) -> Array:
    """Return the mean of vectors in space in the axes of a joint, by default of equal weights."""
    local = np.einsum("nji,nj->ni", rotations, vectors)
    return np.asarray(np.average(local, axis=0, weights=weights))


def _upright_weights(source: RecordedSkeleton) -> Array:
    """Return weights of frames, the larger the more thighs and trunk are in one line."""
    back = unit(trunk(source.positions, source.joints))
    straight = np.ones(len(back))
    for side in SIDES:
        thigh = unit(bone(source.positions, source.joints, f"{side}_hip", f"{side}_knee"))
        straight *= np.clip(-np.sum(thigh * back, axis=1), 0.0, 1.0) ** 2
    return np.asarray(source.is_valid * (_BENT_POSTURE + straight))


def _lowered_arms(source: RecordedSkeleton, side: str) -> Array:
    """Return weights of frames, the larger the lower an arm is."""
    back = unit(trunk(source.positions, source.joints))
    arm = unit(bone(source.positions, source.joints, f"{side}_shoulder", f"{side}_elbow"))
    return np.asarray(_BENT_POSTURE + np.clip(0.3 - np.sum(arm * back, axis=1), 0.0, 1.0))


def shown_rotations(source: RecordedSkeleton, figure: Figure, name: str) -> Array:
    """Return the rotations of pelvis or chest in space that positions of joints show."""
    if name == "pelvis":
        recorded = pelvis_frame(source.positions, source.joints)
        rest = pelvis_frame(figure.rest, figure.joints)
    else:
        recorded = body_frame(source.positions, source.joints, "shoulder")
        rest = body_frame(figure.rest, figure.joints, "shoulder")
    if name in source.upright:
        # Both stand upright at rest, however their joints are placed.
        recorded = recorded @ source.upright[name]
        line = "hip" if name == "pelvis" else "shoulder"
        rest = frame(figure.bone(f"right_{line}", f"left_{line}"), _VERTICAL)
    return np.asarray(recorded @ rest.T)


def _axes_of_limb(
    source: RecordedSkeleton, figure: Figure, limb: tuple[str, ...], above: Array
) -> dict[str, Array]:
    """Return the axes of both bones of a limb, below a part that is rotated in space."""
    hinge = figure_hinge(figure, limb)
    upper, lower = (
        unit(bone(source.positions, source.joints, *pair)) for pair in (limb[:2], limb[1:])
    )
    rotations = [source.rotation(name) for name in limb[:2]]
    # As if the limb had been raised without being rotated about itself.
    raised = turned_towards(above, figure.bone(*limb[:2]), upper) @ hinge
    upper_hinge = unit(_mean_vector(rotations[0], raised, source.is_valid))
    lower_hinge = unit(_mean_vector(rotations[1], rotations[0] @ upper_hinge, source.is_valid))
    bends = np.cross(upper, lower)
    upper_bend = _bending_axis(rotations[0], bends, source.is_valid)
    lower_bend = _bending_axis(rotations[1], bends, source.is_valid)
    if upper_bend is not None and lower_bend is not None:
        # Where a limb bends little, the axis is that of a crooked limb rather than of its joint.
        trusted = _TRUSTED_LEG if limb[0].endswith("hip") else _TRUSTED_ARM
        largest = np.linalg.norm(source.is_valid[:, None] * bends, axis=1).max() ** 4
        share = largest / (largest + np.sin(np.radians(trusted)) ** 4)
        upper_hinge = unit(share * upper_bend + (1.0 - share) * upper_hinge)
        lower_hinge = unit(share * lower_bend + (1.0 - share) * lower_hinge)
    axes = {}
    for pair, rotation, direction, axis in zip(
        (limb[:2], limb[1:]), rotations, (upper, lower), (upper_hinge, lower_hinge), strict=True
    ):
        local = _mean_vector(rotation, direction, source.is_valid)
        axes[pair[0]] = frame(local, axis) @ frame(figure.bone(*pair), hinge).T
    return axes


def _bending_axis(rotations: Array, bends: Array, is_valid: Booleans) -> Array | None:
    """Return the axis in which a knee or elbow bends, in the axes of one of its bones."""
    sines = is_valid * np.linalg.norm(bends, axis=1)
    # Squares weight the frames in which the joint bends most.
    mean = _mean_vector(rotations, sines[:, None] * bends)
    if sines.max() < np.sin(np.radians(BENT)) or not mean @ mean > 0.25 * np.mean(sines**2) ** 2:
        return None
    return unit(mean)


def figure_hinge(figure: Figure, limb: tuple[str, ...]) -> Array:
    """Return the axis in which a knee or elbow of the model bends, in the rest pose."""
    upper, lower = unit(figure.bone(*limb[:2])), unit(figure.bone(*limb[1:]))
    axis = np.cross(upper, lower)
    if np.linalg.norm(axis) > np.sin(np.radians(BENT)):
        return unit(axis)
    left = figure.frame[:, 1]
    if limb[0].endswith("hip"):
        return np.asarray(left)
    # With arms straight to the sides, elbows bend forward.
    outward = left if limb[0].startswith("left") else -left
    return np.asarray(shortest_rotations(outward, upper) @ np.cross(outward, -figure.frame[:, 2]))


def _axes_of_foot(
    source: RecordedSkeleton, figure: Figure, side: str, axes: Mapping[str, Array]
) -> dict[str, Array]:
    """Return the axes of a foot and its toes."""
    knee, ankle, toes = (f"{side}_{part}" for part in ("knee", "ankle", "toes"))
    rotations = source.rotation(ankle)
    flat = source.flat[:, SIDES.index(side)]
    up = figure.frame[:, 0]
    shank = source.rotation(knee) @ axes[knee]
    if toes not in source.joints or not has_bone(figure.rest, figure.joints, ankle, toes):
        weights = flat if flat.any() else source.is_valid
        level = turned_towards(shank, up, _VERTICAL) if flat.any() else shank
        return {ankle: mean_axes(rotations, level, weights)}
    foot, toes_on_average = _axes_by_floor(source, figure, side, shank)
    return {ankle: foot, toes: _axes_at_rest(source, foot, toes_on_average)}


def _axes_by_floor(
    source: RecordedSkeleton, figure: Figure, side: str, shank: Array
) -> tuple[Array, Array]:
    """Return the axes of a foot and its toes, by the frames in which they are on the floor."""
    names = f"{side}_ankle", f"{side}_toes"
    directions = unit(bone(source.positions, source.joints, *names))
    rest, up, left = figure.bone(*names), figure.frame[:, 0], figure.frame[:, 1]
    rotations, toe_rotations = (source.rotation(name) for name in names)
    sole = frame(_VERTICAL, directions) @ frame(up, rest).T
    # People who stand still on the balls of their feet do not have level soles.
    steepest = np.arcsin(-unit(rest) @ up) + np.radians(_HEEL_RAISED)
    is_level = np.arcsin(np.clip(-directions[:, 1], -1.0, 1.0)) < steepest
    flat = source.flat[:, SIDES.index(side)] & is_level
    if flat.any():
        # Soles are level in the mean over frames in which the foot stands still.
        return mean_axes(rotations, sole, flat), mean_axes(toe_rotations, sole, flat)
    horizontal = 1.0 - directions[:, 1] ** 2
    # Balls on the floor are level across, more so the less the toes point down; toes lie on it.
    standing = source.grounded & stands_on(source.positions, source.joints)
    grounded = standing[:, SIDES.index(side)] * horizontal
    if grounded.mean() > _LEVEL_FEET:
        foot = frame(directions, _VERTICAL) @ frame(rest, up).T
        return mean_axes(rotations, foot, grounded), mean_axes(toe_rotations, sole, grounded)
    # Feet in the air are turned about themselves as their knees are, and toes bend where they
    # point down.
    foot = frame(directions, shank @ left) @ frame(rest, left).T
    foot_axes = mean_axes(rotations, foot, source.is_valid)
    straight = source.is_valid * (_BENT_POSTURE + horizontal**2)
    return foot_axes, mean_axes(toe_rotations, rotations @ foot_axes, straight)
