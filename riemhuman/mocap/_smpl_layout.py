"""Poses in the joint order of SMPL's family, and a skeleton by which other models perform them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.arrays import Array
from riemhuman.bodies import BodyModel
from riemhuman.bodies.skinning import SMPL_JOINTS, SMPL_PARENTS
from riemhuman.errors import ArgumentError, warn
from riemhuman.mocap._joint_names import SIDES
from riemhuman.mocap._skeletons import leg_length, middle
from riemhuman.mocap._units import metres_in
from riemhuman.mocap._upward import Convention, upward_axis
from riemhuman.mocap.skeleton_motion import SkeletonMotion
from riemhuman.surfaces.procrustes import make_upright

# All models of SMPL's family begin with the joints of its body.
N_BODY = len(SMPL_JOINTS)
_FACE = 3
N_HANDS = 30
# Offsets from the parents in SMPL's rest pose, of about the mean person, centimetres.
_BODY_OFFSETS = (
    *((0, -22, 3), (7, -9, -1), (-7, -9, -1), (0, 11, -3), (3, -38, 0), (-3, -38, 0), (0, 14, 0)),
    *((-1, -40, -4), (1, -40, -4), (0, 5, 3), (3, -6, 12), (-3, -6, 12), (0, 21, -4), (8, 12, -4)),
    *((-8, 12, -4), (0, 7, 5), (9, 3, -1), (-9, 3, -1), (26, -1, -3), (-26, -1, -3), (25, 1, 0)),
    (-25, 1, 0),
)
# Nobody moves farther than this in a second, and than this in no time, as methods that watch videos
# may have it; metres.
_FASTEST, _JUMP = 15.0, 2.0
# If feet slide faster than the first of these, metres per second, and in another unit stand within
# the second, translations may be in that unit.
_SLIDING, _STANDING_STILL = 3.0, 0.3
_UNITS = ("centimetres", "millimetres", "inches", "feet")
# Frames, and parts of a second, in which feet are watched.
_FRAMES_WATCHED, _WATCHED = 300, 0.1
# Rotation vectors of joints longer than this, radians, are in degrees.
_MOST_RADIANS = 2.0 * np.pi
# To find the length of the legs, feet slower than this count as standing, metres per second.
_STANDING = 0.4
# Number of frames from which the axis that points up is found.
_FRAMES_OF_FLOOR = 300
LAYOUTS = {
    N_BODY: ("body",),
    N_BODY + 2: ("body", "fists"),
    N_BODY + N_HANDS: ("body", "hands"),
    N_BODY + _FACE + N_HANDS: ("body", "face", "hands"),
}
"""Parts of the joints of a file or a model, by the number of joints."""
_SIZES = {"body": N_BODY, "fists": 2, "face": _FACE, "hands": N_HANDS}


def is_smpl(model: BodyModel) -> bool:
    """Return whether a model has the joints of SMPL's family."""
    return model.n_joints in LAYOUTS and tuple(model.parents[:N_BODY]) == SMPL_PARENTS


def poses_of_model(poses: Array, n_joints: int) -> Array:
    """Return the rotations of a model's joints from those of a file's joints."""
    parts, start = {}, 0
    for part in LAYOUTS[poses.shape[1]]:
        parts[part] = poses[:, start : start + _SIZES[part]]
        start += _SIZES[part]
    zero = {part: np.zeros((len(poses), size, 3)) for part, size in _SIZES.items()}
    return np.concatenate([parts.get(part, zero[part]) for part in LAYOUTS[n_joints]], axis=1)


def model_parameters(
    model: BodyModel, betas: Array, poses: Array, translations: Array, up: str
) -> tuple[Array, Array]:
    """Return poses of a model, and translations, that put its bodies y up instead of along `up`.

    Poses rotate the root about itself, but a rotation of space also moves it.
    """
    root = model.joints(betas)[0]
    turned = poses_of_model(poses, model.n_joints)
    upright = Rotation.from_matrix(make_upright(np.eye(3), up=up).T)
    turned[:, 0] = (upright * Rotation.from_rotvec(turned[:, 0])).as_rotvec()
    return turned, make_upright(translations + root, up=up) - root


def model_betas(betas: Array, model: BodyModel) -> Array:
    """Return coefficients of a model; those missing are zero."""
    return np.pad(betas[: model.n_betas], (0, max(0, model.n_betas - len(betas))))


def smpl_offsets() -> Array:
    """Return SMPL's joints relative to their parents in about the mean person, the root at 0."""
    offsets = 0.01 * np.array(_BODY_OFFSETS, dtype=np.float64)
    offsets[0] = 0.0
    return offsets


def body_skeleton(poses: Array, translations: Array, rate: float, name: str) -> SkeletonMotion:
    """Return the joints of SMPL's body, of about the mean person, in poses (T, joints, 3)."""
    n_frames = len(poses)
    rotations = Rotation.from_rotvec(poses[:, :N_BODY].reshape(-1, 3)).as_matrix()
    offsets = smpl_offsets()
    steps = np.tile(offsets, (n_frames, 1, 1))
    steps[:, 0] = translations
    rotations = rotations.reshape(n_frames, N_BODY, 3, 3)
    return SkeletonMotion(
        SMPL_JOINTS, np.array(SMPL_PARENTS), offsets, rotations, steps, rate, name
    )


