"""Recordings of the open model's people, and recordings changed so that the truth stays known."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from riemhuman.bodies import joint_motions, rotation_matrix
from riemhuman.datasets import ArrayMotion, SkeletonMotion, load_open_motions

RECORDING = Path(__file__).parents[1] / "mocap" / "recordings" / "cmu_01_01.bvh"


def recording_of(model, betas, poses, translations, rate=30.0, name="{}_jnt"):
    """Return the skeleton of a person of a model; with "{}" as name it is that of the model."""
    rest = model.joints(betas)
    offsets = rest.copy()
    limbs = model.parents >= 0
    offsets[limbs] -= rest[model.parents[limbs]]
    moved = np.tile(offsets, (len(poses), 1, 1))
    moved[:, ~limbs] += translations[:, None]
    names = tuple(name.format(joint) for joint in model.joint_names)
    rotations = rotation_matrix(poses)
    return SkeletonMotion(names, np.array(model.parents), offsets, rotations, moved, rate, "person")


def with_axes(recording, axes):
    """Return a recording whose joints have other axes, shape (J, 3, 3), and the same positions."""
    above = np.where(
        (recording.parents >= 0)[:, None, None],
        np.swapaxes(axes, -1, -2)[recording.parents],
        np.eye(3),
    )
    return replace(
        recording,
        rotations=above @ recording.rotations @ axes,
        translations=(above @ recording.translations[..., None])[..., 0],
        offsets=(above @ recording.offsets[..., None])[..., 0],
    )


def turned(recording, rotation, shift=(0.0, 0.0, 0.0)):
    """Return a recording rotated about the origin, and then moved."""
    rotations, translations = recording.rotations.copy(), recording.translations.copy()
    rotations[:, 0] = rotation.as_matrix() @ rotations[:, 0]
    translations[:, 0] = rotation.apply(translations[:, 0]) + shift
    return replace(recording, rotations=rotations, translations=translations)


def lying(recording, tilt, heading, height=0.0):
    """Return a recording laid down on a floor, with its lowest points at a height."""
    rotation = Rotation.from_euler("y", heading, degrees=True)
    rotation = rotation * Rotation.from_euler("x", tilt, degrees=True)
    laid = turned(recording, rotation)
    lowest = np.percentile(laid.positions[..., 1].min(axis=1), 1.0)
    return turned(recording, rotation, (0.0, height - lowest, 0.0))


def scaled(recording, factor):
    """Return a recording with other lengths."""
    return replace(
        recording,
        offsets=factor * recording.offsets,
        translations=factor * recording.translations,
    )


def joint_paths(motion):
    """Return the joints of the person of a motion over time, (n_frames, 3) each, by name."""
    positions = motion.model.joints(motion.betas, motion.pose_vectors)
    positions = positions + motion.translations[:, None]
    return dict(zip(motion.model.joint_names, np.moveaxis(positions, 1, 0), strict=True))


def joints_in_space(model, betas, pose_vectors):
    """Return rotations of joints in space, and their places; the root stays where it rests."""
    rest = model.joints(betas)
    return joint_motions(rest, rotation_matrix(pose_vectors), model.parents)


@cache
def seven_frames():
    """Return seven frames of an open motion, somewhere else."""
    (motion,) = load_open_motions("coarse", subjects="lean runner", sequences="knees")
    frames = slice(0, 70, 10)
    poses, places = motion.pose_vectors[frames], motion.translations[frames]
    return ArrayMotion(
        ("ann", "knees"), 30.0, motion.model, motion.betas, poses, places + [0.3, 0.0, -0.2]
    )
