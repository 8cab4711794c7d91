"""Crossed arms or legs, and which of the two limbs is which.

In goes a `DenseFit`; out comes one whose crossed limbs are exchanged where that is nearer to the
scan. The last stage asks the same of the final pose.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import permutations

import numpy as np
from scipy.spatial import cKDTree

from riemhuman.arrays import Array, Integers
from riemhuman.bodies.skinning import JointMotions, Skeleton
from riemhuman.registration._constants import (
    CROSSING_METRES,
    CROSSING_SHARE,
    DENSE_SCALES,
    DIFFERENT_METRES,
    LIMB_METRES,
)
from riemhuman.registration._dense_fit import DenseFit, DenseTask, fit_closest, fit_joints
from riemhuman.registration._limbs import (
    BodyParts,
    are_less,
    faces_among,
    limited_distances,
    move_end,
    points_on,
)
from riemhuman.registration._posed_body import Pose, Prior
from riemhuman.registration._registration_model import RegistrationModel

_MIRROR = np.diag([-1.0, 1.0, 1.0])
# The joints of one side, from the one that stays, for the arms and legs whose ends cross.
_LIMBS = {
    "elbow": ("collar", "shoulder", "elbow", "wrist"),
    "knee": ("hip", "knee", "ankle", "toes"),
}


@dataclass(frozen=True, eq=False)
class Crossing:
    """Both forearms with hands, or both shins with feet, that are near each other."""

    joint: str
    vertices: Integers  # (n,) their numbers, ascending
    points: Array  # (m, 3) of the scan, on them

    def gap(self, task: DenseTask, pose: Pose, rival: Pose) -> float:
        """Return the mean distance between the limbs in two poses, metres."""
        first, second = (task.body.surface(compared)[self.vertices] for compared in (pose, rival))
        return float(np.linalg.norm(first - second, axis=1).mean())

    def distances(self, task: DenseTask, pose: Pose) -> Array:
        """Return the distances of the points, raised if the arms are implausible, metres."""
        surface = task.body.surface(pose)[self.vertices]
        faces = faces_among(task.body.model.faces, self.vertices)
        arms = task.body.arm_surfaces if self.joint == "elbow" else []
        strain = np.mean([arm.strain(pose.local) for arm in arms]) if arms else 1.0
        strained: Array = strain * limited_distances(self.points, surface, faces, LIMB_METRES)
        return strained


def crossing_joints(body: RegistrationModel, pose: Pose) -> list[str]:
    """Return elbow or knee, or both, if the forearms or shins below are near each other."""
    return [joint for joint in _LIMBS if _are_near(body, pose, joint)]


def _are_near(body: RegistrationModel, pose: Pose, joint: str) -> bool:
    surface = body.surface(pose)
    lower = _lower_limbs(body.parts, joint)
    return any(
        np.mean(cKDTree(surface[opposite]).query(surface[limb])[0] < CROSSING_METRES)
        > CROSSING_SHARE
        for limb, opposite in permutations(lower, 2)
    )


def _lower_limbs(parts: BodyParts, joint: str) -> list[Integers]:
    """Return the numbers of the vertices below the left and the right joint."""
    ends = parts.numbers(f"left_{joint}", f"right_{joint}")
    limbs = [np.flatnonzero(parts.vertices([end])) for end in ends]
    return [limb for limb in limbs if len(limb)]


def find_crossing(task: DenseTask, pose: Pose, joint: str) -> Crossing | None:
    """Return the forearms or shins of a body, below elbow or knee, if a scan shows them."""
    both = np.sort(np.concatenate(_lower_limbs(task.body.parts, joint)))
    points = points_on(task.scan.points, task.body.surface(pose), both)
    return Crossing(joint, both, points) if len(points) else None


def exchanged_limbs(task: DenseTask, pose: Pose, joint: str) -> list[tuple[Pose, Prior]]:
    """Return the body with arms or legs exchanged and fitted again, and their priors."""
    pairs = _pairs(task.body.parts, joint)
    moving = np.array(pairs).ravel()
    on_limbs = task.body.parts.vertices(moving.tolist())
    samples = task.samples.only((task.samples.numbers >= 0) & on_limbs[task.samples.numbers])
    mirrored = _mirror_limbs(pose.local, pairs), _mirror_limbs(task.prior.local, pairs)
    starts = [(pose._replace(local=mirrored[0]), task.prior._replace(local=mirrored[1]))]
    if len(pairs) == len(_LIMBS[joint]):
        starts.append((_swap_ends(task.samples.skeleton, pose, joint, np.array(pairs)), task.prior))
    return [
        (fit_joints(replace(task, prior=prior), moving, samples, DENSE_SCALES, start), prior)
        for start, prior in starts
    ]


def uncross_limbs(dense: DenseFit, *, known: bool) -> DenseFit:
    """Return a body with crossed arms and legs exchanged where that is nearer to the scan."""
    if known or dense.is_refused:  # limbs are as a moment before, or do not matter
        return dense
    for joint in crossing_joints(dense.task.body, dense.pose):
        task, pose = dense.task, dense.pose
        crossing = find_crossing(task, pose, joint)
        if crossing is None:
            continue
        fits = exchanged_limbs(task, pose, joint)
        distances = [crossing.distances(task, exchanged) for exchanged, _ in fits]
        nearest = int(np.argmin([strained.mean() for strained in distances]))
        start, prior = fits[nearest]
        is_elsewhere = crossing.gap(task, pose, start) > DIFFERENT_METRES
        is_nearer = are_less(distances[nearest], crossing.distances(task, pose))
        if is_elsewhere and is_nearer:
            task = replace(task, prior=prior)
            pose = fit_closest(task.samples, start, prior, task.scan, DENSE_SCALES)
            dense = replace(dense, task=task, pose=pose)
    return dense


def _mirror_limbs(local: Array, pairs: list[list[int]]) -> Array:
    """Return rotations mirrored between left and right."""
    mirrored = local.copy()
    for left, right in pairs:
        # Mirrored: y and z change sign.
        mirrored[[left, right]] = _MIRROR @ local[[right, left]] @ _MIRROR
    return mirrored


def _swap_ends(skeleton: Skeleton, pose: Pose, joint: str, pairs: Integers) -> Pose:
    """Return a pose with both hands or feet exchanged, as far as the limbs reach."""
    # An arm moves from its shoulder, a leg from its hip.
    first = _LIMBS[joint].index("shoulder" if joint == "elbow" else "hip")
    left, right = pairs[first : first + 3].T
    positions = JointMotions(skeleton, pose.local, pose.betas).positions
    shift = positions[right[-1]] - positions[left[-1]]
    return move_end(skeleton, move_end(skeleton, pose, left, shift), right, -shift)


def _pairs(parts: BodyParts, joint: str) -> list[list[int]]:
    """Return the left and right joints of arms or legs that a model has."""
    pairs = [parts.numbers(f"left_{name}", f"right_{name}") for name in _LIMBS[joint]]
    return [pair for pair in pairs if len(pair) == 2]