def smpl_skeleton(
    poses: Array, translations: Array, rate: float, name: str, up: str
) -> SkeletonMotion:
    """Return the joints of SMPL's body in poses (T, joints, 3).

    The legs have the length with which standing feet slide least.
    """
    motion = body_skeleton(poses, translations, rate, name)
    offsets, steps = motion.offsets, motion.translations.copy()
    scale = _leg_scale(motion, up)
    steps[:, 1:] *= scale
    return replace(motion, offsets=scale * offsets, translations=steps)


def _leg_scale(motion: SkeletonMotion, up: str) -> float:
    """Return the scale of the skeleton at which standing feet move least along the floor."""
    scale = 1.0
    if len(motion) < 2:
        return scale
    level = [number for number, axis in enumerate("xyz") if axis != up.removeprefix("-")]
    toes = [SMPL_JOINTS.index("left_toes"), SMPL_JOINTS.index("right_toes")]
    root = motion.positions[:, :1]
    swings = np.diff(motion.positions[:, toes] - root, axis=0)[..., level]
    steps = motion.frames_per_second * swings
    moved = motion.frames_per_second * np.diff(root, axis=0)[..., level]
    for _ in range(4):
        standing = np.linalg.norm(moved + scale * steps, axis=-1, keepdims=True) < _STANDING
        squares = np.sum(standing * steps**2)
        # Without walking, nothing is known about the length of the legs.
        if squares < 1e-2 * len(motion):
            return 1.0
        scale = float(np.clip(-np.sum(standing * steps * moved) / squares, 0.75, 1.3))
    return scale


def check_units(poses: Array, places: Array, rate: float, unit: str | float | None) -> Array:
    """Return translations in metres, after checks that a person may move so.

    `unit` is that of the translations, as the user says; by default they must be in metres.
    """
    angles = np.linalg.norm(poses[:, 1:], axis=-1).max(axis=1, initial=0.0)
    if np.median(angles) > _MOST_RADIANS:
        raise ArgumentError(
            "poses must be rotation vectors in radians; joints turn by "
            f"{np.median(angles):.3g}, as if in degrees"
        )
    if unit is not None:
        return np.asarray(metres_in(unit) * places)
    lag = min(len(places) - 1, max(1, round(rate)))
    if lag < 1:
        return places
    seconds = lag / rate
    moved = float(np.percentile(np.linalg.norm(places[lag:] - places[:-lag], axis=1), 95.0))
    sliding = {name: _sliding(poses, places, rate, metres_in(name)) for name in ("metres", *_UNITS)}
    likely = min(sliding, key=lambda name: sliding[name])
    remedy = f"pass unit={likely!r}, or unit='metres' if they are right"
    if moved > _JUMP + _FASTEST * seconds:
        raise ArgumentError(
            f"translations must be in metres; the person moves {moved:.4g} m in {seconds:.3g} s, "
            f"as if they were in {likely}: {remedy}"
        )
    if sliding["metres"] > _SLIDING and sliding[likely] < _STANDING_STILL:
        warn(
            f"feet slide at {sliding['metres']:.2g} m/s, and at {sliding[likely]:.2g} m/s if "
            f"translations are in {likely}: {remedy}",
            UserWarning,
        )
    return places


def _sliding(poses: Array, places: Array, rate: float, metres: float) -> float:
    """Return the usual speed of the slower foot, metres per second, in a unit of translations."""
    lag = min(len(places) - 1, max(1, round(_WATCHED * rate)))
    first = np.unique(np.linspace(0, len(places) - 1 - lag, _FRAMES_WATCHED).astype(np.int64))
    frames = np.concatenate([first, first + lag])
    motion = body_skeleton(poses[frames], metres * places[frames], rate, "")
    ankles = motion.positions[:, [SMPL_JOINTS.index(f"{side}_ankle") for side in SIDES]]
    moved = np.linalg.norm(ankles[len(first) :] - ankles[: len(first)], axis=-1)
    return float(np.median(moved.min(axis=1))) * rate / lag


def smpl_upward_axes(poses: Array, translations: Array, convention: Convention) -> tuple[str, str]:
    """Return the axis that points up, and another one if it may be that as well, or ""."""
    frames = np.unique(np.linspace(0, len(poses) - 1, _FRAMES_OF_FLOOR).astype(np.int64))
    # Translations omit where the root is in the rest pose.
    places = translations[frames] + 0.01 * np.array(_BODY_OFFSETS[0], dtype=np.float64)
    motion = body_skeleton(poses[frames], places, 1.0, "")
    joints = dict(zip(SMPL_JOINTS, range(len(SMPL_JOINTS)), strict=True))
    shoulders, ankles = (middle(motion.positions, joints, part) for part in ("shoulder", "ankle"))
    leg = leg_length(motion.positions, joints)
    return upward_axis(motion.positions, shoulders - ankles, leg, convention=convention)
